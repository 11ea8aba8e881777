"""`softseam run` warns before the first step of what `softseam check` warns of; over a bus, of what the scene tells."""

from __future__ import annotations

import re
from collections.abc import Sequence
from io import StringIO
from pathlib import Path

import pytest
import solids
from rich.console import Console

import softseam
from softseam.checking import check_scene
from softseam.checks import doubts
from softseam.running import Wishes, run
from softseam_protocol.scene.file import load_scene

SCENE = """\
softseam: 1
name: cube
step: 0.01
duration: 0.02
body:
  shape: {kind: block, size: [0.02, 0.02, 0.02]}
  cell: 0.01
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
tools:
  left: {kind: box, size: [0.01, 0.03, 0.03], position: [-0.0155, 0, 0.016]}
  right: {kind: box, size: [0.01, 0.03, 0.03], position: [0.0155, 0, 0.016]}
motion:
  - {tools: [left, right], close: 0.02, until: {time: 0.02}}
regions: {default: pbd}
models: {pbd: {substeps: 40}}
"""

DOUBTFUL = [
    ("young: 2.0e4", "young: 200", "8:40: body.material.young: 200 Pa; the body would sink by some 98 %"),
    ("density: 1000", "density: 1.05", "8:71: body.material.density: 1.05 kg/m^3 is unlike any solid"),
    ("substeps: 40", "substeps: 3", "15:26: models.pbd.substeps: 3 in a step of 10 ms are fewer than the"),
    ("duration: 0.02", "gravity: [0, -800, 0]\nduration: 0.02", "4:10: gravity: 800 m/s^2 is 81.5 times the earth's"),
    ("cell: 0.01", "cell: 0.01\n  velocity: [0, 0, 250]", "8:13: body.velocity: 250 m/s is faster than"),
    ("close: 0.02", "close: 0.7", "13:5: motion.0: left moves half its thickness in a step of 10 ms"),
]


def warnings_of_run(path: Path, settings: Sequence[str] = ()) -> list[str]:
    """All that it prints before the run begins; it prints no warning later."""
    said = StringIO()
    run(Wishes(str(path), settings=tuple(settings)), Console(file=said, width=1000))
    lines = said.getvalue().splitlines()
    begun = lines.index("cube: setting up")
    assert not [line for line in lines[begun:] if line.startswith("warning")]
    return lines[:begun]


def warnings_of_check(path: Path, settings: Sequence[str] = ()) -> list[str]:
    said = StringIO()
    check_scene(str(path), settings, Console(file=said, width=1000))
    return [line for line in said.getvalue().splitlines() if line.startswith("warning")]


