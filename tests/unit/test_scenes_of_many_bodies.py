"""Scenes of many bodies: what touches what, copies on a grid, and what is refused or doubted before anything runs."""

from __future__ import annotations

import json
import random
from typing import Any

import numpy as np
import pytest

from softseam.checks import When, of_company
from softseam.variants import with_settings
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.apart import overlaps
from softseam_protocol.scene.bodies import AnyBody, BodySpec
from softseam_protocol.scene.file import (
    SceneError,
    bundle_scene,
    parse_scene,
    place_of,
    scene_from_bundle,
    scene_json,
)
from softseam_protocol.scene.interfaces import ContactSpec
from softseam_protocol.scene.scene import Scene

TEXT = """
softseam: 1
name: tray
step: 0.005
duration: 0.1
contacts: {friction: 0.4, pairs: [{between: [cube, lid], friction: 0.2}]}
regions: {default: pbd}
bodies:
  cube:
    repeat: {grid: [3, 2, 1], spacing: [0.06, 0.06, 0.06]}
    shape: {kind: block, size: [0.05, 0.05, 0.05]}
    cell: 0.025
    material: {kind: neo_hookean, young: 20.0e3, poisson: 0.45, density: 1050}
  lid:
    shape: {kind: block, size: [0.05, 0.05, 0.05]}
    position: [0, 0, 0.2]
    cell: 0.025
    material: {kind: neo_hookean, young: 20.0e3, poisson: 0.45, density: 1050}
tools:
  ground: {kind: plane, friction: 0.5}
"""
NORI = "  nori: {kind: sheet, size: [0.1, 0.1], position: [0, 0, 0.4], divisions: [4, 4], density: 0.1, stretch: 100}\n"


def tray(*changes: tuple[str, str]) -> Scene:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return parse_scene(text, "tray.yaml")


def block(scene: Scene, name: str) -> BodySpec:
    body: AnyBody = scene.bodies[name]
    assert isinstance(body, BodySpec)
    return body


def test_contacts_are_between_all_pairs_in_the_order_of_the_alphabet() -> None:
    scene = tray()
    names = sorted(scene.bodies)
    assert list(scene.interfaces) == [f"{a}+{b}" for i, a in enumerate(names) for b in names[i + 1 :]]
    frictions = {name: each.friction for name, each in scene.interfaces.items() if isinstance(each, ContactSpec)}
    assert {name for name, friction in frictions.items() if friction == 0.2} == {n for n in frictions if "lid" in n}
    assert {friction for name, friction in frictions.items() if "lid" not in name} == {0.4}


def test_the_last_pair_that_names_both_counts_and_copies_are_named_together() -> None:
    pairs = "[{between: [cube, cube], friction: 0.9}, {between: [cube_0_0_0, cube], friction: 0.1}]"
    scene = tray(("pairs: [{between: [cube, lid], friction: 0.2}]", f"pairs: {pairs}"))
    found = {name: each.friction for name, each in scene.interfaces.items() if isinstance(each, ContactSpec)}
    assert found["cube_0_0_0+cube_1_1_0"] == 0.1 and found["cube_1_0_0+cube_1_1_0"] == 0.9
    assert found["cube_0_0_0+lid"] == 0.4


def test_two_bodies_that_an_interface_joins_have_no_other() -> None:
    own = "interfaces: {mine: {kind: contact, between: [lid, cube_0_0_0], friction: 0.7}}\n"
    scene = tray(("tools:", f"{own}tools:"))
    assert "cube_0_0_0+lid" not in scene.interfaces and next(iter(scene.interfaces)) == "mine"
    assert len(scene.interfaces) == 7 * 6 // 2


def test_copies_stand_on_a_grid_about_where_the_body_would() -> None:
    scene = tray(("    cell: 0.025", "    cell: 0.025\n    position: [0.1, 0.2, 0.3]"))
    places = np.array([block(scene, name).position for name in scene.bodies if name != "lid"])
    assert len(places) == 6 and list(scene.bodies)[:2] == ["cube_0_0_0", "cube_1_0_0"]
    np.testing.assert_allclose(places.mean(axis=0), [0.1, 0.2, 0.3], atol=1e-15)
    np.testing.assert_allclose(np.ptp(places, axis=0), [0.12, 0.06, 0.0], atol=1e-15)


