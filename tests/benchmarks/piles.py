"""What a body costs in a step where there are many: cubes that fall on the ground and rest, and touch nothing else, or
lie piled and touch all their neighbours.

    python tests/benchmarks/piles.py [apart | touching]

apart: processor time a body and step [ms] and how much of it is kernels, for 1, 27 and 125 cubes of 2x2x2 cells.
touching: of 8, 27 and 125 cubes, of one cell at 20 kPa and of 2x2x2 at 100 kPa, all awake, processor time of a step
[ms]: kernels, of which those that find what touches, and Python. Each is the median of steps; compiling is not counted.

What bounds the rows. Eight in a round read 1 kB of numbers, 16 ns at the 60 GB/s by which one core reads 2 MB, and take
1000 operations, 9 ns at 32 a cycle; the moves of 32 nodes in and out, and a root and a quotient that wait for one
another, are what they take 62 ns for (33 where none is pressed, 64 to look at them once a substep; 145 as scalars). So
rows are at a quarter of what memory allows, and of 37 ms for 125 cubes of 2x2x2 cells they are 8: the same bodies
apart take 30.
"""

from __future__ import annotations

import sys
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd import between, pile
from softseam_services.pbd.kernels import pile as of_pile
from softseam_services.pbd.two_threads import TwoThreads

sys.path.insert(0, str(Path(__file__).parents[1]))

from cubes import FIRM, SOFT, cubes, piled  # beside the tests

COUNTS = 1, 27, 125
SIDES = 2, 3, 5
WARM, STEPS = 40, 160
"""steps before the clock runs, in which the cubes meet the ground, and those that it sees"""
FELL, STAND = 10, 30
"""the same of piles, whose soft towers lean later and fall"""
FINDING = "find_rows", "find_groups", "lay_rows", "fill_eights"


class Clock:
    """Processor time that is spent in kernels of steps, in all and finding what touches [s]."""

    def __init__(self) -> None:
        self.seconds = self.finding = 0.0

    def timed(self, kernel: Any, finding: bool = False) -> Any:
        """The same function, on the clock."""

        def run(*arguments: Any) -> Any:
            began = process_time()
            found = kernel(*arguments)
            spent = process_time() - began
            self.seconds += spent
            self.finding += spent if finding else 0.0
            return found

        return run


def measure(scene: Scene, clock: Clock, warm: int, steps: int) -> tuple[float, float, float]:
    """Processor time of a step, in all, in kernels, and in those that find what touches [ms]."""
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    for _ in range(warm):
        simulation.step()
    seen = []
    for _ in range(steps):
        clock.seconds, clock.finding, began = 0.0, 0.0, process_time()
        simulation.step()
        seen.append((process_time() - began, clock.seconds, clock.finding))
    simulation.close()
    spent, kernels, finding = (1e3 * median(each) for each in zip(*seen, strict=True))
    return spent, kernels, finding


def put_on(clock: Clock) -> None:
    """Have the kernels of piles run on the clock."""
    of_pile.advance_bodies = clock.timed(of_pile.advance_bodies)
    vars(pile)["advance_touching"] = clock.timed(vars(pile)["advance_touching"])
    for name in FINDING:
        setattr(between, name, clock.timed(getattr(between, name), finding=True))
    TwoThreads.run = clock.timed(TwoThreads.run)  # type: ignore[method-assign]


def main(which: str) -> None:
    clock = Clock()
    put_on(clock)
    if which == "apart":
        for count in COUNTS:
            spent, kernels, _ = measure(cubes(count, 2, duration=2.0), clock, WARM, STEPS)
            python = (spent - kernels) / count
            print(f"{count:4d} cubes of 2^3: {spent / count:.4f} ms a body and step, {python:.4f} of it Python")
        return
    for cells, material, of in ((1, SOFT, "1^3, 20 kPa"), (2, FIRM, "2^3, 100 kPa")):
        for side in SIDES:
            spent, kernels, finding = measure(piled(side, side, cells, material=material), clock, FELL, STAND)
            print(
                f"{side**3:4d} cubes of {of}: {kernels:.2f} ms of kernels a step, of which {finding:.2f} find what "
                f"touches; {spent - kernels:.2f} of Python, {(spent - kernels) / side**3:.4f} a body"
            )


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "touching")
