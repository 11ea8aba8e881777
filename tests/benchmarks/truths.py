"""Makes references that ship: `make references`, or `PYTHONPATH=tests python tests/benchmarks/truths.py [SCENE ...]`.

Refines each scene for as long as given and writes scenes/references/SCENE.json. Levels are stored in the cache: what
was interrupted goes on, and another call of as many minutes goes on to finer levels. The minutes are processor time,
without compiling; all scenes together take 12 times as much, on a machine without other work: 4 hours.

A file that is there is first checked with two of its levels, run anew. Where these do what they did, a scene that is
only written otherwise (a new key, say) has its file stamped anew, and nothing is refined; else a file is replaced by
what comes from levels as fine or finer only, whatever is claimed of these. Delete it to have another in any case, as
where only steps changed that are shorter than those checked.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

from benchmarks.plans import SCENES
from benchmarks.reference_files import DIGITS, is_as_fine, moved, shipping, write
from rich.console import Console
from rich.table import Table

from softseam.embedded import solver_digest
from softseam.errors import SoftseamError
from softseam.scenes import load_scene
from softseam.variants import AS_GIVEN, with_settings
from softseam.view.colors import label
from softseam_protocol.facts import machine
from softseam_studies.study.bundled import File, path_of, read
from softseam_studies.study.errors import KNOWN
from softseam_studies.study.frame import frame_of
from softseam_studies.study.levels import Levels
from softseam_studies.study.measure import quantity_names
from softseam_studies.study.progress import ChartProgress
from softseam_studies.study.reference import Reference, counted, in_words, origin
from softseam_studies.study.refine import refine

MINUTES = 20.0
TARGET = 1e-4
"""as good as none: cells and steps are refined for as long as given [1]"""
SYMMETRY = {
    "cantilever": "y", "heavy_on_soft": "y", "sausage_bend": "xz", "silken_tofu": "xy", "stiff_inclusion": "xy",
    "tofu_drop": "xy", "tofu_grasp": "xy", "tofu_pads": "xy", "tofu_push": "y", "tofu_slab": "y",
}  # fmt: skip
"""axes that scenes are symmetric across: levels solve for one side where an even number of cells lies along them"""


def levels_of(name: str) -> Levels:
    """Of a scene as it is given, solved for one side where that comes to the same."""
    settings = (*AS_GIVEN, f"symmetry={json.dumps([*SYMMETRY.get(name, '')])}")
    scene = with_settings(load_scene(name), settings)
    return Levels(name, settings, frame_of(scene, name, settings), quantity_names(scene))


def make(name: str, minutes: float, console: Console) -> tuple[Path, Reference]:
    """Refine a scene, write what it leads to or keep what is there, and return where and what."""
    code, levels = solver_digest(), levels_of(name)
    levels.open(code, fresh=False)
    path = path_of(levels.scene)
    there = read(path)
    if there is not None and not holds(there, levels, console):
        there = None
    if there is not None and there.scene != levels.key:
        console.print("the scene is written otherwise, and does what it did: its file is stamped anew")
        write(there.model_copy(update={"scene": levels.key}), path)
        return path, counted(there.reference, levels.names)
    with ChartProgress(console) as progress:
        reference = refine(levels, 60.0 * minutes, progress.reference, TARGET, KNOWN)
    if there is not None and not is_as_fine(reference, came := counted(there.reference, levels.names)):
        console.print("what is there comes from finer levels, and stays")
        return path, came
    write(shipping(reference, levels, code[:16], machine()), path)
    return path, reference


def holds(there: File, levels: Levels, console: Console) -> bool:
    """Whether a file is of what today's code does in today's scene; of one that was changed, to its last digit."""
    if not there.knows(levels.names):
        return False
    try:
        off = moved(there, levels) if there.scene == levels.key else moved(there, levels, DIGITS, 1e-5)
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
            # the other scenes are worth their minutes; the levels of this one are stored
            console.print(f"{name}: {error}", style="red", markup=False)
            failed.append(name)
            continue
        levels = ", ".join(
            f"{level.across:g}{'' if level.grading == 1.0 else ' graded'} at {1e3 * level.step:.3g} ms"
            for level in reference.levels
        )
        console.print(table(reference))
        console.print(f"{path}, {path.stat().st_size / 1e3:.0f} kB: {origin(reference)} (cells across: {levels})")
    if failed:
        raise SystemExit(f"no reference was made of {', '.join(failed)}: see why above")


if __name__ == "__main__":
    main()