def test_all_of_a_body_moves_with_its_copies() -> None:
    inside = (
        "    fixed: [{min: [-1, -1, -0.01], max: [1, 1, 0.01]}]\n"
        "    inclusions: [{shape: {kind: sphere, position: [0, 0, 0.02], radius: 0.01}, material: {young: 1.0e5}}]\n"
    )
    scene = tray(("    cell: 0.025", f"{inside}    cell: 0.025"), ("[3, 2, 1]", "[1, 1, 2]"))
    above = block(scene, "cube_0_0_1")
    assert above.position[2] == above.fixed[0].min[2] + 0.01 == 0.06
    assert above.inclusions[0].shape.position[2] == pytest.approx(0.08)


def test_what_is_drawn_depends_on_the_seed_and_the_name_alone() -> None:
    untidy = "repeat: {shake: 0.002, size: 0.05, stiffness: 0.3, seed: SEED, "
    small, large, other = (
        tray(("repeat: {", untidy.replace("SEED", seed)), ("[3, 2, 1]", grid))
        for seed, grid in (("4", "[1, 1, 1]"), ("4", "[1, 1, 3]"), ("5", "[1, 1, 1]"))
    )
    one, same, unlike = (block(each, "cube_0_0_0") for each in (small, large, other))
    assert one == same and one != unlike
    assert abs(one.position[0]) <= 0.002 and one.position[0] != 0.0
    assert one.material.young != 20e3 and one.material.young == pytest.approx(20e3, rel=0.3)
    assert one.shape.kind == "block" and one.cell == pytest.approx(one.shape.size[0] / 2, rel=1e-12)
    first = random.Random("4 cube_0_0_0").random()
    assert one.position[0] == 0.002 * (2.0 * first - 1.0), "as Python's generator gives it, on every machine"


def test_what_is_recorded_has_each_copy_as_a_body() -> None:
    scene = tray()
    read = scene_from_bundle(bundle_scene(scene))
    assert dict(read.bodies) == dict(scene.bodies) and dict(read.interfaces) == dict(scene.interfaces)
    assert "repeat" not in scene_json(scene) and read.contacts == scene.contacts
    assert len(scene_json(scene)) < 4000, "pairs are not written"
    assert scene_json(read) == scene_json(scene)


def test_settings_mean_all_copies() -> None:
    scene = with_settings(tray(), ["bodies.cube.repeat.grid=[2, 2, 2]", "bodies.cube.material.young=3e4"])
    one = with_settings(tray(), ["bodies.cube_1_0_0.material.young=4e4", "step=0.01"])
    assert [block(one, name).material.young for name in ("cube_0_0_0", "cube_1_0_0")] == [2e4, 4e4] and one.step == 0.01
    assert len(scene.bodies) == 9 and {block(scene, name).material.young for name in scene.bodies} == {2e4, 3e4}


def test_a_thousand_bodies_are_half_a_million_pairs_but_no_longer_text() -> None:
    scene = tray(("[3, 2, 1]", "[5, 5, 5]"), ("position: [0, 0, 0.2]", "position: [0, 0, 0.9]"))
    assert len(scene.interfaces) == 126 * 125 // 2
    assert len(scene_json(scene)) < 400 * 126


