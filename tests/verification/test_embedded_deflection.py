"""A body embedded in cells that it cuts bears load between plates as its closed form says."""

from __future__ import annotations

from typing import Any

import numpy as np
import solids
from fem_run import FemRun
from scipy.optimize import brentq

from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.body.interpolate import rest_points

RADIUS, HEIGHT, SIDES = 0.02, 0.05, 64
AXIS = np.array([1.0, 0.5, 0.8]) / np.linalg.norm([1.0, 0.5, 0.8])
YOUNG, POISSON, SQUEEZE = 20e3, 0.3, 0.1


def _scene(cell: float, tools: dict[str, Any]) -> Scene:
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "cylinder",
            "duration": 1.0,
            "step": 0.05,
            "gravity": (0, 0, 0),
            "body": {
                "shape": {"kind": "mesh", "path": "cylinder.obj"},
                "cell": cell,
                "fixed": solids.ALONG_THE_SCENE,
                "material": {"young": YOUNG, "poisson": POISSON, "density": 1000.0},
            },
            "tools": tools,
            "regions": {"default": "fem"},
            "models": {"fem": {"tolerance": 1e-6}},
        }
    )


def _held(cell: float) -> float:
    """Force along the axis [N] of smooth plates that squeeze a tilted cylinder by its ends."""
    files = {"cylinder.obj": solids.obj(*solids.cylinder(RADIUS, HEIGHT, SIDES, AXIS))}
    body = build_body(_scene(cell, {}), files)
    points = rest_points(body)
    along = points @ AXIS
    across = points - np.outer(along, AXIS)
    half = 0.5 * np.ptp(along)
    centre = 0.5 * (across.max(axis=0) + across.min(axis=0))
    centre += AXIS * (0.5 * (along.max() + along.min()) - centre @ AXIS)
    tilt = np.cross([0.0, 0.0, 1.0], AXIS)
    tilt *= np.arccos(AXIS[2]) / np.linalg.norm(tilt)
    plate = {"kind": "box", "size": (0.1, 0.1, 0.01), "rotation": tuple(tilt), "friction": 0.0}
    tools = {
        name: {**plate, "position": tuple(centre + side * (half + 0.005) * AXIS)}
        for name, side in (("low", -1.0), ("high", 1.0))
    }
    run = FemRun(_scene(cell, tools), body=body)
    speed = SQUEEZE * half * AXIS
    run.run(1.0, {"low": tuple(speed), "high": tuple(-speed)})
    reply = run.run(0.3)[-1]
    forces = reply.wrench[:, :3] @ AXIS
    assert abs(forces.sum()) < 1e-4 * abs(forces[0])
    return float(abs(forces[0]))


def test_a_tilted_cylinder_is_as_stiff_as_its_closed_form() -> None:
    """Uniform squeeze by a tenth: too soft by what the plates sink in, in proportion to the cells, and little else."""
    mu, lam = 0.5 * YOUNG / (1.0 + POISSON), YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
    a = 1.0 - SQUEEZE
    b = brentq(lambda b: mu * (b - 1.0 / b) + lam * np.log(a * b * b) / b, 0.5, 2.0)
    area = 0.5 * SIDES * RADIUS**2 * np.sin(2.0 * np.pi / SIDES)
    exact = -area * (mu * (a - 1.0 / a) + lam * np.log(a * b * b) / a)
    wrong = [1.0 - _held(cell) / exact for cell in (0.02, 0.014, 0.01)]
    assert np.abs(wrong).max() < 0.02
    assert np.abs([wrong[0] - 2.0 * wrong[2], wrong[1] - 1.4 * wrong[2]]).max() < 2e-3
