"""Of many bodies that touch, those that tools take get fine cells and the model that is cheaper for them; the others
few cells of XPBD. What a scene names stays as it names it."""

from __future__ import annotations

from typing import Any

import pytest
from cubes import EDGE, tray

from softseam.errors import BadInput
from softseam.variants import with_model
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.server import Setup, build_setup

pytestmark = pytest.mark.kernels

UNSAID = "regions={}", "bodies.cube.cell=null", "bodies.picked.cell=null"
CUBE: dict[str, Any] = {
    "shape": {"kind": "block", "size": [EDGE] * 3},
    "material": {"kind": "neo_hookean", "young": 2e4, "poisson": 0.45, "density": 1050},
}


def setup(of: Scene, name: str) -> Setup:
    return build_setup(bundle_scene(of), name)


def test_what_fingers_take_is_fine_and_others_are_coarse() -> None:
    """The picked cube of a tray has 64 cells, its neighbours 8; both are of XPBD, and say why."""
    of = tray(2, *UNSAID)
    picked, cube = setup(of, "picked"), setup(of, "cube_0_0_1")
    assert (picked.body.n_cells, cube.body.n_cells) == (64, 8)
    assert picked.scene.regions.default == cube.scene.regions.default == "pbd"
    assert "left and right take picked" in picked.why and "up to" in picked.why
    assert "left and right take picked: others are pbd, in few cells" in cube.why


def test_a_stiff_one_among_soft_ones_is_fem() -> None:
    of = tray(2, *UNSAID, "bodies.picked.material.young=2e6")
    picked, cube = setup(of, "picked"), setup(of, "cube_0_0_1")
    assert (picked.scene.regions.default, picked.body.n_cells) == ("fem", 64)
    assert cube.scene.regions.default == "pbd"
    assert "is cheaper than pbd's substeps of all that touch" in picked.why


def test_what_the_scene_names_stays() -> None:
    """Its cells, and its model."""
    of = tray(2, *UNSAID, "bodies.picked.cell=0.025", "bodies.cube.regions={default: fem}")
    picked, cube = setup(of, "picked"), setup(of, "cube_0_0_1")
    assert picked.body.n_cells == 8 and picked.scene.regions.default == "pbd"
    assert cube.scene.regions.default == "fem" and cube.body.n_cells == 27 and not cube.why


def test_what_a_plate_comes_down_on_is_taken() -> None:
    """And nothing is, where no tool moves, where bodies do not touch, or where there are two."""
    plate = {"kind": "box", "size": [0.04, 0.04, 0.01], "position": [0.1, 0.0, EDGE + 0.02]}
    bodies = {name: CUBE | {"position": [0.0504 * at, 0, 0]} for at, name in enumerate(("one", "two", "three"))}
    keys = {"tools": {"plate": plate}, "motion": [{"tools": ["plate"], "move": [0, 0, -0.02], "speed": 0.1}]}
    made = {"softseam": 1, "name": "row", "step": 0.005, "bodies": bodies, "contacts": {"friction": 0.4}, **keys}
    of = Scene.model_validate(made)
    assert [setup(of, name).body.n_cells for name in bodies] == [8, 8, 64]
    assert "plate take three" in setup(of, "three").why
    still = Scene.model_validate({**made, "motion": [], "duration": 0.1})
    apart = Scene.model_validate({**made, "contacts": "none"})
    two = Scene.model_validate({**made, "bodies": {name: bodies[name] for name in ("two", "three")}})
    for other in (still, apart, two):
        assert setup(other, "three").body.n_cells == 27


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_model_is_forced_on_every_body(model: str) -> None:
    """Also on copies and on bodies that name another, in the cells that the scene gives."""
    of = with_model(tray(2, "bodies.picked.regions={default: fem}", "bodies.cube.cell=0.025"), model)
    assert {each.regions.default for each in of.bodies.values() if each.regions} == {model}
    assert len(of.bodies) == 9
    assert setup(of, "cube_0_1_0").scene.regions.default == setup(of, "picked").scene.regions.default == model
    assert setup(of, "cube_0_1_0").body.n_cells == 8


def test_hybrid_chooses_model_and_cells_of_each_body() -> None:
    """As of a scene that says neither."""
    of = tray(2, "bodies.picked.material.young=2e6", "bodies.cube.cell=0.0125", "regions={default: fem}")
    picked, cube = (setup(with_model(of, "hybrid"), name) for name in ("picked", "cube_0_0_1"))
    assert (picked.scene.regions.default, picked.body.n_cells) == ("fem", 64)
    assert (cube.scene.regions.default, cube.body.n_cells) == ("pbd", 8)
    assert "left and right take picked" in cube.why


SHEET = {"kind": "sheet", "size": [0.1, 0.1], "divisions": [4, 4], "density": 0.2, "stretch": 1000.0}


def test_only_a_body_that_cannot_have_a_model_refuses_it() -> None:
    """A sheet is made of particles."""
    bodies = {"block": CUBE, "cloth": SHEET}
    of = Scene.model_validate({"softseam": 1, "name": "both", "duration": 0.1, "bodies": bodies})
    with pytest.raises(BadInput, match="'cloth', a sheet, which is made of particles: only pbd moves it"):
        with_model(of, "fem")
    for model in ("pbd", "hybrid"):
        found = with_model(of, model)
        assert found.bodies["cloth"] == of.bodies["cloth"]
    assert with_model(of, "pbd").of("block").regions.default == "pbd"
