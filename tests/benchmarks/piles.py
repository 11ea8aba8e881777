"""What a body costs in a step where there are many: cubes that fall on the ground and rest, and touch nothing else.

    python tests/benchmarks/piles.py [cells]

Prints processor time a body and step [ms] and how much of it is kernels, for 1, 27 and 125 cubes of cells^3. Compiling
is not counted.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import process_time
from typing import Any

from softseam_protocol.scene.file import bundle_scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd.kernels import pile
from softseam_services.pbd.two_threads import TwoThreads

sys.path.insert(0, str(Path(__file__).parents[1]))

from cubes import cubes  # beside the tests

COUNTS = 1, 27, 125
WARM, STEPS = 40, 160
"""steps before the clock runs, in which the cubes meet the ground, and those that it sees"""


class Clock:
    """Processor time that is spent in kernels of steps [s]."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def timed(self, kernel: Any) -> Any:
        """The same function, on the clock."""

        def run(*arguments: Any) -> Any:
            began = process_time()
            found = kernel(*arguments)
            self.seconds += process_time() - began
            return found

        return run


def measure(count: int, cells: int, clock: Clock) -> tuple[float, float]:
    """Processor time a body and step, in all and in kernels [ms]."""
    simulation = Simulation(bundle_scene(cubes(count, cells, duration=2.0)), EmbeddedTransport())
    for _ in range(WARM):
        simulation.step()
    clock.seconds, began = 0.0, process_time()
    for _ in range(STEPS):
        simulation.step()
    spent = process_time() - began
    simulation.close()
    return 1e3 * spent / STEPS / count, 1e3 * clock.seconds / STEPS / count


def main(cells: int) -> None:
    clock = Clock()
    pile.advance_bodies = clock.timed(pile.advance_bodies)
    TwoThreads.run = clock.timed(TwoThreads.run)  # type: ignore[method-assign]
    for count in COUNTS:
        spent, kernels = measure(count, cells, clock)
        print(f"{count:4d} cubes of {cells}^3: {spent:.4f} ms a body and step, {spent - kernels:.4f} of it Python")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
