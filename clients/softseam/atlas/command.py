"""`softseam atlas`: run the maps, draw them, and say what was found."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.atlas.atlas import MAPS, Filled, expected, fill, store_of
from softseam.atlas.pitfalls import Row, pitfalls, rows_json
from softseam.atlas.verdicts import KINDS
from softseam.chart.progress import ChartProgress
from softseam.errors import BadInput, SoftseamError, missing_extra, require_extra
from softseam.report import write_report
from softseam_protocol.facts import machine

ATLAS_VERSION = 1
PITFALLS = "pitfalls"
NAMES = (*MAPS, PITFALLS)


@dataclass(frozen=True)
class Wishes:
    """What `softseam atlas` was asked for."""

    maps: tuple[str, ...] = ()
    """by name; none: all"""
    out: Path | None = None
    long: bool = False
    fresh: bool = False


@dataclass(frozen=True)
class Found:
    """What the atlas holds."""

    maps: tuple[Filled, ...]
    pitfalls: tuple[Row, ...]


def atlas(wishes: Wishes, console: Console) -> Found:
    """Fill the maps, and leave a picture of each, overview.png, atlas.csv and atlas.json; or the long run alone."""
    for name in wishes.maps:
        if name not in NAMES:
            near = difflib.get_close_matches(name, NAMES, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise BadInput(f"no map is called {name!r}{hint} (there are: {', '.join(NAMES)})")
    require_extra("solve", "simulating in this process")
    require_extra("view", "drawing an atlas")
    folder = wishes.out or Path("out") / "atlas"
    store = store_of(folder)
    if wishes.fresh:
        store.clear()
    if wishes.long:
        from softseam.atlas.long_run import long_run

        long_run(store, folder, console)
        return Found((), ())
    began = perf_counter()
    wanted = [build() for name, build in MAPS.items() if not wishes.maps or name in wishes.maps]
    with ChartProgress(console) as progress:
        progress.expect(expected(wanted), math.inf)
        filled = tuple(fill(of, store, progress.configuration) for of in wanted)
    rows = tuple(pitfalls(store)) if not wishes.maps or PITFALLS in wishes.maps else ()
    found = Found(filled, rows)
    _write(folder, found)
    _tell(console, folder, found, perf_counter() - began)
    return found


def _write(folder: Path, found: Found) -> None:
    try:
        from softseam.atlas.draw import draw_map, draw_overview
    except ImportError as error:
        raise missing_extra(error, "drawing an atlas") from error
    from softseam.atlas.table import write_csv

    here = machine()
    document = {
        "atlas_version": ATLAS_VERSION,
        "machine": here,
        "maps": [filled.as_json() for filled in found.maps],
        "pitfalls": rows_json(found.pitfalls),
    }
    try:
        write_report(document, folder / "atlas.json")
        write_csv(found.maps, folder / "atlas.csv")
        for filled in found.maps:
            draw_map(folder / f"{filled.map.name}.png", filled, here)
        if len(found.maps) > 1:
            draw_overview(folder / "overview.png", found.maps, here)
    except OSError as error:
        raise SoftseamError(f"cannot write {error.filename}: {error.strerror}") from error


def _tell(console: Console, folder: Path, found: Found, seconds: float) -> None:
    """How many runs are of which kind, those that were wrong in silence, the pitfalls, and the files."""
    if found.maps:
        table = Table(box=None, padding=(0, 1))
        table.add_column("map")
        for kind in KINDS:
            table.add_column(kind, justify="right")
        table.add_column("in silence", justify="right")
        for filled in found.maps:
            count = filled.count()
            table.add_row(filled.map.name, *(str(count[kind]) for kind in KINDS), str(len(filled.silent)))
        console.print(table)
        for line in silent_lines(found.maps):
            console.print(Text(line, style="yellow"), soft_wrap=True)
    if found.pitfalls:
        table = Table(box=None, padding=(0, 2))
        for name in ("pitfall", "the control fails", "the remedy holds"):
            table.add_column(name)
        for row in found.pitfalls:
            table.add_row(row.name, row.control, row.remedy, style="" if row.holds else "bold red")
        console.print(table)
    console.print(Text(f"{sum(len(filled.verdicts) for filled in found.maps)} runs in {seconds:.0f} s", style="dim"))
    pictures = [f"{filled.map.name}.png" for filled in found.maps]
    overview = ["overview.png"] if len(found.maps) > 1 else []
    for name in (*overview, *pictures, "atlas.csv", "atlas.json"):
        console.print(f"{folder / name}", highlight=False, soft_wrap=True)


def silent_lines(maps: Sequence[Filled], most: int = 4) -> list[str]:
    """Runs that were wrong and did not say so: a few of each map."""
    lines = []
    for filled in maps:
        silent = filled.silent
        lines += [f"wrong in silence: {cell.label}: {verdict.why}" for cell, verdict in silent[:most]]
        if len(silent) > most:
            lines.append(f"wrong in silence: {len(silent) - most} more in {filled.map.title!r}, see atlas.csv")
    return lines
