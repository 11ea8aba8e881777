"""Scenes for gradients, and central differences of their losses by whole runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import softseam
from softseam.losses import Loss, Run
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]
Commands = list[dict[str, list[float]]]

PADS = {"left": ([-0.0305, 0.0, 0.03], [0.01, 0.08, 0.08]), "right": ([0.0305, 0.0, 0.03], [0.01, 0.08, 0.08])}
SMALL_PADS = {"left": ([-0.0305, 0.0, 0.025], [0.01, 0.02, 0.02]), "right": ([0.0305, 0.0, 0.025], [0.01, 0.02, 0.02])}


def scene(
    tools: dict[str, Any], kind: str = "neo_hookean", cell: float = 0.025, tolerance: float = 1e-9, **more: Any
) -> Scene:
    """A cube of 5 cm, its Newton's method ended late: differences see what is left."""
    body = {
        "shape": {"kind": "block", "size": [0.05, 0.05, 0.05]},
        "cell": cell,
        "material": {"kind": kind, "young": 20e3, "poisson": 0.45, "density": 1050.0},
        **more.pop("body", {}),
    }
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "gradient",
            "step": 0.005,
            "duration": 1.0,
            "body": body,
            "tools": tools,
            "models": {"fem": {"tolerance": tolerance, "iterations": 60}},
            "regions": {"default": "fem"},
            **more,
        }
    )


def grasp(friction: float, pads: dict[str, Any] = PADS, **more: Any) -> Scene:
    """The cube on the ground between two plates."""
    plates = {
        name: {"kind": "box", "size": size, "position": place, "friction": friction}
        for name, (place, size) in pads.items()
    }
    return scene({"ground": {"kind": "plane", "friction": friction}, **plates}, **more)


def squeeze(steps: int, rise: float = 0.0, start: int = 0, speed: float = 0.04) -> Commands:
    """Both plates close; from the step `start` on they rise, at `rise` [m/s], and close no more."""
    close = {"left": [speed, 0.0, 0.0], "right": [-speed, 0.0, 0.0]}
    lift = {"left": [0.0, 0.0, rise], "right": [0.0, 0.0, rise]}
    return [close if rise == 0.0 or step < start else lift for step in range(steps)]


def run_of(sim: softseam.Session, commands: Commands, settings: Sequence[str] = ()) -> Run:
    """A run step by step, by the session's ordinary means."""
    start = sim.reset(settings=list(settings))
    seen = [sim.step(command) for command in commands]
    tools = start.tool_names
    return Run(
        np.array([one.time for one in seen]),
        {name: np.array([one.wrench[name][:3] for one in seen]) for name in tools},
        np.array([one.positions for one in seen]),
        np.asarray(start.positions),
        {name: np.array([one.tools[name].position for one in seen]) for name in tools},
    )


def difference(sim: softseam.Session, loss: Loss, commands: Commands, key: str, value: float, apart: float) -> float:
    """Central difference of a loss by a key of the scene, over `apart` of its value to either side."""
    found = []
    for side in (1.0, -1.0):
        settings = [f"{one}={value * (1.0 + side * apart)!r}" for one in key.split(",")]
        found.append(loss(run_of(sim, commands, settings))[0])
    return (found[0] - found[1]) / (2.0 * apart * value)


def difference_by_way(
    sim: softseam.Session, loss: Loss, commands: Commands, tool: str, step: int, axis: int, apart: float
) -> float:
    """The same by the way of a tool in one step, over `apart` [m]."""
    found = []
    for side in (1.0, -1.0):
        moved = [dict(command) for command in commands]
        velocity = list(moved[step].get(tool, [0.0, 0.0, 0.0]))
        velocity[axis] += side * apart / sim.scene.step
        moved[step][tool] = velocity
        found.append(loss(run_of(sim, moved))[0])
    return (found[0] - found[1]) / (2.0 * apart)
