"""How far round surfaces stand out between nodes: of balls by their radius, of boxes not at all; and who is doubted."""

from typing import Any

import numpy as np
import pytest
import solids
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.bulges import bulges, curvatures, curvatures_everywhere, lattice_of
from softseam_services.body.interpolate import rest_points
from softseam_services.body.region import build_region
from softseam_services.checks import doubts
from softseam_services.server import Setup, build_setup

pytestmark = pytest.mark.kernels

RADIUS, CELL = 0.02, 0.008
MATERIAL = {"young": 1e5, "poisson": 0.3, "density": 1000.0}
Solid = tuple[NDArray[np.float64], NDArray[np.int64]]
BALL, BOX = solids.sphere(RADIUS, 4), solids.box((0.04, 0.04, 0.04))


def setup_of(solid: Solid, friction: float = 0.8, degrees: float = 0.0) -> Setup:
    slope = np.radians(degrees)
    scene: dict[str, Any] = {
        "softseam": 1,
        "name": "mesh",
        "duration": 1.0,
        "gravity": [9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope)],
        "body": {"shape": {"kind": "mesh", "path": "mesh.obj"}, "cell": CELL, "material": MATERIAL},
        "tools": {"ground": {"kind": "plane", "friction": friction}},
    }
    files = {"mesh.obj": solids.obj(*solid)}
    return build_setup(Bundle(Scene.model_validate(scene).model_dump_json(), files))


def body_of(solid: Solid) -> Body:
    body = setup_of(solid).body
    assert body.has_cells
    return body


def test_a_ball_stands_out_by_its_radius() -> None:
    """k = 1/R either way: twice as much in all; h^2/8R between two nodes, and as much again across."""
    body = body_of(BALL)
    touched = body.surface.area > 0.0
    total = np.trace(curvatures(body), axis1=1, axis2=2)[touched]
    assert total == pytest.approx(2.0 / RADIUS, rel=0.05)
    everything = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
    out = bulges(body, everything)[touched] / (0.125 * (0.5 * body.resolution) ** 2 / RADIUS)
    assert out.min() >= 0.0 and 1.5 < out.max() < 2.1


def test_a_box_stands_out_nowhere() -> None:
    body = body_of(BOX)
    everything = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
    assert not bulges(body, everything).any()


def test_a_lattice_says_the_same_between_points() -> None:
    """Of a ball's points sum_a rise_a 4 f_a (1 - f_a) is what stands out there, where it turns 1/R along any axis as
    much as a plane that turns by 1/R beside it; of a box's nothing."""
    body = body_of(BALL)
    everything = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
    where = lattice_of(body, rest_points(body), body.surface.normal, curvatures_everywhere(body))
    f = where.octant - np.floor(where.octant)
    touched = body.surface.area > 0.0
    between = 4.0 * f * (1.0 - f)
    out = np.maximum(0.0, (where.rise * between).sum(axis=1))[touched]
    np.testing.assert_allclose(out, bulges(body, everything)[touched], atol=1e-9)
    by_mean = (where.mean[:, None] * where.spread * between).sum(axis=1)[touched]
    np.testing.assert_allclose(by_mean, out, atol=0.1 * out.max())
    box = body_of(BOX)
    flat = lattice_of(box, rest_points(box), box.surface.normal, curvatures_everywhere(box))
    assert not flat.rise.any() and not flat.mean.any()


@pytest.mark.parametrize(
    ("solid", "friction", "degrees", "said"),
    [(BALL, 0.8, 7.0, True), (BALL, 0.8, 0.0, False), (BALL, 0.05, 7.0, False), (BOX, 0.8, 7.0, False)],
    ids=["rolls", "rests", "slides", "flat"],
)
def test_what_rolls_is_doubted(solid: Solid, friction: float, degrees: float, said: bool) -> None:
    found = [text for text in doubts(setup_of(solid, friction, degrees)) if "start to roll" in text]
    assert bool(found) == said
