"""The shipped tray of tofu, of which one cube is picked: what sleep saves while it is gripped, and what it changes.

    python tests/benchmarks/sleeping_tray.py [rule]

Trays of 8, 27 and 125 cubes and the one upon them, once they rest; then fingers close on that by 15 %, lift it and hold
it. Prints processor time a simulated second from when fingers begin to close [s], how many bodies are awake in the
mean, and against the run without sleep, by their largest: the worst of all steps of the grip's force, of what fingers
feel upwards and of the floor's force, the grip's force as the cube is held and as it is held in the air, von Mises
stress in it (root mean square of 64 points), and the largest in each other cube.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.file import bundle_scene
from softseam_services.body.body import Body
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.probes import Probes
from softseam_services.orchestrator.simulation import Simulation

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.front_runs import GRIPPED, lattice
from cubes import tray  # beside the tests
from trays import awake

REST = {2: 1.6, 3: 2.2, 5: 3.6}
"""cubes along each side, and how long they have to rest, in which all are below 2 mm/s without sleep, too [s]"""
HELD = 2, 4
"""phases at whose ends the cube is held, and held in the air"""


class Run(NamedTuple):
    """What a run came to, in n steps from when fingers begin to close."""

    seconds: float
    """processor time a simulated second [s]"""
    awake: float
    forces: NDArray[np.float64]
    """of the grip, of fingers upwards, and of the floor (n, 3) [N]"""
    held: list[int]
    """steps at which the cube is held"""
    stress: list[dict[str, NDArray[np.float64]]]
    """by body, at points, in these (64,) [Pa]"""


def run(side: int, *settings: str) -> Run:
    """One of them."""
    motion = f"motion.0.hold={REST[side]}"
    simulation = Simulation(bundle_scene(tray(side, motion, *settings)), EmbeddedTransport())
    bodies = {name: body.body for name, body in simulation.bodies.items()}
    probes = {name: Probes(body, lattice(body)) for name, body in bodies.items() if isinstance(body, Body)}
    names = simulation.tools.names
    floor, fingers = names.index("floor"), [names.index("left"), names.index("right")]
    spent, count, phase, inside = 0.0, 0, 0, 0
    forces: list[list[float]] = []
    held: list[int] = []
    stress: list[dict[str, NDArray[np.float64]]] = []
    while not simulation.done:
        began = process_time()
        report = simulation.step()
        took = process_time() - began
        inside = inside + 1 if report.phase == phase else 1
        phase = report.phase
        if phase == 0:
            continue
        spent, count = spent + took, count + len(awake(report))
        upwards = float(report.wrench[fingers, 2].sum())
        forces.append([report.quantities[f"{GRIPPED}.grip_force"], upwards, float(report.wrench[floor, 2])])
        if phase in HELD and inside == 18:
            held.append(len(forces) - 1)
            frames = simulation.frames()
            stress.append(
                {name: _von_mises(probes[name].measure(frame, ("pbd",) * 2)) for name, frame in frames.items()}
            )
    step = simulation.scene.step
    simulation.close()
    return Run(spent / (len(forces) * step), count / len(forces), np.array(forces), held, stress)


def _von_mises(values: Mapping[str, float]) -> NDArray[np.float64]:
    return np.array([value for name, value in values.items() if name.endswith("von_mises")])


def main(rule: str) -> None:
    for side in REST:
        slept, whole = run(side, f"sleep={rule}"), run(side)
        n = min(len(slept.forces), len(whole.forces))
        away = np.abs(slept.forces[:n] - whole.forces[:n]).max(axis=0) / np.abs(whole.forces).max(axis=0)
        grip = [abs(slept.forces[a, 0] / whole.forces[b, 0] - 1) for a, b in zip(slept.held, whole.held, strict=True)]
        picked, others = [], []
        for one, other in zip(slept.stress, whole.stress, strict=True):
            own = other[GRIPPED]
            picked.append(float(np.sqrt(((one[GRIPPED] - own) ** 2).mean()) / own.max()))
            peaks = np.array([[each[name].max() for name in other if name != GRIPPED] for each in (one, other)])
            others.append(float(np.abs(peaks[0] - peaks[1]).max() / peaks[1].max()))
        print(
            f"{side**3:4d} and one: {slept.seconds:.2f} s a simulated second, {slept.awake:.1f} awake; without sleep "
            f"{whole.seconds:.2f}. Grip {away[0]:.2%} at worst, held {grip[0]:.2%} and {grip[1]:.2%}, upwards "
            f"{away[1]:.1%}, floor {away[2]:.1%}; stress {max(picked):.2%}, others' largest {max(others):.1%}",
            flush=True,
        )


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "by_load")
