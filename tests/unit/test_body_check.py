"""What a check of a body warns of."""

from __future__ import annotations

import pytest

from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.check import check_body
from softseam_services.checks import doubts
from softseam_services.server import Setup, build_setup

pytestmark = pytest.mark.kernels


def setup(cell: object = 0.025, **material: float) -> Setup:
    body = {
        "shape": {"kind": "block", "size": [0.05, 0.05, 0.05]},
        "cell": cell,
        "material": {"young": 2e4, "poisson": 0.3, "density": 1000, **material},
    }
    scene = Scene.model_validate({"softseam": 1, "name": "c", "duration": 1.0, "body": body})
    return build_setup(bundle_scene(scene, {}))


def test_a_sound_block() -> None:
    body = setup().body
    assert isinstance(body, Body)
    result = check_body(body)
    assert not doubts(setup())
    assert result.n_cells == result.full_cells == 8
    assert result.n_nodes == 125
    assert result.n_points == result.n_contact_points == 98
    assert result.n_triangles == 192
    assert result.volume == pytest.approx(1.25e-4, rel=1e-12)
    assert result.area == pytest.approx(0.015, rel=1e-12)
    assert result.mass == pytest.approx(0.125, rel=1e-12)
    assert result.centre == pytest.approx((0, 0, 0.025), abs=1e-15)
    assert result.smallest_fill == 1.0


@pytest.mark.parametrize(
    ("cell", "material", "words"),
    [
        ([0.05, 0.0125, 0.0125], {}, "stretched 4.0 to 1"),
        (0.05, {}, "one cell through the thickness"),
        (0.025, {"poisson": 0.4999}, "body.material.poisson: 0.4999 is nearly"),
        (0.025, {"density": 1.05}, "body.material.density: 1.05 kg"),
        (0.025, {"young": 0.02}, "body.material.young: 0.02 Pa is unlike"),
    ],
)
def test_what_is_odd_is_said(cell: float | list[float], material: dict[str, float], words: str) -> None:
    assert any(words in warning for warning in doubts(setup(cell, **material)))
