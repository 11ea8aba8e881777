"""A scene that names no model gets the one that suits it, and is told why; one that names a model gets that."""

from __future__ import annotations

import json
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

import softseam
from softseam.checking import check_scene
from softseam.choice import choice, choices
from softseam.report import ReportBuilder
from softseam.variants import with_model, with_settings
from softseam_protocol.scene.file import SceneError, bundle_scene, load_scene, parse_scene, scene_json
from softseam_protocol.scene.scene import Scene
from softseam_services.server import Setup, build_setup

SCENES = Path(__file__).parents[2] / "scenes"
PRESSED = {
    "tools": {
        "ground": {"kind": "plane", "friction": 0.5},
        "plate": {"kind": "box", "size": [0.01, 0.08, 0.08], "position": [-0.0351, 0, 0.045]},
    },
    "motion": [{"tools": ["plate"], "move": [0.003, 0, 0], "speed": 0.1}],
}
AT_REST: dict[str, Any] = {"tools": {"ground": {"kind": "plane", "friction": 0.5}}, "motion": [], "duration": 0.1}
MATERIAL = {"kind": "neo_hookean", "young": 2e4, "poisson": 0.45, "density": 1050}
SHEET = {"kind": "sheet", "size": [0.1, 0.1], "divisions": [4, 4], "position": [0, 0.3, 0.1], "density": 0.3,
         "stretch": 60, "bending": 1e-6}  # fmt: skip
DUMPLING = {"shape": {"kind": "mesh", "path": "dumpling.obj", "scale": 0.001}, "material": MATERIAL}
OWN = {"shape": {"kind": "mesh", "path": "calamari.vtk", "scale": 0.001, "cells": "own"}, "material": MATERIAL}


def block(across: int, **keys: Any) -> dict[str, Any]:
    """A cube of 6 cm with so many cells along an edge."""
    return {"shape": {"kind": "block", "size": [0.06] * 3}, "cell": 0.06 / across, "material": MATERIAL, **keys}


def scene(body: dict[str, Any], step: float = 0.01, **keys: Any) -> Scene:
    return Scene.model_validate({"softseam": 1, "name": "unsaid", "step": step, "body": body, **PRESSED, **keys})


def setup(given: Scene, name: str = "body") -> Setup:
    files = {file: (SCENES / file).read_bytes() for file in ("calamari.vtk", "dumpling.obj")}
    return build_setup(bundle_scene(given, files), name)


def chosen(given: Scene, name: str = "body") -> tuple[str | None, float | None, str]:
    """Model of the cells that are not near, reach of the near ones [m], and why."""
    made = setup(given, name)
    near = made.scene.regions.near
    assert near is None or (near.model, near.split, near.tools) == ("fem", "when_cheaper", None)
    return made.scene.regions.default, None if near is None else near.within, made.why


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("body", "keys", "model", "reach", "words"),
    [
        (block(3), {}, "fem", None, "names no model, and fem costs some 3 times what pbd does"),
        (block(8), {}, "fem", None, "fem costs some 4.7 times"),
        (block(8), AT_REST, "fem", None, "fem costs some 4.7 times"),
        (block(3), {"step": 0.001}, "fem", None, "fem costs some 11 times"),
        (block(8), {"step": 0.001}, "pbd", 0.00375, "does, for 14,739 unknowns: it gets those within 3.75 mm"),
        (block(8), {"step": 0.001, **AT_REST}, "pbd", None, "14,739 unknowns (regions.default: fem"),
        (block(17, material={**MATERIAL, "young": 2e7}), {}, "pbd", 0.00176, "128,625 unknowns"),
        (DUMPLING, AT_REST, "fem", None, "fem costs some"),
        (OWN, AT_REST, "fem", None, "fem costs some"),
    ],
)  # fmt: skip
def test_what_is_small_is_fems_and_what_is_large_is_cut(
    body: dict[str, Any], keys: dict[str, Any], model: str, reach: float | None, words: str
) -> None:
    """The reach is half a cell's edge; where no tool moves, none is near."""
    told = chosen(scene(body, **keys))
    assert told[:2] == (model, None if reach is None else pytest.approx(reach, rel=0.01)) and words in told[2], told