@pytest.mark.kernels
@pytest.mark.parametrize(("old", "new", "words"), DOUBTFUL, ids=[words.split(": ")[1] for _, _, words in DOUBTFUL])
def test_a_run_begins_with_the_warnings_of_check(old: str, new: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "cube.yaml"
    assert old in SCENE
    path.write_text(SCENE.replace(old, new))
    told = warnings_of_run(path)
    assert any(line.startswith(f"warning: {path}:{words}") for line in told)
    assert told == warnings_of_check(path)


@pytest.mark.kernels
def test_a_sound_scene_has_none(tmp_path: Path) -> None:
    path = tmp_path / "cube.yaml"
    path.write_text(SCENE)
    assert warnings_of_run(path) == []


@pytest.mark.kernels
@pytest.mark.parametrize("young", [90, 150, 310])
def test_what_a_setting_changed_is_warned_of_by_its_name(young: int, tmp_path: Path) -> None:
    path, setting = tmp_path / "cube.yaml", f"body.material.young={young}"
    path.write_text(SCENE)
    (told,) = warnings_of_run(path, [setting])
    assert told.startswith(f"warning: --set {setting}: body.material.young: {young} Pa")


@pytest.mark.kernels
@pytest.mark.parametrize("young", [20.0, 50.0, 99.0])
def test_a_modulus_in_kilopascals_is_told_without_weight(young: float, tmp_path: Path) -> None:
    """Where no gravity would make it sink; the softest gels that stand have more."""
    path = tmp_path / "cube.yaml"
    path.write_text(SCENE.replace("duration: 0.02", "duration: 0.02\ngravity: [0, 0, 0]"))
    (told,) = warnings_of_check(path, [f"body.material.young={young}"])
    assert f"body.material.young: {young:g} Pa is unlike any soft solid" in told
    assert warnings_of_check(path, [f"body.material.young={young + 80}"]) == []


@pytest.mark.kernels
def test_cells_that_are_hardly_filled_are_told_in_the_table_alone(tmp_path: Path) -> None:
    """They are joined to fuller ones: nothing about the scene is doubtful for them."""
    (tmp_path / "ball.obj").write_bytes(solids.obj(*solids.sphere(0.02, 3)))
    path, said = tmp_path / "ball.yaml", StringIO()
    body = (
        "body: {shape: {kind: mesh, path: ball.obj}, cell: 0.009, material: {young: 2e4, poisson: 0.4, density: 1e3}}"
    )
    path.write_text(f"softseam: 1\nname: ball\nduration: 0.02\n{body}\n")
    check_scene(str(path), (), Console(file=said, width=1000))
    assert re.search(r"cells wholly, \d+ by less than 2 %", said.getvalue()) and "warning" not in said.getvalue()


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["tofu", "jelly"])
def test_of_several_bodies_the_one_is_named(name: str, tmp_path: Path) -> None:
    """The same material for both, but one of them as soft as soup."""
    softs = {"tofu": "2.0e4", "jelly": "2.0e4"} | {name: "100"}
    body = "    shape: {{kind: block, size: [0.02, 0.02, 0.02]}}\n    cell: 0.01\n    position: [{x}, 0, 0]\n"
    body += "    material: {{young: {young}, poisson: 0.4, density: 1000}}\n"
    bodies = "".join(f"  {each}:\n{body.format(x=x, young=softs[each])}" for each, x in (("tofu", 0), ("jelly", 0.1)))
    path = tmp_path / "cube.yaml"
    path.write_text(f"softseam: 1\nname: cube\nduration: 0.02\nbodies:\n{bodies}tools:\n  ground: {{kind: plane}}\n")
    line = 9 if name == "tofu" else 14
    (told,) = warnings_of_run(path)
    assert told.startswith(f"warning: {path}:{line}:23: bodies.{name}.material.young: 100 Pa")
    assert warnings_of_check(path) == [told]


@pytest.mark.kernels
def test_a_session_tells_them(tmp_path: Path) -> None:
    path = tmp_path / "cube.yaml"
    path.write_text(SCENE.replace("2.0e4", "200"))
    with softseam.open(path) as session:
        (told,) = session.doubts()
        assert told.startswith("body.material.young: 200 Pa")
        session.reset(settings=["body.material.young=2e4"])
        assert session.doubts() == []


@pytest.mark.parametrize(("old", "new", "words"), DOUBTFUL[3:5])
def test_without_bodies_the_scene_alone_tells(old: str, new: str, words: str, tmp_path: Path) -> None:
    """As where they are built elsewhere; what needs them is not told."""
    path = tmp_path / "cube.yaml"
    path.write_text(SCENE.replace(old, new).replace("2.0e4", "200"))
    (told,) = doubts(load_scene(path).scene, {})
    assert told.startswith(words.split(": ", 1)[1])


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("changes", "key"),
    [
        (
            {"cell: 0.01": "cell: 0.01\n  velocity: [0, 0, -20]"},
            "body.velocity: it meets tools at up to 20 m/s, 2.3 times",
        ),
        ({"close: 0.02": "close: 20"}, "motion.0.close: 20 m/s is 2.3 times the 8.71 m/s of waves in the body"),
        (
            {"  left: {": "  floor: {kind: plane, point: [0, 0, -3]}\n  left: {"},
            "body.velocity: it meets tools at up to 7.67",
        ),
        ({"cell: 0.01": "cell: 0.01\n  velocity: [0, 0, -3]"}, ""),
        ({"close: 0.02": "close: 4"}, ""),
        ({"close: 0.02": "close: 20", "young: 2.0e4": "young: 2.0e6"}, ""),
        ({"  left: {": "  floor: {kind: plane, point: [0, 0, -0.5]}\n  left: {"}, ""),
    ],
)
def test_hits_that_crush_the_material_are_doubtful(changes: dict[str, str], key: str, tmp_path: Path) -> None:
    """Faster than half the speed of waves: thrown, pressed, or fallen by three metres."""
    text = SCENE
    for old, new in changes.items():
        text = text.replace(old, new, 1)
    path = tmp_path / "hit.yaml"
    path.write_text(text)
    found = [line for line in warnings_of_check(path) if "what is hit so fast" in line]
    assert [key in line for line in found] == [True] if key else not found
