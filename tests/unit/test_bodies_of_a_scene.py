"""A scene's bodies by name: what is read, and what is refused where."""

from __future__ import annotations

import re

import pytest
from several_bodies import NAMES, TEXT, alone, several

from softseam.gym import SceneEnv
from softseam.observation import Observation
from softseam.variants import with_settings
from softseam_protocol.messages.names import ONLY_BODY
from softseam_protocol.scene.file import SceneError, bundle_scene, parse_scene, scene_from_bundle, scene_json
from softseam_protocol.scene.scene import Scene, SeveralBodies
from softseam_services.body.errors import MeshError
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation


def test_one_body_is_called_body() -> None:
    scene = alone("jelly")
    assert list(scene.bodies) == [ONLY_BODY] and scene.bodies[ONLY_BODY] is scene.body
    assert scene.of(ONLY_BODY) is scene
    assert '"bodies"' not in scene_json(scene) and scene_from_bundle(bundle_scene(scene)) == scene


def test_several_go_to_json_and_back() -> None:
    scene = several()
    assert set(scene.bodies) == set(NAMES)
    assert scene_from_bundle(bundle_scene(scene)) == scene
    assert '"body"' not in scene_json(scene)


def test_each_body_has_its_own_regions_and_what_it_can_have() -> None:
    scene = several()
    assert scene.of("jelly").regions.default == "fem"
    near = scene.of("tofu").regions.near
    assert near is not None and near.model == "fem"
    assert scene.of("nori").regions.default == "pbd" and scene.of("nori").quantities == ("grip_force", "worst_stretch")
    assert scene.of("tofu").quantities == ("peak_von_mises", "grip_force") and not scene.of("nori").probes
    changed = with_settings(scene, ["bodies.tofu.material.young=3e4", "regions.default=fem"])
    assert changed.of("tofu").body.material.young == 3e4  # type: ignore[attr-defined]
    assert changed.of("nori").regions.default == "pbd", "of particles, whatever the scene says"
    with pytest.raises(KeyError, match="tofu"):
        scene.of("tofo")
    with pytest.raises(SeveralBodies, match="jelly"):
        _ = scene.body


def test_what_is_reported_has_the_bodies_names() -> None:
    assert several().asked == (
        *("tofu.peak_von_mises", "jelly.peak_von_mises", "tofu.grip_force", "jelly.grip_force", "nori.grip_force"),
        *("nori.worst_stretch", "middle.von_mises", "middle.displacement", "wobble.von_mises", "wobble.displacement"),
    )
    assert alone("tofu").asked == ("peak_von_mises", "grip_force")


@pytest.mark.parametrize(
    ("change", "line", "said"),
    [
        (("bodies:", "body: {kind: rope, length: 1, divisions: 9, density: 1, stretch: 9}\nbodies:"), 5, "not both"),
        (("jelly:", "je lly:"), 11, "is not a name"),
        (("shape: {kind: block, size: [0.03", "shap: {kind: block, size: [0.03"), 12, "did you mean 'shape'"),
        (("regions: {default: fem}", "regions: {default: fen}"), 16, "did you mean 'fem'"),
        (
            ("regions: {default: fem}", "regions: {default: fem, near: {model: pbd, within: 1, tools: [lefd]}}"),
            16,
            "left",
        ),
        (("quantities: [peak", "quantities: [held, tip_deflection, peek"), 36, "peak_von_mises"),
        (("probes:", "symmetry: [x]\nprobes:"), 33, "several bodies"),
        (("probes:", "tolerance: 0.1\nprobes:"), 33, "one body"),
    ],
)
def test_a_mistake_is_found_where_it_stands(change: tuple[str, str], line: int, said: str) -> None:
    with pytest.raises(SceneError) as caught:
        parse_scene(TEXT.replace(*change), "scene.yaml")
    assert str(caught.value).startswith(f"scene.yaml:{line}:"), caught.value
    assert said in str(caught.value)


def test_a_body_is_needed_and_regions_stand_beside_the_only_one() -> None:
    without = re.sub(r"bodies:\n.*?tools:", "tools:", TEXT, flags=re.DOTALL)
    with pytest.raises(SceneError, match="'body' is missing"):
        parse_scene(without)
    inside = TEXT.replace("bodies:\n  tofu:", "body:").split("  jelly:")[0] + "duration: 1\n"
    with pytest.raises(SceneError, match=r"body\.regions: .*beside `body`"):
        parse_scene(inside)


def test_a_body_that_cannot_have_its_model_is_named() -> None:
    with pytest.raises(SceneError, match=r"bodies\.nori\.regions\.default: nori: a sheet is made of particles"):
        parse_scene(TEXT.replace("    kind: sheet\n", "    kind: sheet\n    regions: {default: fem}\n"))


@pytest.mark.kernels
def test_a_probe_in_none_of_the_bodies_is_refused() -> None:
    scene = Scene.model_validate({**several().model_dump(), "probes": {"lost": (1.0, 0.0, 0.0)}})
    with pytest.raises(MeshError, match=r"probes\.lost: .* in none of the bodies jelly, nori, tofu"):
        Simulation(bundle_scene(scene), EmbeddedTransport())


class Lift(SceneEnv):
    def reward(self, before: Observation, after: Observation) -> float:
        return after.quantities["tofu.lift_height"]


@pytest.mark.kernels
def test_an_environment_sees_all_bodies() -> None:
    env = Lift(several(), settings=["duration=0.3"])
    env.reset(seed=0)
    seen, *_ = env.step(env.action_space.sample())
    assert env.observation_space.shape == seen.shape
    assert {*env.names[-len(several().asked) :]} == {*several().asked}
    at = env.names.index("tofu.peak_von_mises")
    assert seen[at] == pytest.approx(env.session.last.quantities["tofu.peak_von_mises"], rel=1e-6) and seen[at] > 0.0
    env.close()
