"""The maps by name, and their runs: kept as soon as they are done, so that a broken-off atlas goes on."""

import csv
import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from softseam.embedded import solver_digest
from softseam.errors import BadInput
from softseam.outputs import whole
from softseam_studies.atlas.grid import Cell, Map, build
from softseam_studies.atlas.runs import RUNS
from softseam_studies.atlas.verdicts import KINDS, Kind, Verdict
from softseam_studies.study.configurations import Configuration
from softseam_studies.study.measure import Told, timed_for
from softseam_studies.study.store import Identity, Store

MAPS: dict[str, Callable[[], Map]] = {name: partial(build, name, run) for name, run in RUNS.items()}


@dataclass(frozen=True)
class Filled:
    """A map with a verdict for every cell, or with none where it was not computed."""

    map: Map
    verdicts: Mapping[str, Verdict]
    """by the cell's key"""

    @property
    def judged(self) -> list[tuple[Cell, Verdict]]:
        """Every cell with its verdict; none where the map was not computed."""
        return [(cell, self.verdicts[self.map.key(cell)]) for cell in self.map.cells] if self.verdicts else []

    def count(self) -> dict[Kind, int]:
        """How many cells are of each kind."""
        return {kind: sum(verdict.kind == kind for verdict in self.verdicts.values()) for kind in KINDS}

    @property
    def silent(self) -> list[tuple[Cell, Verdict]]:
        """Cells that are wrong without saying so, and were not meant to be."""
        return [(cell, verdict) for cell, verdict in self.judged if verdict.silent and not cell.control]

    def as_json(self) -> dict[str, Any]:
        return {
            "name": self.map.name,
            "title": self.map.title,
            "text": self.map.text,
            "computed": bool(self.verdicts),
            "panels": [vars(panel) for panel in self.map.panels],
            "count": self.count(),
            "cells": [
                {
                    "panel": cell.panel,
                    "column": cell.column,
                    "row": cell.row,
                    "label": cell.label,
                    "control": cell.control,
                }
                | verdict.as_json()
                for cell, verdict in self.judged
            ],
        }


Watch = Callable[[Configuration, float], Told]


def expected(maps: Sequence[Map]) -> list[Configuration]:
    """The cells as the chart's progress knows them."""
    return [
        Configuration(of.key(cell), "as it is", f"{of.title}: {cell.label}", (), cell.seconds)
        for of in maps
        for cell in of.cells
    ]


def fill(of: Map, store: Store, watch: Watch) -> Filled:
    """Run the cells that are not kept; raises BadInput for a kept one that is spoilt."""
    verdicts = {}
    for cell in of.cells:
        key = of.key(cell)
        verdict = _kept(key, store)
        if verdict is None:
            shown = Configuration(key, "as it is", f"{of.title}: {cell.label}", (), cell.seconds)
            watch(shown, cell.seconds + timed_for(cell.seconds))
            verdict = cell.run()
            store.write(key, verdict.as_json())
        verdicts[key] = verdict
    return Filled(of, verdicts)


def kept(of: Map, store: Store) -> Filled:
    """A map as it was computed before; without verdicts where a cell is missing, spoilt or of other code."""
    verdicts = {}
    for key in map(of.key, of.cells):
        try:
            verdict = _kept(key, store)
        except BadInput:
            return Filled(of, {})
        if verdict is None:
            return Filled(of, {})
        verdicts[key] = verdict
    return Filled(of, verdicts)


def _kept(key: str, store: Store) -> Verdict | None:
    """The verdict of a finished cell, None where there is none. Raises BadInput where it is spoilt or of other code."""
    data = store.read(key)
    if data is None:
        return None
    try:
        return Verdict.from_json(data)
    except (KeyError, TypeError, ValueError) as error:
        raise store.refused(key, f"is corrupt ({error})") from None


def store_of(folder: Path) -> Store:
    """Where finished cells are kept: they belong to the solvers' sources and to the atlas's own."""
    return Store(
        folder / "runs",
        Identity(_own_digest(), solver_digest()),
        "start anew with --fresh",
        writer="softseam atlas",
        other="another version of the atlas",
    )


def forget(store: Store, prefix: str) -> None:
    """Delete the kept runs of one map (or of the pitfalls, or the long runs), whatever code they are of."""
    for name in store.names(f"{prefix}-"):
        store.path(name).unlink(missing_ok=True)


def _own_digest() -> str:
    digest = hashlib.sha256()
    here = Path(__file__).parent
    for path in (*sorted(here.glob("*.py")), *sorted((here / "maps").glob("*.yaml"))):
        digest.update(path.read_bytes())
    return digest.hexdigest()


NOT_COMPUTED = "not computed"
COLUMNS = ("map", "panel", "x", "y", "kind", "silent", "control", "error", "safeguards", "told", "why")


def write_csv(maps: Sequence[Filled], path: Path) -> None:
    """Write all maps, all or nothing; errors relative, not in per cent. One row says that a map was not computed."""
    with whole(path) as fresh, fresh.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for filled in maps:
            if not filled.verdicts:
                writer.writerow((filled.map.name, "", "", "", NOT_COMPUTED, *[""] * (len(COLUMNS) - 5)))
            for cell, judged in filled.judged:
                verdict = judged.as_json()
                panel = filled.map.panels[cell.panel]
                where = (filled.map.name, panel.title, panel.columns[cell.column], panel.rows[cell.row])
                flags = (verdict["kind"], str(verdict["silent"]).lower(), str(cell.control).lower())
                error = "" if verdict["error"] is None else str(verdict["error"])
                lists = ("; ".join(verdict["safeguards"]), "; ".join(verdict["told"]))
                writer.writerow((*where, *flags, error, *lists, verdict["why"]))
