"""What a pile costs of which one body is pressed: with sleep, and without.

    python tests/benchmarks/sleeping_piles.py [cells] [gap]

Cubes of cells^3, a gap [m] apart, between walls, rest for a second; then a plate presses the one in the middle of the
upper layer by 2 mm, and lets go, again and again. Prints processor time a simulated second of that [s], of kernels and
of Python, and how many bodies were awake in the mean. Compiling is not counted.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import process_time
from typing import Any

from softseam_protocol.scene.file import bundle_scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.piles import Clock, put_on
from cubes import EDGE  # beside the tests
from trays import GAP, MATERIAL, awake, tray

SIDES = 2, 3, 5
REST, PRESS = 200, 100
"""steps before the clock runs, and those that it sees"""


def measure(side: int, cells: int, gap: float, sleep: bool, clock: Clock) -> tuple[float, float, float]:
    """Processor time a simulated second, of kernels and of the rest [s], and bodies awake in the mean."""
    middle, height = (EDGE + gap) * (side // 2), side * (EDGE + gap)
    top = height - 9.81 * MATERIAL["density"] * height**2 / (2.0 * MATERIAL["young"]) + 0.01
    plate = {"kind": "box", "size": [0.03, 0.03, 0.01], "position": [middle, middle, top], "friction": 0.3}
    down, up = ({"tools": ["plate"], "move": [0, 0, sign * 0.006], "speed": 0.06} for sign in (-1.0, 1.0))
    come = {"tools": ["plate"], "move": [0, 0, -0.001], "speed": 0.06}
    keys: dict[str, Any] = {"sleep": "calm"} if sleep else {}
    motion = [{"hold": REST * 0.005}, come, *([down, up] * (PRESS // 40 + 1))]
    scene = tray((side,) * 3, {"plate": plate}, (gap,) * 3, cells=cells, motion=motion, duration=None, **keys)
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    for _ in range(REST):
        simulation.step()
    clock.seconds, began, n_awake = 0.0, process_time(), 0
    for _ in range(PRESS):
        n_awake += len(awake(simulation.step()))
    spent, second = process_time() - began, PRESS * scene.step
    simulation.close()
    return clock.seconds / second, (spent - clock.seconds) / second, n_awake / PRESS


def main(cells: int, gap: float) -> None:
    clock = Clock()
    put_on(clock)
    for side in SIDES:
        for sleep in (False, True):
            kernels, python, n_awake = measure(side, cells, gap, sleep, clock)
            print(
                f"{side**3:4d} cubes of {cells}^3, {'with' if sleep else 'without'} sleep: {kernels:.3f} s of kernels, "
                f"{python:.3f} s of Python a simulated second, {n_awake:.1f} awake"
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2, float(sys.argv[2]) if len(sys.argv) > 2 else GAP)