@pytest.mark.kernels
def test_hexahedra_of_a_file_are_not_cut() -> None:
    """Seams run along faces that are rectangles: XPBD has them all, though a tool moves."""
    models = {"fem": {"element": "hex27_full"}, "pbd": {"sweeps": 2}}
    told = chosen(scene(OWN, 1e-4, models=models))
    assert told[:2] == ("pbd", None) and "(regions.default: fem for that)" in told[2], told


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("keys", "model", "words"),
    [
        ({"models": {"pbd": {"substeps": 30}}}, "pbd", "sets models.pbd.substeps, and nothing of models.fem"),
        ({"models": {"pbd": {"coarse": {"beyond": 0.01}}}}, "pbd", "sets models.pbd.coarse"),
        ({"models": {"fem": {"element": "hex8_bbar"}}}, "fem", "sets models.fem.element, and nothing of models.pbd"),
        ({"models": {"fem": {"element": "hex8_bbar"}, "pbd": {"substeps": 30}}}, "fem", "fem costs some"),
        ({"models": {"fem": {"integrator": "symplectic_euler"}, "pbd": {"substeps": 30}}}, "pbd", "fem cannot do"),
        ({"models": {"pbd": {"substeps": "auto"}}}, "fem", "fem costs some"),
        ({"symmetry": ["y"]}, "fem", "only fem solves for one side"),
    ],
)
def test_what_a_scene_sets_says_which_model_it_means(keys: dict[str, Any], model: str, words: str) -> None:
    told = chosen(scene(block(4), **keys))
    assert told[0] == model and words in told[2], told


def test_what_the_meant_model_cannot_do_is_refused_as_where_it_is_named() -> None:
    """Leapfrog meets no tools, and newmark knows no viscosity: nothing falls through to the other model."""
    for key, given, why in (
        ("pbd", {"method": "leapfrog"}, "leapfrog solves no equations and cannot meet tools"),
        ("fem", {"integrator": "newmark"}, "newmark does not know body.material.retardation_time"),
    ):
        body = block(3, material={**MATERIAL, "retardation_time": 0.001 if key == "fem" else 0.0})
        tools = {} if key == "pbd" else {"tools": {}, "motion": [], "duration": 0.1}
        unsaid = scene_text(body, {"models": {key: given}, **tools})
        with pytest.raises(SceneError, match=why):
            parse_scene(unsaid)
        with pytest.raises(SceneError, match=why):
            parse_scene(unsaid.replace('"regions":{}', f'"regions":{{"default":"{key}"}}'))


def scene_text(body: dict[str, Any], keys: dict[str, Any]) -> str:
    told = {"softseam": 1, "name": "unsaid", "body": body, **PRESSED, "regions": {}, **keys}
    return json.dumps(told, separators=(",", ":"))


@pytest.mark.kernels
def test_what_a_scene_names_it_gets() -> None:
    large, small = scene(block(8), 0.001), scene(block(2))
    assert chosen(with_model(large, "fem")) == ("fem", None, "")
    assert chosen(with_model(small, "pbd")) == ("pbd", None, "")
    assert chosen(with_settings(small, ["regions.default=pbd"])) == ("pbd", None, "")
    near = with_settings(small, ["regions.near={within: 0.02}"])
    assert near.regions.default == "pbd" and chosen(near) == ("pbd", 0.02, "")


@pytest.mark.kernels
def test_each_of_several_bodies_is_decided_alone() -> None:
    """What one body names is not another's."""
    bodies = {
        "small": block(2),
        "large": block(8, position=[0, 0.1, 0]),
        "named": block(2, position=[0, 0.2, 0], regions={"default": "pbd"}),
        "cloth": SHEET,
    }
    several = Scene.model_validate({"softseam": 1, "name": "several", "step": 0.001, "bodies": bodies, **PRESSED})
    found = {name: chosen(several, name) for name in bodies}
    assert {name: told[:2] for name, told in found.items()} == {
        "small": ("fem", None),
        "large": ("pbd", 0.00375),
        "named": ("pbd", None),
        "cloth": ("pbd", None),
    }
    assert [name for name, told in found.items() if told[2]] == ["small", "large"]


