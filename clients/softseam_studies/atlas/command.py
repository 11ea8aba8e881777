"""`softseam atlas`: run the maps, draw them, and say what was found."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.embedded import solver_digest
from softseam.errors import BadInput, SoftseamError, missing_extra, not_among, require_extra
from softseam.outputs import check_outputs
from softseam.report import write_json
from softseam_protocol.facts import machine
from softseam_studies.atlas import long_run, pitfalls
from softseam_studies.atlas.atlas import MAPS, Filled, expected, fill, forget, kept, store_of
from softseam_studies.atlas.pitfalls import Row
from softseam_studies.atlas.verdicts import KINDS
from softseam_studies.cli_studies import Atlas
from softseam_studies.study.progress import ChartProgress
from softseam_studies.study.store import Store

ATLAS_VERSION = 1
PITFALLS = "pitfalls"


@dataclass(frozen=True)
class Found:
    """What the atlas holds: what was asked for, and what is kept from before of the same code."""

    maps: tuple[Filled, ...]
    """all, in their order; without verdicts where one was not computed"""
    pitfalls: tuple[Row, ...]

    @property
    def computed(self) -> tuple[Filled, ...]:
        return tuple(filled for filled in self.maps if filled.verdicts)


def atlas(wishes: Atlas, console: Console) -> Found:
    """Fill the maps, and leave a picture of each, overview.png, atlas.csv and atlas.json; or the long run alone.

    The files hold all maps that are kept of the same code, also where only some are asked for. Raises BadInput for an
    unknown map, for maps beside the long run, and for kept runs that are spoilt or of other code.
    """
    _check(wishes)
    require_extra("solve", "simulating in this process")
    require_extra("view", "drawing an atlas")
    folder = wishes.out or Path("out") / "atlas"
    check_outputs([], [("--out", folder)], inputs={})
    store = store_of(folder)
    if wishes.long:
        if wishes.fresh:
            forget(store, long_run.PREFIX)
        long_run.long_run(store, folder, console)
        return Found((), ())
    began = perf_counter()
    names = wishes.maps or _names()
    if wishes.fresh:
        for name in names:
            forget(store, name if name in MAPS else pitfalls.PREFIX)
    found = _find(names, store, console)
    _write(folder, found)
    n_runs = sum(len(filled.verdicts) for filled in found.maps if filled.map.name in names)
    _tell(console, folder, found, f"{n_runs} runs in {perf_counter() - began:.0f} s")
    return found


def _names() -> tuple[str, ...]:
    """All that can be asked for: maps may have been added from outside."""
    return (*MAPS, PITFALLS)


def _check(wishes: Atlas) -> None:
    """Raise BadInput where the wishes do not go together."""
    names = _names()
    for name in wishes.maps:
        if name not in names:
            raise BadInput(f"no map is called {not_among(name, names)}")
    if wishes.long and wishes.maps:
        raise BadInput(f"--long is a run of its own, beside the maps: leave out {' '.join(wishes.maps)}, or --long")


def _find(names: Sequence[str], store: Store, console: Console) -> Found:
    """Fill the maps asked for, then read the others as far as they are kept."""
    maps = {name: build() for name, build in MAPS.items()}
    wanted = [of for name, of in maps.items() if name in names]
    with ChartProgress(console) as progress:
        progress.expect(expected(wanted), math.inf)
        done = {of.name: fill(of, store, progress.configuration) for of in wanted}
    filled = tuple(done[of.name] if of.name in done else kept(of, store) for of in maps.values())
    measure = pitfalls.pitfalls if PITFALLS in names else pitfalls.kept_pitfalls
    return Found(filled, tuple(measure(store)))


def _write(folder: Path, found: Found) -> None:
    try:
        from softseam_studies.atlas.draw import draw_map, draw_overview
    except ImportError as error:
        raise missing_extra(error, "drawing an atlas") from error
    from softseam_studies.atlas.atlas import write_csv

    code = solver_digest()[:8]
    here = f"{machine()}; code {code}"
    document = {
        "atlas_version": ATLAS_VERSION,
        "machine": machine(),
        "code": code,
        "maps": [filled.as_json() for filled in found.maps],
        "pitfalls": pitfalls.rows_json(found.pitfalls),
    }
    try:
        write_json(document, folder / "atlas.json")
        write_csv(found.maps, folder / "atlas.csv")
        for filled in found.computed:
            draw_map(folder / f"{filled.map.name}.png", filled, here)
        draw_overview(folder / "overview.png", found.maps, here)
    except OSError as error:
        raise SoftseamError(f"cannot write {error.filename or folder}: {error.strerror}") from error


def _tell(console: Console, folder: Path, found: Found, spent: str) -> None:
    """How many runs are of which kind, those that were wrong in silence, the pitfalls, and the files."""
    if found.computed:
        table = Table(box=None, padding=(0, 1))
        table.add_column("map")
        for kind in KINDS:
            table.add_column(kind, justify="right")
        table.add_column("in silence", justify="right")
        for filled in found.computed:
            count = filled.count()
            table.add_row(filled.map.name, *(str(count[kind]) for kind in KINDS), str(len(filled.silent)))
        console.print(table)
        for line in silent_lines(found.maps):
            console.print(Text(line, style="yellow"), soft_wrap=True)
    missing = [filled.map.name for filled in found.maps if not filled.verdicts]
    missing += [] if found.pitfalls else [PITFALLS]
    if missing:
        line = f"not computed with this code: {', '.join(missing)} (softseam atlas {' '.join(missing)})"
        console.print(Text(line, style="dim"), soft_wrap=True)
    if found.pitfalls:
        table = Table(box=None, padding=(0, 2))
        for name in ("pitfall", "the control fails", "the remedy holds"):
            table.add_column(name)
        for row in found.pitfalls:
            table.add_row(row.name, row.control, row.remedy, style="" if row.holds else "bold red")
        console.print(table)
    console.print(Text(spent, style="dim"))
    pictures = [f"{filled.map.name}.png" for filled in found.computed]
    for name in ("overview.png", *pictures, "atlas.csv", "atlas.json"):
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
