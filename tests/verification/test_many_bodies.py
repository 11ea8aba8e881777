"""Many bodies that touch by the scene's `contacts`: who presses whom, with what force in all, and what is said where
nothing keeps bodies apart."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cubes import tray

import softseam
from softseam.observation import Observation
from softseam.recording import Recording
from softseam_protocol.scene.scene import Scene

pytestmark = pytest.mark.kernels

EDGE, DENSITY = 0.04, 1000.0
WEIGHT = 9.81 * DENSITY * EDGE**3
CUBE: dict[str, Any] = {
    "shape": {"kind": "block", "size": [EDGE] * 3},
    "cell": EDGE / 2,
    "material": {"young": 2e5, "poisson": 0.3, "density": DENSITY, "retardation_time": 0.02},
}
MODELS = pytest.mark.parametrize("model", ["fem", "pbd"])


def scene(bodies: dict[str, Any], **keys: Any) -> Scene:
    data = {
        "softseam": 1,
        "name": "many",
        "step": 0.005,
        "duration": 0.6,
        "bodies": bodies,
        "tools": {"ground": {"kind": "plane", "friction": 0.5}},
        "regions": {"default": "pbd"},
        "contacts": {"friction": 0.4},
    }
    return Scene.model_validate_json(json.dumps(data | keys), strict=True)


def run(of: Scene, **keys: Any) -> list[Observation]:
    with softseam.open(of, **keys) as sim:
        sim.reset(seed=0)
        seen = [sim.step()]
        while not seen[-1].done:
            seen.append(sim.step())
    return seen


def tower(count: int) -> dict[str, Any]:
    return {"cube": CUBE | {"repeat": {"grid": [1, 1, count], "spacing": [0, 0, EDGE + 1e-4]}}}


def test_each_contact_of_a_tower_carries_what_is_above_it() -> None:
    """To 1e-6; those that do not press are in no report, and so in no recording."""
    still = run(scene(tower(3)))[-1]
    assert list(still.interfaces) == ["cube_0_0_0+cube_0_0_1", "cube_0_0_1+cube_0_0_2"]
    for (name, each), above in zip(still.interfaces.items(), (2, 1), strict=True):
        np.testing.assert_allclose(each.total, [0.0, 0.0, -above * WEIGHT], rtol=1e-6, atol=1e-6 * WEIGHT, err_msg=name)
        assert each.n_nodes > 0 and each.force < above * WEIGHT
    assert -still.wrench["ground"][2] == pytest.approx(3 * WEIGHT, rel=1e-6)


@pytest.mark.parametrize("models", [("fem", "pbd"), ("pbd", "fem")])
def test_a_contact_of_two_models_carries_what_is_above_it(models: tuple[str, str]) -> None:
    """To 1e-4, whichever is above."""
    lower, upper = ({"regions": {"default": model}} for model in models)
    still = run(scene({"lower": CUBE | lower, "upper": CUBE | upper | {"position": [0.0, 0.0, EDGE + 1e-4]}}))[-1]
    np.testing.assert_allclose(still.interfaces["lower+upper"].total, [0.0, 0.0, -WEIGHT], atol=1e-4 * WEIGHT)


@pytest.mark.parametrize(("model", "off"), [("fem", 5e-3), ("pbd", 1e-9)])
def test_what_a_body_is_pushed_with_is_what_its_momentum_gains(model: str, off: float) -> None:
    """Two that meet in the air, askew: the sum of force times step, to a share of what they had.

    What a step turns two of FEM by about each other, so that no spin is lost, pushes them too, and is in no contact.
    """
    bodies = {
        "a": CUBE | {"velocity": [0.5, 0.0, 0.0], "position": [0.0, 0.0, 1.0]},
        "b": CUBE | {"position": [EDGE + 2e-3, 0.01, 1.004]},
    }
    of = scene(bodies, gravity=[0, 0, 0], duration=0.5, regions={"default": model}, tools={})
    seen = run(of)
    forces = [one.interfaces["a+b"].total for one in seen if "a+b" in one.interfaces]
    pushed = 0.005 * np.sum(forces, axis=0)
    mass = DENSITY * EDGE**3
    gained = [_momentum(seen, name, mass) for name in "ab"]
    np.testing.assert_allclose(gained[0] - [0.5 * mass, 0.0, 0.0], pushed, atol=off * 0.5 * mass)
    np.testing.assert_allclose(gained[1], -pushed, atol=off * 0.5 * mass)
    assert abs(pushed[0]) > 0.2 * mass


def _momentum(seen: list[Observation], name: str, mass: float) -> Any:
    """By where its middle went in the last steps, long after they met: nothing in it moves against the rest by then."""
    first, last = (one.bodies[name].positions.mean(axis=0) for one in (seen[-5], seen[-1]))
    return mass * (last - first) / (4 * 0.005)


@MODELS
def test_one_cube_set_upon_the_other_stays_there(model: str) -> None:
    """The ground bears both; without `contacts` the upper one falls through, and that is said before and after."""
    bodies = {"lower": CUBE, "upper": CUBE | {"position": [0.0, 0.0, EDGE + 5e-4]}}
    with softseam.open(scene(bodies, regions={"default": model})) as sim:
        assert not [text for text in sim.doubts() if "apart" in text]
    still = run(scene(bodies, regions={"default": model}))
    assert not [event for one in still for event in one.events if event.kind == "overlap"]
    x = still[-1].bodies["upper"].positions[:, 2]
    assert x.min() > 0.98 * EDGE and x.max() < 2.0 * EDGE
    assert -still[-1].wrench["ground"][2] == pytest.approx(2.0 * WEIGHT, rel=1e-5)

    without = scene(bodies, regions={"default": model}).model_copy(update={"contacts": None})
    with softseam.open(without) as sim:
        assert any("nothing keeps lower and upper apart" in text for text in sim.doubts())
    events = [event for one in run(without) for event in one.events if event.kind == "overlap"]
    assert len(events) == 1 and "lower and upper are where the other is" in events[0].message
    meant = without.model_copy(update={"contacts": "none"})
    with softseam.open(meant) as sim:
        assert not [text for text in sim.doubts() if "apart" in text]
    assert not [event for one in run(meant) for event in one.events if event.kind == "overlap"]


def test_what_cannot_touch_is_said_when_it_passes_through() -> None:
    """A sheet that falls on a cube: contact is not its yet, and nobody has to find that out by looking."""
    nori = {"kind": "sheet", "size": [0.02, 0.02], "divisions": [2, 2], "density": 0.1, "stretch": 100}
    bodies = {"cube": CUBE, "nori": nori | {"position": [0.0, 0.0, EDGE + 5e-3]}}
    of = scene(bodies, duration=0.3, regions={}, models={})
    with softseam.open(of) as sim:
        assert any(text.startswith("bodies.nori: nothing but tools touches it yet") for text in sim.doubts())
    events = [event.message for one in run(of) for event in one.events if event.kind == "overlap"]
    assert len(events) == 1 and "cube and nori" in events[0]


def test_a_body_that_falls_beside_the_world_is_named() -> None:
    """One of a pile that walks off a table."""
    table = {"kind": "box", "size": [0.1, 0.1, 0.01], "position": [0.0, 0.0, -0.005], "friction": 0.5}
    bodies = {"stays": CUBE, "leaves": CUBE | {"position": [0.2, 0.0, 0.0]}}
    events = [event for one in run(scene(bodies, tools={"table": table}, duration=0.8)) for event in one.events]
    assert [event.message.partition(":")[0] for event in events if event.kind == "gone"] == ["leaves"]


def test_walls_that_are_too_close_are_refused_with_the_copies() -> None:
    walls = {
        f"wall{side}": {"kind": "box", "size": [0.01, 0.2, 0.1], "position": [0.06 * side, 0.0, 0.05]}
        for side in (-1, 1)
    }
    bodies = {"cube": CUBE | {"repeat": {"grid": [3, 1, 1], "spacing": [EDGE + 1e-3, 0, 0]}}}
    named = {key.replace("-", "_"): wall for key, wall in walls.items()}
    with pytest.raises(
        softseam.SoftseamError, match=r"tools\.wall_1: it starts .* mm inside the body.*cube_0_0_0"
    ) as caught:
        softseam.open(scene(bodies, tools=named))
    assert "all copies are 122 x 40 x 40 mm" in str(caught.value) and "bodies.cube.repeat" in str(caught.value)


def test_a_recording_has_what_pressed(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    seen = run(scene(tower(2), duration=0.2), record=path)
    reports = list(Recording(path).reports())
    assert [dict(one.interfaces) for one in reports] == [dict(one.interfaces) for one in seen]
    assert reports[-1].interfaces["cube_0_0_0+cube_0_0_1"].total[2] < -0.5 * WEIGHT
    assert Recording(path).scene.interfaces.keys() == {"cube_0_0_0+cube_0_0_1"}


def test_a_tray_bears_what_lies_in_it_and_gives_up_what_is_lifted() -> None:
    """Eight cubes with one upon them, as the shipped scene has twenty-seven, in a jelly that rests sooner: the floor
    bears all weights to 1e-6 and what friction keeps of the walls' pressures, which differ by .001 at most; the lifted
    cube hangs by itself, and no other moves by 1 mm."""
    rests = [f"bodies.{name}.material.retardation_time=0.01" for name in ("cube", "picked")]
    weight = 9.81 * 1050.0 * 0.05**3
    with softseam.open(tray(2, "motion.0.hold=2.0", *rests)) as sim:
        sim.reset(seed=0)
        still = sim.run(max_steps=400, fields=True)
        last = sim.run(fields=True)
    assert -still.wrench["floor"][2] == pytest.approx(9 * weight, rel=1e-6)
    assert still.energies["kinetic"] < 1e-9 * weight * 0.05
    assert np.abs(sum(force[:2] for force in still.wrench.values())).max() < 1e-6 * weight
    for one, other, along in (("west", "east", 0), ("south", "north", 1)):
        assert still.wrench[one][along] == pytest.approx(-still.wrench[other][along], rel=2e-3)
    upon = [np.array(each.total) for name, each in still.interfaces.items() if "picked" in name]
    np.testing.assert_allclose(np.sum(upon, axis=0), [0.0, 0.0, -weight], rtol=1e-6, atol=1e-6 * weight)
    assert last.quantities["picked.lift_height"] == pytest.approx(0.08, rel=0.03)
    assert not [name for name in last.interfaces if "picked" in name]
    assert -last.wrench["floor"][2] == pytest.approx(8 * weight, rel=1e-2)
    for name, body in last.bodies.items():
        if name != "picked":
            away = body.positions.mean(axis=0) - still.bodies[name].positions.mean(axis=0)
            assert np.abs(away).max() < 1e-3, name
