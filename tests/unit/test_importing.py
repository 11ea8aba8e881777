"""`softseam import`: the textbook's two templates become the scenes that ship, and what they cannot say is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import softseam
from softseam.errors import SceneRefused
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import parse_scene
from softseam_protocol.scene.particles import SheetBody
from softseam_studies.importing import scene_of

SCENES = Path(__file__).parents[2] / "scenes"
FEM = (SCENES / "templates" / "fem_config.yaml").read_text(encoding="utf-8")
PBD = (SCENES / "templates" / "pbd_config.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["fem", "pbd"])
def test_the_scenes_that_ship_are_what_import_makes(kind: str) -> None:
    text, _ = scene_of(SCENES / "templates" / f"{kind}_config.yaml", f"template_{kind}")
    assert text == (SCENES / f"template_{kind}.yaml").read_text(encoding="utf-8")


def test_fem_is_set_as_its_template_says() -> None:
    text, lines = scene_of(SCENES / "templates" / "fem_config.yaml", "x")
    scene = parse_scene(text)
    assert isinstance(scene.body, BodySpec)
    material, fem = scene.body.material, scene.models.fem
    assert (material.kind, material.young, material.poisson) == ("neo_hookean", 1e6, 0.45)
    assert (fem.element, fem.integrator, scene.step) == ("tet10", "implicit_euler", 0.001)
    without = {line.key: line.number for line in lines if not line.became}
    assert without == {
        "solver.type": 8,
        "solver.preconditioner": 9,
        "solver.tolerance": 10,
        "solver.max_iterations": 11,
        "time_integration.adaptive": 15,
    }
    assert all(FEM.splitlines()[line.number - 1].strip().startswith(line.key.split(".")[-1]) for line in lines)


def test_pbd_is_set_as_its_template_says() -> None:
    text, lines = scene_of(SCENES / "templates" / "pbd_config.yaml", "x")
    scene = parse_scene(text)
    pbd, body = scene.models.pbd, scene.body
    assert isinstance(body, SheetBody)
    assert (pbd.method, pbd.sweeps, pbd.substeps) == ("pbd", 10, 4)
    assert (pbd.classic.stretch, pbd.classic.bending, pbd.classic.per_substep) == (0.9, 0.1, False)
    assert (body.thickness, body.friction, body.restitution) == (0.01, 0.3, 0.1)
    assert {tool.friction for tool in scene.tools.values()} == {0.3}
    assert [(line.key, line.number) for line in lines if not line.became] == [("constraints.volume.stiffness", 10)]


BAD = {
    "misspelt": (
        FEM.replace("youngs", "young"),
        "x.yaml:5:5: material.young_modulus: unknown key; did you mean 'mater",
    ),
    "unknown element": (
        FEM.replace("tet10", "tet11"),
        'x.yaml:2:3: element_type: "tet11" is not in the table of elements; did you',
    ),
    "out of range": (FEM.replace("0.45", "0.5"), "x.yaml:6:5: material.poisson_ratio: should be less than 0.5"),
    "missing": (FEM.replace("    youngs_modulus: 1.0e6  # Pa\n", ""), "x.yaml:1:1: material.youngs_modulus is missing"),
    "no law": (FEM.replace("neo_hookean", "ogden9"), "x.yaml:4:5: material.model: "),
    "not a number": (FEM.replace("0.001", "fast"), "x.yaml:14:5: time_integration.timestep: should be a number"),
    "not finite": (FEM.replace("0.001", ".nan"), "x.yaml:14:5: time_integration.timestep: must be a finite number"),
    "twice": (PBD.replace('"bending"', '"distance"'), "x.yaml:13:7: constraints.distance.stiffness is given twice"),
    "another constraint": (PBD.replace('"volume"', '"shape"'), "x.yaml:10:7: constraints.shape.stiffness: unknown key"),
    "no type": (PBD.replace('type: "volume"\n     ', ""), "x.yaml:9:8: constraints: an entry says its type"),
    "too stiff": (PBD.replace("0.9\n", "1.9\n"), "x.yaml:7:7: constraints.distance.stiffness: should be less than"),
    "no iterations": (PBD.replace("iterations: 10", "iterations: 0"), "x.yaml:2:3: solver_iterations: should be gre"),
    "empty": ("fem_config:\n", "x.yaml:1:1: fem_config is a mapping of keys"),
    "a scene": ("softseam: 1\n", "x.yaml:1:1: a template has one key: fem_config or pbd_config"),
    "both": (FEM + PBD, "x.yaml:1:1: a template has one key"),
    "no yaml": ("a: [1, 2\n", "x.yaml:2:1: not YAML"),
    "no text": ("\x00", "x.yaml:1:1: the character"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_a_template_cannot_say_is_refused_at_its_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text, begins = BAD[name]
    Path("x.yaml").write_text(text)
    with pytest.raises(SceneRefused) as caught:
        scene_of(Path("x.yaml"), "x")
    assert str(caught.value).startswith(begins)


@pytest.mark.kernels
def test_the_scenes_of_both_templates_run_to_their_end() -> None:
    """The block is pressed by a tenth between plates; the sheet lies on the ball, no deeper in it than 1 mm."""
    with softseam.open("template_fem") as block:
        block.reset()
        while not block.done:
            pressed = block.step(fields=False)
        assert pressed.quantities["compression"] == pytest.approx(0.1, abs=1e-3)
        assert pressed.quantities["grip_force"] > 100.0
    with softseam.open("template_pbd") as sheet:
        sheet.reset()
        for _ in range(60):
            hung = sheet.step(fields=False)
        assert hung.quantities["sag"] == pytest.approx(-0.130, abs=0.01)
