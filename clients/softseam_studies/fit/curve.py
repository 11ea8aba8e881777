"""Measured force curves: a file of columns, and how a run is read off at its times."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from softseam.errors import BadInput, not_among
from softseam.losses import Run

Floats = NDArray[np.float64]
_AXES = ("x", "y", "z")
_TIME = "time"
MOST_BYTES = 32 * 2**20


@dataclass(frozen=True)
class Curve:
    """m times, k columns of force."""

    time: Floats
    """(m,) [s]"""
    columns: tuple[str, ...]
    """`TOOL`, the size of the force of the body on it, or `TOOL.x`, `TOOL.y`, `TOOL.z`"""
    force: Floats
    """(m, k) [N]"""


def read_curve(path: Path, tools: Sequence[str]) -> Curve:
    """A CSV file with a line of names: `time`, and a column for each force. Raises BadInput with file and line."""
    known = [_TIME, *(name for tool in tools for name in (tool, *(f"{tool}.{axis}" for axis in _AXES)))]
    names, table, lines = read_columns(path, known, f"time,{(*tools, 'left')[0]}")
    if _TIME not in names or len(names) < 2:
        raise BadInput(f"{path}:1: name each column once: time, and at least one force ({', '.join(known[1:])})")
    at = names.index(_TIME)
    time, force = table[:, at], np.delete(table, at, axis=1)
    check_order(path, "time", "s", time, lines)
    if len(time) and time[0] < 0.0:
        raise BadInput(f"{path}:{lines[0]}: the time {time[0]:g} s is before the run begins, at 0 s")
    return Curve(time, tuple(name for name in names if name != _TIME), force)


def read_columns(path: Path, known: Sequence[str], example: str) -> tuple[list[str], Floats, list[int]]:
    """Names of the columns (k,) of a CSV file, its numbers (m, k), and their lines (m,). Raises BadInput."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise BadInput(f"{path}: larger than {MOST_BYTES // 2**20} MiB: is this a measured curve?")
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [
                (number, row) for number, row in enumerate(csv.reader(file), 1) if any(cell.strip() for cell in row)
            ]
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error):
        raise BadInput(f"{path}: not a text of comma-separated columns") from None
    if not rows:
        raise BadInput(f"{path}: empty: begin with a line of names, e.g. {example}")
    (first, header), body = rows[0], rows[1:]
    names = [cell.strip() for cell in header]
    for name in names:
        if name not in known:
            raise BadInput(f"{path}:{first}: no column is called {not_among(name, known)}")
    if len(set(names)) < len(names):
        raise BadInput(f"{path}:{first}: name each column once")
    table = np.array([_numbers(path, number, row, names) for number, row in body]).reshape(-1, len(names))
    return names, table, [number for number, _ in body]


def check_order(path: Path, name: str, unit: str, values: Floats, lines: Sequence[int]) -> None:
    """Raises BadInput where a column (m,) does not grow from line to line."""
    for before, line, after in zip(values[:-1], lines[1:], values[1:], strict=True):
        if after <= before:
            raise BadInput(
                f"{path}:{line}: the {name} {after:g} {unit} does not follow {before:g} {unit}: sort the rows by {name}"
            )


def _numbers(path: Path, number: int, row: Sequence[str], names: Sequence[str]) -> list[float]:
    """A row's numbers. Raises BadInput."""
    if len(row) != len(names):
        raise BadInput(f"{path}:{number}: {len(row)} cells, where {len(names)} columns are named")
    values = []
    for name, cell in zip(names, row, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise BadInput(f"{path}:{number}: {name} is {cell.strip()!r}: give a finite number, or leave the row out")
        values.append(value)
    return values


def check_times(curve: Curve, path: Path, end: float, dt: float) -> None:
    """Raises BadInput where the curve goes on when the run is over, at `end` [s]."""
    if len(curve.time) and curve.time[-1] > end + 0.5 * dt:
        raise BadInput(
            f"{path}: times go to {curve.time[-1]:g} s, and the scene's run ends at {end:g} s: leave out later rows, "
            "or make the scene's motion or duration longer"
        )


def read_off(curve: Curve, run: Run, slopes: Floats) -> tuple[Floats, Floats]:
    """Forces of a run at the curve's times (m k,) [N], and their slopes (m k, p).

    slopes (p, s, t, 3): of forces on tools, by each of p numbers. Between ends of steps, and from none at the start of
    the run, forces go straight.
    """
    tools, grid = list(run.force), np.concatenate([[0.0], run.time])
    found, by = [], []
    for column in curve.columns:
        tool, _, axis = column.partition(".")
        force, slope = run.force[tool], slopes[:, :, tools.index(tool)]
        if axis:
            value, change = force[:, _AXES.index(axis)], slope[:, :, _AXES.index(axis)]
        else:
            value = np.linalg.norm(force, axis=1)
            unit = np.divide(force, value[:, None], out=np.zeros_like(force), where=value[:, None] > 0.0)
            change = np.einsum("psi,si->ps", slope, unit)
        found.append(np.interp(curve.time, grid, np.concatenate([[0.0], value])))
        by.append(np.stack([np.interp(curve.time, grid, np.concatenate([[0.0], each])) for each in change], axis=1))
    return np.stack(found, axis=1).ravel(), np.stack(by, axis=1).reshape(-1, len(slopes))
