"""Foods that scenes name: their numbers, where these are from, and what a scene makes of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from softseam.app import app
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import SceneError, load_scene
from softseam_protocol.scene.foods import FOODS, Food, Number
from softseam_protocol.scene.materials import MaterialSpec
from softseam_protocol.scene.scene import Scene
from softseam_studies.foods.command import lasting
from softseam_studies.foods.curves import bar_stress


def scene(material: Any) -> dict[str, Any]:
    shape = {"kind": "block", "size": [0.04, 0.04, 0.04]}
    body = {"shape": shape, "cell": 0.02, "material": material}
    return {
        "softseam": 1,
        "name": "food",
        "body": body,
        "tools": {"ground": {"kind": "plane"}},
        "motion": [{"hold": 0.1}],
    }


def material_of(of: Scene) -> MaterialSpec:
    body = of.body
    assert isinstance(body, BodySpec)
    return body.material


@pytest.mark.parametrize("name", list(FOODS))
def test_a_food_is_a_material_whose_modulus_has_a_source(name: str) -> None:
    food = FOODS[name]
    assert not food.numbers["young"].assumed
    for number in (*food.numbers.values(), *food.besides.values()):
        low, high = number.range or (number.value, number.value)
        assert low <= number.value <= high
    said, numbers = Scene.model_validate(scene(name)), Scene.model_validate(scene(food.material))
    assert said == numbers
    assert material_of(said).model_dump() == material_of(numbers).model_dump()


def test_other_numbers_take_the_place_of_a_foods() -> None:
    own = material_of(Scene.model_validate(scene({"food": "tofu_firm", "young": 30e3})))
    assert (own.young, own.poisson) == (30e3, FOODS["tofu_firm"].numbers["poisson"].value)
    assert len(own.relaxation) == 3


def with_inclusion(body: Any, inclusion: Any) -> Scene:
    data = scene(body)
    data["body"]["inclusions"] = [
        {"shape": {"kind": "sphere", "position": [0.0, 0.0, 0.02], "radius": 0.01}, "material": inclusion}
    ]
    return Scene.model_validate(data)


def test_an_inclusion_is_named_as_a_body_is() -> None:
    """All of the food's numbers, what it does not say of relaxing and breaking is none; a copy by its dump is alike."""
    of = with_inclusion("tofu_firm", {"food": "mozzarella", "young": 1e6})
    assert isinstance(of.body, BodySpec)
    own, cheese = of.body.materials
    assert own.strength == 4e3 and cheese.strength == 59e3
    assert (cheese.young, cheese.density, len(cheese.relaxation)) == (1e6, 1080.0, 6)
    of = with_inclusion("tofu_firm", "plant_sausage")
    assert isinstance(of.body, BodySpec)
    sausage = of.body.materials[1]
    assert (sausage.young, sausage.relaxation, sausage.strength) == (82.3e3, (), None)
    again = Scene.model_validate_json(of.model_dump_json(by_alias=True))
    assert isinstance(again.body, BodySpec) and again.body.materials == of.body.materials
    stone = with_inclusion("tofu_firm", {"young": 2e6})
    assert isinstance(stone.body, BodySpec) and stone.body.materials[1].strength is None


@pytest.mark.parametrize("said", ["tofu_frim", {"food": "tofu_frim"}])
def test_an_inclusion_of_a_food_that_there_is_none_of_is_refused(said: Any) -> None:
    with pytest.raises(ValueError, match=r"inclusions\.0\.material\n.*tofu_frim.* is not in the table of foods"):
        with_inclusion("tofu_firm", said)


def test_how_near_to_breaking_is_refused_of_what_says_no_strength() -> None:
    asks = {"quantities": ["stress_over_strength"]}
    assert Scene.model_validate(scene("tofu_firm") | asks).quantities == ("stress_over_strength",)
    with pytest.raises(ValueError, match="strength: give body"):
        Scene.model_validate(scene("plant_sausage") | asks)


@pytest.mark.parametrize(
    ("said", "text"), [("tofu_frim", "tofu_firm"), ("{food: tofu_frim}", "tofu_firm"), ("3", "food")]
)
def test_a_food_that_there_is_none_of_is_named_with_its_line(said: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / "food.yaml"
    lines = [f"{key}: {value}" for key, value in scene("X").items()]
    path.write_text("\n".join(lines).replace("'X'", said))
    with pytest.raises(SceneError, match=rf"food\.yaml:3[\s\S]*material[\s\S]*{text}"):
        load_scene(path)


def test_a_bar_is_pressed_at_once_and_slowly_as_a_differential_equation_has_it() -> None:
    """Of mu 9 kPa, K 90 kPa, all of it fading, at .8 of its length: shared ends of a rate test, ODE."""
    shear, bulk = 9e3, 90e3
    young, poisson = 9 * bulk * shear / (3 * bulk + shear), (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear))
    food = Food("a bar", {"young": Number(young), "poisson": Number(poisson)}, (((0.6, 0.05), (0.4, 2.0)), "made up"))
    at = np.array([0.8])
    np.testing.assert_allclose(bar_stress(food, at, faded=False), -6674.547407, rtol=1e-6)
    np.testing.assert_allclose(bar_stress(food, at, faded=True), 0.0, atol=1e-6)
    np.testing.assert_allclose(bar_stress(food, np.array([1.0]), faded=False), 0.0, atol=1e-8)
    assert lasting(food, 1e6) == pytest.approx(0.0)


def test_the_command_lists_them_and_shows_one(tmp_path: Path) -> None:
    found = CliRunner().invoke(app, ["materials"], env={"COLUMNS": "200"})
    assert found.exit_code == 0 and all(name in found.output for name in FOODS)
    picture = tmp_path / "tofu.png"
    found = CliRunner().invoke(
        app, ["materials", "--show", "tofu_firm", "--picture", str(picture)], env={"COLUMNS": "200"}
    )
    assert found.exit_code == 0 and "St. Pierre" in found.output and "assumed" in found.output
    assert picture.stat().st_size > 10_000
    assert CliRunner().invoke(app, ["materials", "--show", "tofu"]).exit_code == 2
