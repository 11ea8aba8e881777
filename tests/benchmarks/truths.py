"""Makes references that ship: `make references`, or `PYTHONPATH=tests python tests/benchmarks/truths.py [SCENE ...]`.

Climbs each scene's ladder for as long as given and writes scenes/references/SCENE.json. Levels are kept in the cache:
what was interrupted goes on, and another call of as many minutes goes on to finer levels. Other code begins anew, so
this is run last, when physics does not change any more. The minutes are processor time, without compiling; all scenes
together take 12 times as much, on a machine without other work: 4 hours.

A file that is there is first checked with two of its levels, run anew. Where these do what they did, a scene that is
only written otherwise (a new key, say) has its file stamped anew, and no ladder is climbed; else a file is replaced by
what comes from levels as fine or finer only, whatever is claimed of these. Delete it to have another in any case.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from benchmarks.plans import SCENES
from rich.console import Console
from rich.table import Table

from softseam.chart.assemble import counted
from softseam.chart.climb import climb
from softseam.chart.errors import KNOWN
from softseam.chart.frame import frame_of
from softseam.chart.ladder import Ladder
from softseam.chart.measure import quantity_names
from softseam.chart.progress import ChartProgress
from softseam.chart.reference import Reference, in_words, origin
from softseam.chart.shipped import DIGITS, Shipped, is_as_fine, moved, path_of, read, shipping, write
from softseam.embedded import solver_digest
from softseam.errors import SoftseamError
from softseam.scenes import load_scene
from softseam.variants import AS_GIVEN, with_settings
from softseam.view.colors import label
from softseam_protocol.facts import machine

MINUTES = 20.0
TARGET = 1e-4
"""as good as none: a ladder is climbed for as long as given [1]"""


def make(name: str, minutes: float, console: Console) -> tuple[Path, Reference]:
    """Climb a scene's ladder, write what it leads to or keep what is there, and return where and what."""
    scene = with_settings(load_scene(name), AS_GIVEN)
    code, frame = solver_digest(), frame_of(scene, name, AS_GIVEN)
    ladder = Ladder(name, AS_GIVEN, frame, quantity_names(scene))
    ladder.open(code, fresh=False)
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
