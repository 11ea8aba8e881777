"""Which sibling a scene has: the run that claims compare it with."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from claimed_block import sibling, write_block

from softseam.claims.sibling import NoSibling, sibling_of
from softseam.scenes import bundle_of
from softseam.session import open_as_given
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import scene_json
from softseam_protocol.scene.scene import Scene

pytestmark = pytest.mark.kernels


@pytest.fixture
def block(tmp_path: Path) -> str:
    return write_block(tmp_path)


def test_cells_and_steps_are_twice_as_long(block: str) -> None:
    """And nothing else differs; its settings make it of the scene at the command line."""
    found = sibling(block)
    assert not found.finer and found.scene.step == 0.02
    assert found.settings == ("step=0.02", "regions={default: fem}", "body.cell=[0.02, 0.02, 0.02]")
    assert found.scene.tools == bundle_of(block)[0].tools and found.scene.motion == bundle_of(block)[0].motion
    assert found.share < 0.2


def test_a_run_of_another_model_has_a_sibling_of_fem(block: str) -> None:
    """So that what the model errs by is in the difference."""
    assert sibling(block, "regions={default: pbd}").scene.regions.default == "fem"
    assert sibling("tofu_pads").scene.regions.near is None


def test_a_scene_that_names_no_model_is_foreseen_as_what_it_gets(block: str) -> None:
    """Small bodies get FEM; who sets what is XPBD's alone gets that, of which a sibling of FEM is a larger share."""
    open_ = Path(block).read_text().replace("regions: {default: fem}\n", "")
    Path(block).write_text(open_)
    assert sibling(block).share == sibling(block, "regions={default: fem}").share
    of_pbd = sibling(block, "models.pbd.sweeps=2").share
    assert of_pbd == sibling(block, "regions={default: pbd}").share != sibling(block).share


def test_a_body_of_one_cell_has_a_finer_sibling(block: str) -> None:
    """Which takes longer than the run, and is told to."""
    found = sibling(block, "body.cell=0.04")
    assert found.finer and found.settings[0] == "step=0.005" and found.settings[-1] == "body.cell=[0.02, 0.02, 0.01]"
    assert found.share > 1.0


def test_cells_of_several_sizes_count_by_their_mean(block: str) -> None:
    """Thinner ones at the faces, 6 x 6 x 3: the sibling has 3 x 3 x 1."""
    found = sibling(block, "body.cell=null", "body.shape.grading=4").scene.body
    assert isinstance(found, BodySpec)
    assert found.cell == pytest.approx((0.04 / 3, 0.04 / 3, 0.02))


def test_cells_that_follow_a_ball_count_as_so_many_of_one_size(block: str) -> None:
    ball = "{kind: sphere, position: [0, 0, 0.01], radius: 0.004}"
    inside = f"body.inclusions=[{{shape: {ball}, material: {{young: 2e5, poisson: 0.45}}}}]"
    found = sibling(block, "body.shape.borders=materials", inside, "body.cell=0.005").scene.body
    assert isinstance(found, BodySpec)
    assert found.cell == pytest.approx((0.01, 0.01, 0.01))


def test_cells_of_a_mesh_are_told_by_its_nodes() -> None:
    """The default edge, which no scene file says."""
    with open_as_given("sausage", settings=("body.cell=null",)) as session:
        nodes = session.reset().frames["body"].x
        found = sibling_of(session.scene, session.last.frames)
    with open_as_given("sausage", settings=found.settings) as session:
        other = session.reset().frames["body"].x
    assert len(other) < 0.4 * len(nodes)
    np.testing.assert_allclose(np.ptp(other, axis=0), np.ptp(nodes, axis=0), rtol=1e-9)


def test_planes_of_symmetry_are_left_out() -> None:
    """For longer cells may lie across one; all of several bodies have longer cells, and FEM."""
    found = sibling("tofu_grasp", "symmetry=[y]", "regions={default: fem}")
    assert "symmetry=[]" in found.settings and found.scene.symmetry == ()


def test_every_body_has_longer_cells(block: str) -> None:
    document = json.loads(scene_json(bundle_of(block)[0]))
    body = document.pop("body") | {"regions": {"default": "pbd"}}
    document |= {"bodies": {"one": body, "two": body | {"cell": 0.02, "position": [0, 0.2, 0]}}}
    document |= {"motion": [], "duration": 0.02}
    found = sibling(Scene.model_validate(document))
    cells = {name: getattr(each, "cell", None) for name, each in found.scene.bodies.items()}
    assert cells == {"one": pytest.approx((0.02, 0.02, 0.02)), "two": pytest.approx((0.04, 0.04, 0.02))}
    assert all(found.scene.of(name).regions.default == "fem" for name in cells)


def test_particles_have_none() -> None:
    with pytest.raises(NoSibling, match="particles"):
        sibling("rope")


@pytest.mark.parametrize("turn", [0.26, 0.34, 0.49])
def test_a_tool_may_turn_too_far_in_a_step_twice_as_long(block: str, turn: float) -> None:
    """Then there is none, and what is told names the key and no setting that nobody made."""
    document = json.loads(scene_json(bundle_of(block)[0]))
    tool, step = next(iter(document["tools"])), document["step"]
    motion = [{"tools": [tool], "turn": [0, 0, 1.0], "speed": turn / step, "about": [0, 0, 0]}]
    with pytest.raises(NoSibling, match=r"twice as long the scene would be wrong: motion\.0\.speed: .* rad a step"):
        sibling(Scene.model_validate(document | {"motion": motion}))