@pytest.mark.parametrize(
    ("change", "line", "said"),
    [
        (("between: [cube, lid]", "between: [cube, lidd]"), 6, "no body is called 'lidd'; did you mean 'lid'?"),
        (("between: [cube, lid]", "between: [lid, lid]"), 6, "name two"),
        (("{friction: 0.4, p", "{fricton: 0.4, p"), 6, "did you mean 'friction'?"),
        (("{friction: 0.4, p", "{friction: -1, p"), 6, "greater than or equal to 0"),
        (("contacts: {friction: 0.4", "contacts: all # {"), 6, "allowed: none"),
        (("grid: [3, 2, 1]", "grid: [3, 2]"), 10, "too few entries"),
        (("grid: [3, 2, 1]", "grid: [3, 2, 200]"), 10, "more than 1,000"),
        (("spacing: [0.06, 0.06", "spacing: [0.06, 0"), 10, "2 copies in one place along y"),
        (("spacing: [0.06, 0.06", "spacing: [0.06, 0.048"), 10, "begin 2 mm inside each other along y"),
        (("  lid:", "  cube_0_0_0:"), 10, "a body called 'cube_0_0_0'"),
        (("position: [0, 0, 0.2]", "position: [0, 0.03, 0.04]"), 16, "lid begins 10 mm inside cube_1_1_0"),
        (("position: [0, 0, 0.2]", "position: [0, 0.03, 0.04]"), 16, "move it by [0.0, 0.0, 0.01001] m"),
        (("tools:\n", f"{NORI}tools:\n"), 6, "nothing touches 'nori' yet, a sheet has no faces"),
    ],
)
def test_a_mistake_is_found_where_it_stands(change: tuple[str, str], line: int, said: str) -> None:
    text = TEXT.replace(*change)
    if "nori" in change[1]:
        text = text.replace("between: [cube, lid]", "between: [cube, nori]")
    with pytest.raises(SceneError) as caught:
        parse_scene(text, "tray.yaml")
    assert str(caught.value).startswith(f"tray.yaml:{line}:"), caught.value
    assert said in str(caught.value)


def test_one_body_has_no_copies() -> None:
    one = TEXT.replace("bodies:\n  cube:", "body:").split("  lid:")[0].replace("\n    ", "\n  ")
    with pytest.raises(SceneError, match=r"body\.repeat: .*put it into `bodies`"):
        parse_scene(one.partition("contacts:")[0] + one.partition("\nregions")[1] + one.partition("\nregions")[2])


def test_bodies_that_overlap_may_where_nothing_is_between_them() -> None:
    change = ("position: [0, 0, 0.2]", "position: [0, 0.03, 0.04]")
    found = list(overlaps(tray(change, (TEXT.split("\n")[5], "contacts: none")).bodies))
    assert [(each.one, each.other) for each in found] == [("cube_1_1_0", "lid")]


def test_a_place_of_a_copy_is_where_the_body_stands(tmp_path: Any) -> None:
    path = tmp_path / "tray.yaml"
    path.write_text(TEXT)
    assert place_of(path, "bodies.cube_2_1_0.material.young")[0] == 13


def test_what_nothing_keeps_apart_is_said() -> None:
    said = "nothing keeps cube_1_0_0 and lid apart, nor 20 other pairs"
    without = (TEXT.split("\n")[5], "")
    (only,) = of_company(tray(without))
    assert said in only and "contacts: {friction: 0.5}" in only
    beside = tray(without, ("position: [0, 0, 0.2]", "position: [0, 1, 0]"))
    assert of_company(beside) == [] and "nothing keeps" in of_company(beside, When.NOTE)[0], "they may never meet"
    assert of_company(tray(without), When.NOTE) == []
    assert of_company(tray()) == of_company(tray((TEXT.split("\n")[5], "contacts: none"))) == []


def test_what_cannot_touch_yet_is_said_once_for_all_copies() -> None:
    scene = tray(("tools:\n", f"{NORI.replace('{', '{repeat: {grid: [2, 1, 1], spacing: [1, 0, 0]}, ')}tools:\n"))
    (only,) = of_company(scene, When.NOTE)
    assert only.startswith("bodies.nori: nothing but tools touches it yet, a sheet has no faces")
    cut = tray(
        ("  lid:\n", "  lid:\n    regions: {default: pbd, near: {within: 0.01, tools: [ground]}}\n"), ("lid]", "cube]")
    )
    (only,) = of_company(cut)
    assert "it is cut in two models" in only


def test_many_of_a_model_that_does_not_pile_are_said_to_be_slow() -> None:
    (only,) = of_company(tray(("{default: pbd}", "{default: fem}")))
    assert only.startswith("contacts: 7 bodies of fem may touch") and only.endswith("to pbd")
    assert not of_company(tray(("{default: pbd}", "{default: fem}"), ("[3, 2, 1]", "[2, 1, 1]")))


def test_a_scene_of_another_program_is_read_alike() -> None:
    """As JSON, through a bundle that repeats bodies."""
    data = json.loads(json.dumps(tray().model_dump(mode="json", context="as written")))
    assert scene_json(scene_from_bundle(Bundle(json.dumps(data), {}))) == scene_json(tray())
