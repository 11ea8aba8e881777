"""What is the cheapest way to simulate a tray of which one cube is gripped? Regenerates docs/results/front.md and
docs/pictures/front.png: `make front`.

A tray of 27 cubes and one upon them, which is gripped and lifted (`front_runs`), with models and cells chosen by body:
errors of the force and of stress in the gripped cube against CPU time, on one core. Runs are kept in out/front, so what
was interrupted goes on where it was; other solvers begin anew. All of it takes some twenty minutes of one core.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from benchmarks.front_page import draw, page
from benchmarks.front_rivals import added, compared
from benchmarks.front_runs import CHEESE, TOFU, Choice, Material, run
from benchmarks.front_truth import Found, Mark, needed, truth_of
from rich.console import Console

from softseam.embedded import solver_digest
from softseam_protocol.facts import machine

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "out" / "front"
FEM, XPBD = "fem", "pbd"
STIFF = (5e4, 1e5, 3e5, 1e6, 5e6)
"""Young's moduli between which FEM and XPBD change places [Pa]"""


def marks_of(material: Material) -> Iterable[Choice]:
    """What is compared."""
    for model, cells, step in (
        *((model, cells, 0.005) for model in (FEM, XPBD) for cells in (2, 3, 4)),
        *((FEM, cells, step) for cells in (2, 4) for step in (0.01, 0.02)),
        *((XPBD, cells, 0.02) for cells in (2, 4)),
    ):
        yield Choice(material, model, cells, 1, step)
    for cells in (1, 2):
        for sleep in (True, False):
            yield Choice(material, XPBD, cells, cells, sleep=sleep)
    yield Choice(material, FEM, 4, 1, sleep=False)
    yield Choice(material, FEM, 6, 1, sleep=False)
    yield Choice(material, XPBD, 4, 1, sleep=False)
    if material is TOFU:
        yield Choice(material, XPBD, 6, 1)
        yield Choice(material, XPBD, 4, 4)
        yield Choice(material, XPBD, 4, 4, sleep=False)
        yield Choice(material, FEM, 2, 2, others=FEM)


def stiffer() -> Iterable[Choice]:
    """The gripped cube in 4^3 cells of either model, ever stiffer."""
    for young in STIFF:
        material = replace(CHEESE, label=f"{young:g} Pa", young=young)
        for model, step in ((FEM, 0.005), (FEM, 0.02), (XPBD, 0.005), (XPBD, 0.02)):
            yield Choice(material, model, 4, 1, step)


def larger() -> Iterable[Choice]:
    """A tray of 125."""
    for sleep in (True, False):
        for model in (XPBD, FEM):
            yield Choice(TOFU, model, 4, 1, sleep=sleep, side=5)


class Runs:
    """Those that are kept, and others as they are asked for."""

    def __init__(self, console: Console) -> None:
        self._console, self._solvers = console, solver_digest()
        KEPT.mkdir(parents=True, exist_ok=True)

    def __call__(self, choice: Choice) -> Found:
        """What a choice came to."""
        about = asdict(choice)
        about["material"].pop("label")
        key = hashlib.sha256(f"{self._solvers} {json.dumps(about, sort_keys=True)}".encode()).hexdigest()[:16]
        path = KEPT / f"{key}.json"
        if not path.exists():
            found: dict[str, Any] = run(choice)
            path.write_text(json.dumps({"choice": about, **found}))
        found = json.loads(path.read_text())
        said = f"stopped after {found['stopped']} steps" if "stopped" in found else f"{found['seconds']:.2f} CPU s/s"
        self._console.print(f"{choice.material.label}: {choice.label}: {said}", highlight=False)
        return Found.of(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--rivals",
        nargs="*",
        metavar="NAME",
        help="measure other simulators, too, or of them these alone: what is kept of others and of ours stays",
    )
    measure, rivals = parser.parse_args().rivals, KEPT / "rivals.json"
    runs, marks, truths = Runs(Console()), dict[Material, Sequence[Mark]](), {}
    for material in (TOFU, CHEESE):
        truths[material] = truth_of({choice: runs(choice) for choice in needed(material)}, material)
        marks[material] = [Mark.of(choice, runs(choice), truths[material]) for choice in marks_of(material)]
    crossing = [(choice, runs(choice)) for choice in stiffer()]
    sizes = [(choice, runs(choice)) for choice in larger()]
    if measure is not None:
        kept = added(json.loads(rivals.read_text()), KEPT, measure, Console()) if measure else None
        rivals.write_text(json.dumps(kept or compared(KEPT, runs, Console()), indent=1))
    others = json.loads(rivals.read_text()) if rivals.exists() else None
    draw(marks, truths, others, ROOT / "docs" / "pictures" / "front.png")
    (ROOT / "docs" / "results" / "front.md").write_text(page(marks, truths, crossing, sizes, others, machine()))


if __name__ == "__main__":
    main()
