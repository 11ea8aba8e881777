"""XPBD on slopes: what Coulomb's law holds stays for ever where it is, and what slides does so as a rigid body does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pbd_run import PbdRun, block_scene
from solids import box, obj, sphere

GROUND = {"kind": "plane"}
TABLE = {"kind": "box", "size": [1.5, 0.4, 0.02], "position": [0.5, 0.0, -0.01]}
HILL = {"kind": "sphere", "radius": 5.0, "position": [0.0, 0.0, -5.0]}
"""so wide that it is hardly round below a block, and one that presses inside its faces"""


def way(
    angle: float,
    friction: float,
    seconds: float,
    young: float = 2e5,
    cell: float = 0.02,
    ground: dict[str, Any] = GROUND,
) -> list[float]:
    """How far down a slope of an angle [degrees] the middle of a block has gone after each second [m]."""
    g, a = 9.81, math.radians(angle)
    scene = block_scene(
        (0.06, 0.06, 0.06),
        cell,
        young=young,
        poisson=0.3,
        density=500.0,
        step=0.01,
        gravity=(g * math.sin(a), 0.0, -g * math.cos(a)),
        tools={"ground": {**ground, "friction": friction}},
    )
    run, ways = PbdRun(scene), []
    start = run.x[:, 0].mean()
    for _ in range(round(seconds)):
        run.run(1.0)
        ways.append(float(run.x[:, 0].mean() - start))
    return ways


@pytest.mark.parametrize(
    ("angle", "friction", "young", "cell"),
    [(20.0, 0.4, 2e5, 0.02), (20.0, 0.37, 2e5, 0.02), (12.0, 0.23, 5e4, 0.02), (30.0, 0.64, 2e5, 0.01)],
)
def test_what_holds_stays(angle: float, friction: float, young: float, cell: float) -> None:
    """It gave way at 26 mm/s, as points that ring were unloaded one by one."""
    ways = way(angle, friction, 3.0, young, cell)
    assert 0.0 < ways[0] < 2e-3
    assert abs(ways[2] - ways[1]) < 1e-6


@pytest.mark.parametrize(("ground", "friction"), [(TABLE, 0.4), (TABLE, 0.37), (HILL, 0.4)])
def test_so_it_does_on_what_is_no_plane(ground: dict[str, Any], friction: float) -> None:
    """It gave way at 26 to 50 mm/s on a box that was all that the block touched."""
    ways = way(20.0, friction, 3.0, ground=ground)
    assert 0.0 < ways[0] < 2e-3
    assert abs(ways[2] - ways[1]) < 1e-5


@pytest.mark.parametrize(
    ("angle", "friction", "young"),
    [(20.0, 0.3, 2e5), (20.0, 0.1, 2e5), (12.0, 0.15, 2e5), (35.0, 0.5, 2e5), (20.0, 0.33, 2e4), (35.0, 0.65, 1e5)],
)
def test_what_slides_does_so_by_coulomb(angle: float, friction: float, young: float) -> None:
    """Friction lent to a point that is unloaded is paid back where it is loaded: the mean is mu times the load.

    As long as a debt faded in what slides, a soft block near the limit slid half as far.
    """
    a = math.radians(angle)
    first, second = way(angle, friction, 2.0, young)
    right = 9.81 * (math.sin(a) - friction * math.cos(a))
    assert second - 2.0 * first == pytest.approx(right, rel=0.02)
    assert -1e-3 < first - 0.5 * right < 0.03  # it was let down, and slid before it pressed, as FEM's does


MESHES = {"brick.obj": obj(*box((0.06, 0.05, 0.03))), "ball.obj": obj(*sphere(0.025, 2))}


def paths(file: str, friction: float, speed: float) -> tuple[Any, Any]:
    """Where a mesh's nodes are in .15 s of a fall on a plane, and on a box that ends there (30 steps, n, 3) [m]."""
    found = []
    for ground in (GROUND, TABLE):
        scene = block_scene(
            (0.04, 0.04, 0.04),
            0.02,
            young=4e4,
            poisson=0.35,
            position=(0.0, 0.0, 0.002),
            gravity=(3.0, 0.0, -9.0),
            tools={"ground": {**ground, "friction": friction}},
            body={"velocity": (0.3, 0.0, -speed), "shape": {"kind": "mesh", "path": file}},
        )
        run = PbdRun(scene, files=MESHES)
        seen = []
        for _ in range(30):
            run.step()
            seen.append(run.x.copy())
        found.append(np.array(seen))
    return found[0], found[1]


@pytest.mark.parametrize(
    ("file", "friction", "speed"),
    [
        ("brick.obj", 0.4, 0.1),
        ("ball.obj", 0.9, 0.5),
        ("ball.obj", 1.5, 0.2),
    ],
)
def test_a_box_is_the_ground_that_a_plane_is(file: str, friction: float, speed: float) -> None:
    """Where friction was larger than what pressed, a point inside the box was taken to face the side that friction
    points to, and was thrown out there, .7 m away."""
    plane, table = paths(file, friction, speed)
    np.testing.assert_allclose(table, plane, atol=1e-6)
