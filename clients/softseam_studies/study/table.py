"""The chart's rows: every configuration with its speed, its errors, and what else there is to say."""

import csv
import io
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from softseam.outputs import write_whole
from softseam_studies.study.configurations import Configuration
from softseam_studies.study.errors import Error, errors, worst
from softseam_studies.study.measure import Outcome
from softseam_studies.study.reference import Reference


@dataclass(frozen=True)
class Row:
    """One configuration in the chart."""

    configuration: Configuration
    outcome: Outcome
    errors: Mapping[str, Error]
    """of every quantity; empty where the run is not done"""
    error: Error | None
    """the worst of those that count; None where the run is not done"""
    front: bool = False
    """whether no other is faster and more accurate"""

    @property
    def reason(self) -> str:
        """Why there is no error; '' where there is."""
        return f"{self.outcome.status}: {self.outcome.reason}" if self.error is None else ""


def rows_of(wanted: Sequence[Configuration], outcomes: Mapping[str, Outcome], reference: Reference) -> list[Row]:
    """Rows in the order of the configurations, the Pareto front marked."""
    rows = []
    for configuration in wanted:
        outcome = outcomes[configuration.key]
        if outcome.status != "done" or outcome.series is None:
            rows.append(Row(configuration, outcome, {}, None))
            continue
        found = errors(outcome.series, reference.time, reference.truth)
        rows.append(Row(configuration, outcome, found, worst(found, reference.truth)))
    at = [i for i, row in enumerate(rows) if row.error is not None and np.isfinite(row.error.value)]
    points = [(rows[i].outcome.rtf, error.value) for i in at if (error := rows[i].error) is not None]
    front = {at[i] for i in pareto_front(points)}
    return [replace(row, front=i in front) for i, row in enumerate(rows)]


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices, by falling speed, of the points (speed, error) that no other is faster and more accurate than.

    A point that another equals in one and beats in the other is not on the front; of equal points the first is.
    """
    front: list[int] = []
    best = float("inf")
    for i in sorted(range(len(points)), key=lambda i: (-points[i][0], points[i][1], i)):
        if points[i][1] < best:
            front.append(i)
            best = points[i][1]
    return front


def unrun(rows: Sequence[Row]) -> int:
    """How many configurations had no time, or not enough."""
    return sum(row.outcome.was_late for row in rows)


def busy(rows: Sequence[Row]) -> str:
    """What to say of a machine that had other work, which is left out of the speeds; '' where it had none."""
    return busy_by(core_share(rows))


def core_share(rows: Sequence[Row]) -> float:
    """What other work left the median run of a core [1]."""
    shares = [row.outcome.cpu / statistics.median(row.outcome.walls) for row in rows if row.outcome.cpu > 0.0]
    return statistics.median(shares) if shares else 1.0


def busy_by(share: float) -> str:
    """The same of a share of a core [1]."""
    text = f"; other work left the runs {100 * share:.0f} % of a core, so their processor time counts"
    return "" if share > 0.85 else text


def row_json(row: Row) -> dict[str, Any]:
    """A row as plain data; an infinite error is None."""
    outcome = row.outcome
    low, high = outcome.spread
    return {
        "key": row.configuration.key,
        "method": row.configuration.method,
        "label": row.configuration.label,
        "settings": list(row.configuration.settings),
        "status": outcome.status,
        "reason": outcome.reason,
        "rtf": _round(outcome.rtf),
        "rtf_least": _round(low),
        "rtf_greatest": _round(high),
        "runs": len(outcome.walls),
        "error": None if row.error is None else _round(row.error.value),
        "at_most": row.error is not None and row.error.bound,
        "accuracy": None if row.error is None else _round(1.0 - row.error.value),
        "pareto": row.front,
        "errors": {name: {"value": _round(e.value), "at_most": e.bound} for name, e in row.errors.items()},
        "cpu_seconds": _round(outcome.cpu),
        "compile_seconds": _round(outcome.compiled),
        "setup_seconds": _round(outcome.setup),
        "simulated_seconds": _round(outcome.simulated),
        "steps": outcome.steps,
        "n_cells": outcome.n_cells,
        "n_nodes": outcome.n_nodes,
    }


def write_csv(rows: Sequence[Row], names: Sequence[str], path: Path) -> Path:
    """Write the rows as CSV, all or nothing; errors relative, not in per cent."""
    text, every = io.StringIO(), [row_json(row) for row in rows]
    columns = [name for name in every[0] if name != "errors"] if every else []
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*columns, *(f"error.{name}" for name in names), *(f"at_most.{name}" for name in names)])
    for row in every:
        cells = [" ".join(row[c]) if c == "settings" else _cell(row[c]) for c in columns]
        cells += [_cell(row["errors"].get(name, {}).get(key)) for key in ("value", "at_most") for name in names]
        writer.writerow(cells)
    return write_whole(path, text.getvalue())


def _cell(value: Any) -> str:
    return "" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _round(value: float) -> float | None:
    return float(f"{value:.5g}") if np.isfinite(value) else None
