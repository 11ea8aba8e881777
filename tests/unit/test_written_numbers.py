"""A number with a comma in a scene: refused as that, with the number that it may be meant to be."""

from __future__ import annotations

import pytest

from softseam.errors import SceneRefused
from softseam.scenes import load_scene
from softseam.variants import with_settings
from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_protocol.scene.written_number import remedy

SCENE = """\
softseam: 1
name: cube
gravity: [0, 0, -9.5]
duration: 0.1
body:
  shape: {kind: block, size: [0.04, 0.04, 0.04]}
  cell: 0.02
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
models: {pbd: {substeps: 30}}
"""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("20,000", "a comma: write 20000, or 20.000 where the comma is a decimal point"),
        ("1,250,000", "a comma: write 1250000"),
        ("7,350.5", "a comma: write 7350.5"),
        ("0,05", "a comma: write 0.05"),
        ("0,125", "a comma: write 0.125"),
        ("-9,81", "a comma: write -9.81"),
        ("-,5", "a comma: write -0.5"),
        ("3,2e4", "a comma: write 3.2e4"),
        ("12.500,75", "a comma: write 12500.75"),
        ("1_000", "an underscore: write 1000"),
        ("15 000", "a space: write 15000"),
        ("15'000", "an apostrophe: write 15000"),
    ],
)
def test_it_is_read_as_people_write_it(text: str, words: str) -> None:
    assert remedy(text) == f"a number with {words}"


@pytest.mark.parametrize(
    "text", ["soft", "1:30", "2026-01-01", "1,2,3", "20,000,00", "left,right", "20000", "0.05", ""]
)
def test_other_texts_are_not(text: str) -> None:
    assert remedy(text) == ""


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        ("2.0e4", "20,000", "8:40: body.material.young: ", '"20,000" is a number with a comma: write 20000, or 20.000'),
        ("2.0e4", "1,250,000", "8:40: body.material.young: ", '"1,250,000" is a number with a comma: write 1250000'),
        ("0.45", "0,45", "8:56: body.material.poisson: ", "write 0.45"),
        ("1000}", "1,050}", "8:71: body.material.density: ", "write 1050"),
        ("2.0e4, poisson: 0.45, density: 1000", "35,000, poisson: 0.4, density: 1,000", "8:40: ", "write 35000"),
        ("cell: 0.02", "cell: 0,02", "7:3: body.cell: ", 'but this is "0,02", a number with a comma: write 0.02'),
        ("duration: 0.1", "duration: 0,25", "4:11: duration: ", "write 0.25"),
        ("duration: 0.1", "duration: 1_000", "4:11: duration: ", "a number with an underscore: write 1000"),
        ("substeps: 30", "substeps: 1,000", "9:26: models.pbd.substeps: ", "write 1000"),
        (
            "[0.04, 0.04, 0.04]",
            "[0,04, 0,04, 0,04]",
            "6:30: body.shape.size: ",
            'a list of 6 has too many entries: "0,04"',
        ),
        ("[0.04, 0.04, 0.04]", "[0.04,0,06,0.04]", "6:30: body.shape.size: ", "write 0.06"),
        ("-9.5]", "-9,81]", "3:10: gravity: ", '"-9,81" is a number with a comma: write -9.81'),
    ],
)
def test_a_scene_with_one_is_refused_as_that(old: str, new: str, place: str, words: str) -> None:
    """In flow mappings YAML takes what follows the comma for a key, in lists for an entry."""
    assert old in SCENE
    with pytest.raises(SceneError) as refused:
        parse_scene(SCENE.replace(old, new), "cube.yaml")
    assert str(refused.value).startswith(f"cube.yaml:{place}")
    assert words in str(refused.value)


def test_a_list_with_a_number_too_many_is_no_number_with_a_comma() -> None:
    for size in ("[1, 1, 1, 1]", "[0.04,0.04,0.04,0.04]", "[1,1,1,1]"):
        with pytest.raises(SceneError, match=r"too many entries \(expected"):
            parse_scene(SCENE.replace("[0.04, 0.04, 0.04]", size))


@pytest.mark.parametrize("normal", ["[0,0,1]", "[0,1,0]", "[-1,0,0]"])
def test_a_list_without_blanks_is_read(normal: str) -> None:
    assert parse_scene(SCENE.replace("[0, 0, -9.5]", normal)).gravity == tuple(map(float, normal[1:-1].split(",")))


@pytest.mark.parametrize(("given", "meant"), [("20,000", "20000"), ("7,5", "7.5"), ("3,2e4", "3.2e4")])
def test_a_setting_with_one_is_refused_as_that(given: str, meant: str) -> None:
    with pytest.raises(SceneRefused, match=f'"{given}", a number with a comma: write {meant}'):
        with_settings(load_scene("tofu_grasp"), [f"body.material.young={given}"])
