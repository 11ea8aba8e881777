"""Makes references that ship: `make references`, or `PYTHONPATH=tests python tests/benchmarks/truths.py [SCENE ...]`.

Climbs each scene's ladder for as long as given and writes scenes/references/SCENE.json. Levels are kept in the cache:
what was interrupted goes on, and another call of as many minutes goes on to finer levels. Levels of other code are
taken over where two of them, run anew, do what they did; where physics changed, all begins anew. The minutes are
processor time, without compiling; all scenes together take 12 times as much, on a machine without other work: 4 hours.

A file that is there is first checked with two of its levels, run anew. Where these do what they did, a scene that is
only written otherwise (a new key, say) has its file stamped anew, and no ladder is climbed; else a file is replaced by
what comes from levels as fine or finer only, whatever is claimed of these. Delete it to have another in any case.
"""

from __future__ import annotations

import argparse
import json
import math
import os
from pathlib import Path

from benchmarks.plans import SCENES
from rich.console import Console
from rich.table import Table

from softseam.chart.assemble import counted
from softseam.chart.climb import climb
from softseam.chart.errors import KNOWN, rms, scale_of
from softseam.chart.frame import frame_of
from softseam.chart.ladder import Ladder
from softseam.chart.measure import Outcome, quantity_names
from softseam.chart.progress import ChartProgress
from softseam.chart.reference import Reference, in_words, origin
from softseam.chart.shipped import CHECKED, DIGITS, Shipped, is_as_fine, moved, path_of, read, shipping, write
from softseam.chart.store import Identity, Store, cache_folder
from softseam.embedded import solver_digest
from softseam.errors import SoftseamError
from softseam.scenes import load_scene
from softseam.variants import AS_GIVEN, with_settings
from softseam.view.colors import label
from softseam_protocol.facts import machine

MINUTES = 20.0
TARGET = 1e-4
"""as good as none: a ladder is climbed for as long as given [1]"""
ALIKE = 1e-5
"""a level that other code computed is this code's where quantities differ by less, relative to their size [1]"""


def make(name: str, minutes: float, console: Console) -> tuple[Path, Reference]:
    """Climb a scene's ladder, write what it leads to or keep what is there, and return where and what."""
    scene = with_settings(load_scene(name), AS_GIVEN)
    code, frame = solver_digest(), frame_of(scene, name, AS_GIVEN)
    ladder = Ladder(name, AS_GIVEN, frame, quantity_names(scene))
    ladder.open(code, fresh=False)
    take_over(ladder, code, console)
    path = path_of(scene.name)
    there = read(path)
    if there is not None and not holds(there, ladder, console):
        there = None
    if there is not None and there.scene != ladder.key:
        console.print("the scene is written otherwise, and does what it did: its file is stamped anew")
        write(there.model_copy(update={"scene": ladder.key}), path)
        return path, counted(there.reference, ladder.names)
    with ChartProgress(console) as progress:
        reference = climb(ladder, frame, 60.0 * minutes, progress.reference, TARGET, KNOWN)
    if there is not None and not is_as_fine(reference, ships := counted(there.reference, ladder.names)):
        console.print("what is there comes from finer levels, and stays")
        return path, ships
    write(shipping(reference, ladder, code[:16], machine()), path)
    return path, reference


def take_over(ladder: Ladder, code: str, console: Console) -> None:
    """Keep as this code's what other code computed, where it did what this code does in two of its levels: that of
    most cells at the longest step and that of the shortest step, of those that took a few seconds.
    """
    folder = cache_folder() / f"{ladder.scene}-{ladder.key[:12]}"
    ours = Store(folder.with_name(f"{folder.name}-{code[:8]}"), Identity(ladder.key, code), "")
    for other in sorted(folder.parent.glob(f"{folder.name}-*")):
        files = [path for path in other.glob("level-*-looked.json") if not ours.path(path.stem).is_file()]
        data = {path.stem: json.loads(path.read_text(encoding="utf-8"))["data"] for path in files}
        levels = {name: Outcome.from_json(found) for name, found in data.items()}
        quick = sorted((step, across, name) for name in levels for across, step in [rung_of(name)])
        quick = [rung for rung in quick if levels[rung[2]].spent <= CHECKED]
        if not quick:
            continue
        # the last has the longest step, and of these the most cells; the first has the shortest
        off = max(apart(ladder, (across, step), levels[name]) for step, across, name in (quick[-1], quick[0]))
        alike = off <= ALIKE
        told = f"are {'' if alike else 'not '}taken over: two of them now differ by {in_words(off)}"
        console.print(f"{len(levels)} levels of {other.name} {told}", markup=False)
        for name, found in data.items() if alike else ():
            ours.write(name, found)


def rung_of(name: str) -> tuple[int, float]:
    """Cells across and step [s] of a level, from its file's name."""
    _, across, step, _ = name.split("-")
    return int(across), 1e-3 * float(step.removesuffix("ms"))


def apart(ladder: Ladder, rung: tuple[int, float], then: Outcome) -> float:
    """By how much a level, run anew, differs from what it did: the worst quantity, relative to its scale [1]."""
    ladder.run(*rung, math.inf)
    now, time = ladder.series(rung), ladder.common([rung])
    if then.series is None or len(then.series.time) != len(time) or not {*now.values} <= {*then.series.values}:
        return math.inf
    found = ((name, now.at(name, time), then.series.at(name, time)) for name in now.values)
    scale = {name: scale_of(name, now.at(name, time), now.travel, time) for name in now.values}
    return max(rms(a - b, time) / scale[name] if (a != b).any() else 0.0 for name, a, b in found)


def holds(there: Shipped, ladder: Ladder, console: Console) -> bool:
    """Whether a file is of what today's code does in today's scene; of one that was changed, to its last digit."""
    if not there.knows(ladder.names):
        return False
    try:
        off = moved(there, ladder) if there.scene == ladder.key else moved(there, ladder, DIGITS, 1e-5)
    except SoftseamError as error:
        console.print(f"what is there no longer holds: {error}", markup=False)
        return False
    if off:
        told = ", ".join(f"{label(name)} by {in_words(change)}" for name, change in off.items())
        console.print(f"what is there no longer holds: a level moved, {told}")
    return not off


def table(reference: Reference) -> Table:
    """What is known of each quantity."""
    found = Table(box=None, padding=(0, 2))
    for column in ("quantity", "known to", "cells", "steps", ""):
        found.add_column(column)
    for name, true in reference.truth.items():
        part = reference.parts[name]
        numbers = (true.uncertainty, part.uncertainty_cells, part.uncertainty_steps)
        found.add_row(label(name), *map(in_words, numbers), true.left_out and f"not counted: {true.left_out}")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="only these; default: the suite of plans.py")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="for a scene")
    given = parser.parse_args()
    console, failed = Console(), []
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    for name in given.scenes or SCENES:
        console.rule(name)
        try:
            path, reference = make(name, given.minutes, console)
        except SoftseamError as error:
            # the other scenes are worth their minutes; the levels of this one are kept
            console.print(f"{name}: {error}", style="red", markup=False)
            failed.append(name)
            continue
        levels = ", ".join(f"{level.across} at {1e3 * level.step:.3g} ms" for level in reference.levels)
        console.print(table(reference))
        console.print(f"{path}, {path.stat().st_size / 1e3:.0f} kB: {origin(reference)} (cells across: {levels})")
    if failed:
        raise SystemExit(f"no reference was made of {', '.join(failed)}: see why above")


if __name__ == "__main__":
    main()
