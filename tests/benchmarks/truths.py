"""Makes references that ship: `make references`, or `PYTHONPATH=tests python tests/benchmarks/truths.py [SCENE ...]`.

Climbs each scene's ladder for as long as given and writes scenes/references/SCENE.json. Levels are kept in the cache:
what was interrupted goes on, and another call of as many minutes goes on to finer levels. Levels of other code are
taken over where two of them, run anew, do what they did; where physics changed, all begins anew. The minutes are
processor time, without compiling; all scenes together take 12 times as much, on a machine without other work: 4 hours.

A file that is there is first checked with two of its levels, run anew. Where these do what they did, a scene that is
only written otherwise (a new key, say) has its file stamped anew, and no ladder is climbed; else a file is replaced by
what comes from levels as fine or finer only, whatever is claimed of these. Delete it to have another in any case, as
where only steps changed that are shorter than those checked.
"""

from __future__ import annotations

import argparse
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path

from benchmarks.plans import SCENES
from rich.console import Console
from rich.table import Table

from softseam.embedded import solver_digest
from softseam.errors import SoftseamError
from softseam.scenes import load_scene
from softseam.study.assemble import counted
from softseam.study.climb import climb
from softseam.study.errors import KNOWN, rms, scale_of
from softseam.study.frame import Frame, frame_of
from softseam.study.ladder import Ladder
from softseam.study.measure import Outcome, quantity_names
from softseam.study.progress import ChartProgress
from softseam.study.reference import Reference, in_words, origin
from softseam.study.shipped import CHECKED, DIGITS, Shipped, is_as_fine, moved, path_of, read, shipping, write
from softseam.study.store import Identity, Store, cache_folder
from softseam.variants import AS_GIVEN, with_settings
from softseam.view.colors import label
from softseam_protocol.facts import machine

MINUTES = 20.0
TARGET = 1e-4
"""as good as none: a ladder is climbed for as long as given [1]"""
REMEDY = "compute the levels anew"
SYMMETRY = {
    "cantilever": "y", "heavy_on_soft": "y", "sausage_bend": "xz", "silken_tofu": "xy", "stiff_inclusion": "xy",
    "tofu_drop": "xy", "tofu_grasp": "xy", "tofu_pads": "xy", "tofu_push": "y", "tofu_slab": "y",
}  # fmt: skip
"""axes that scenes are symmetric across: levels solve for one side where an even number of cells lies along them"""
ALIKE = 1e-5
"""a level that other code computed is this code's where quantities differ by less, relative to their size [1]"""


def ladder_of(name: str) -> tuple[Ladder, Frame]:
    """Of a scene as it is given, solved for one side where that comes to the same."""
    settings = (*AS_GIVEN, f"symmetry={json.dumps([*SYMMETRY.get(name, '')])}")
    scene = with_settings(load_scene(name), settings)
    frame = frame_of(scene, name, settings)
    return Ladder(name, settings, frame, quantity_names(scene)), frame


def make(name: str, minutes: float, console: Console) -> tuple[Path, Reference]:
    """Climb a scene's ladder, write what it leads to or keep what is there, and return where and what."""
    code, (ladder, frame) = solver_digest(), ladder_of(name)
    ladder.open(code, fresh=False)
    take_over(ladder, code, console)
    if ladder.graded is not None:
        take_over(ladder.graded, code, console)
    path = path_of(ladder.scene)
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
    """Keep as this code's what other code computed, where it did what this code does in two of its levels: of those
    that took a few seconds that of most cells at the longest step, and that of the shortest step. What was computed in
    shorter steps than these stays behind.
    """
    stem = f"{ladder.scene}-{ladder.key[:12]}"
    ours = Store(cache_folder() / f"{stem}-{code[:8]}", Identity(ladder.key, code), REMEDY)
    for folder in sorted(cache_folder().glob(f"{stem}-*")):
        if folder == ours.folder:
            continue
        try:
            found = levels_in(folder, ladder.key)
            quick = sorted((step, across) for across, step, _, level in found if level.spent <= CHECKED)
            if not quick:
                continue
            off = max(apart(ladder, across, step, found) for step, across in {quick[0], quick[-1]})
        except (SoftseamError, KeyError, TypeError, ValueError) as error:
            console.print(f"{folder.name} is not taken over: {error}", markup=False)
            continue
        new = [(name, level) for _, step, name, level in found if step >= quick[0][0] and not ours.path(name).is_file()]
        told = f"now differ by {in_words(off)}: {len(new)} levels are {'' if off <= ALIKE else 'not '}taken over"
        console.print(f"two levels of {folder.name} {told}", markup=False)
        for name, level in new if off <= ALIKE else ():
            ours.write(name, level.as_json())


def levels_in(folder: Path, key: str) -> list[tuple[float, float, str, Outcome]]:
    """Cells across, step [s], file and outcome of all levels that are kept of other code."""
    found = []
    for path in sorted(folder.glob("level-*.json")):
        identity = json.loads(path.read_text(encoding="utf-8"))["identity"]
        data = Store(folder, Identity(key, identity["code"]), REMEDY).read(path.stem)
        _, across, step, _ = path.stem.split("-")
        found.append((float(across), 1e-3 * float(step.removesuffix("ms")), path.stem, Outcome.from_json(data or {})))
    return found


def apart(ladder: Ladder, across: float, step: float, found: Sequence[tuple[float, float, str, Outcome]]) -> float:
    """By how much a level differs from what it did: the worst quantity, relative to its scale [1]."""
    ladder.run(across, step, math.inf)
    now, time = ladder.series((across, step)), ladder.common([(across, step)])
    then = next(level.series for cells, dt, _, level in found if (cells, dt) == (across, step))
    if then is None or len(then.time) != len(time) or not {*now.values} <= {*then.values}:
        return math.inf
    differ = {name: now.at(name, time) - then.at(name, time) for name in now.values}
    scale = {name: scale_of(name, now.at(name, time), now.travel, time) for name in now.values}
    return max(rms(off, time) / scale[name] if off.any() else 0.0 for name, off in differ.items())


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