@pytest.mark.kernels
def test_every_process_decides_alike_and_the_scene_stays_as_it_was_written() -> None:
    """The choice is no part of the scene, nor of its hash; it is found again from what was recorded."""
    given = scene(block(8), 0.001)
    first, second = setup(given), setup(parse_scene(scene_json(given)))
    assert scene_json(first.scene) == scene_json(second.scene) != scene_json(given) and first.why == second.why
    assert given.regions.default is None and parse_scene(scene_json(given)) == given


@pytest.mark.kernels
def test_run_report_and_check_say_which_and_why(tmp_path: Path) -> None:
    why = "the scene names no model, and fem costs some 2.5 times what pbd does: up to 20 it is worth that"
    given = scene(block(2))
    with softseam.open(given) as session:
        session.reset()
        first = session.step()
        builder = ReportBuilder(session.bundle)
        for event in first.events:
            builder.add(event)
        builder.add(first.report)
        assert choice(session.scene, first) == f"FEM on all 8 cells, for {why}"
        assert builder.build()["models"] == {"body": f"FEM on all 8 cells, for {why}"}
        assert not [event for event in session.step().events if event.kind == "regions"]  # once
    file = tmp_path / "unsaid.yaml"
    file.write_text(scene_json(given))
    console = Console(file=StringIO(), width=400)
    check_scene(str(file), [], console)
    assert f"fem everywhere, for {why}" in console.file.getvalue()  # type: ignore[attr-defined]


@pytest.mark.kernels
def test_a_large_body_is_cut_where_the_tool_presses() -> None:
    """And its first line says so: of 216 cells the 36 at the plate, once it is near."""
    with softseam.open(scene(block(6), 0.001)) as session:
        session.reset()
        first = session.step()
        assert "it gets those within 5 mm of tools that move" in choice(session.scene, first)
        cells = {part.model: part.n_cells for part in first.parts.values()}
        assert cells == {"fem": 36, "pbd": 180}
        # over the bus parts come in another order
        turned = choices(session.scene, dict(reversed([*first.parts.items()])), first.events)
        assert turned["body"] == choice(session.scene, first)


def test_bundled_scenes_name_their_models() -> None:
    """What ships, and what is measured of it, does not hang on the rule."""
    for path in sorted(SCENES.glob("*.yaml")):
        loaded = load_scene(path).scene
        assert loaded.regions.default is not None or loaded.body.kind in ("sheet", "rope", "tet_mesh"), path.name


# ---- FEM's element, where a scene names none


@pytest.mark.kernels
@pytest.mark.parametrize(("body", "element"), [(block(3), "hex27"), (DUMPLING, "hex27_reduced"), (OWN, "hex27")])
def test_cells_that_a_surface_cuts_have_the_softer_element(body: dict[str, Any], element: str) -> None:
    """Also beside a body of another kind, and after the scene was written out and read again; a named one stays."""
    given = scene(body, **AT_REST)
    again = parse_scene(scene_json(given), "again")
    assert [each.of("body").models.fem.element for each in (given, again)] == [element] * 2
    assert setup(given).scene.models.fem.element == element
    two = {"a": body, "b": block(2, position=[0.5, 0.0, 0.0])}
    beside = {key: value for key, value in given.model_dump(exclude_unset=True).items() if key != "body"}
    several = Scene.model_validate(beside | {"bodies": two})
    assert [several.of(name).models.fem.element for name in two] == [element, "hex27"]
    named = scene(body, **AT_REST, models={"fem": {"element": "hex27"}})
    assert setup(named).scene.models.fem.element == "hex27"


@pytest.mark.kernels
@pytest.mark.parametrize(("body", "means"), [(block(8), "fem costs"), (DUMPLING, "sets models.fem.element")])
def test_the_element_that_a_body_has_anyhow_means_no_model(body: dict[str, Any], means: str) -> None:
    """`element: hex27` of a block, as older recordings have it, is as if nothing was said; of a mesh it is a choice."""
    assert means in setup(scene(body, **AT_REST, models={"fem": {"element": "hex27"}})).why
