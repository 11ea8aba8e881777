"""Scene files: what is read, and what a user is told about a bad one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene import file as scene_file
from softseam_protocol.scene.bodies import BodySpec, MeshShape
from softseam_protocol.scene.file import (
    SceneError,
    bundle_scene,
    load_scene,
    parse_scene,
    scene_from_bundle,
    scene_hash,
    scene_json,
)
from softseam_protocol.scene.motion import ClosePhase, HoldPhase, MovePhase

GOOD = """\
# a cube between two plates
softseam: 1
name: cube
gravity: [0, 0, -9.81]
step: 0.01
body:
  shape: {kind: block, size: [0.05, 0.05, 0.05]}
  cell: [0.0125, 0.025, 0.025]
  material: {kind: neo_hookean, young: 2e4, poisson: 0.45, density: 1050}
tools:
  ground: {kind: plane, point: [0, 0, 0], normal: [0, 0, 1], friction: 0.6}
  left: {kind: box, size: [0.01, 0.06, 0.06], position: [-0.04, 0, 0.03], friction: 0.6}
  right: {kind: box, size: [0.01, 0.06, 0.06], position: [0.04, 0, 0.03], friction: 0.6}
motion:
  - {tools: [left, right], close: 0.02, until: {compression: 0.15}}
  - {hold: 0.3}
  - {tools: [left, right], move: [0, 0, 0.05], speed: 0.05}
regions:
  default: pbd
  near: {model: fem, within: 0.012}
quantities: [grip_force, slip]
"""

SHAPE = "{kind: block, size: [0.05, 0.05, 0.05]}"
MATERIAL = "young: 2e4, poisson: 0.45, density: 1050"
FEM = "models: {fem: "
CLOSE = "{tools: [left, right], close: 0.02, until: {compression: 0.15}}"


def write(folder: Path, text: str | bytes, name: str = "cube.yaml") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def refused(path: Path) -> SceneError:
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    error = caught.value
    assert error.__cause__ is None and "\n" not in str(error)
    assert str(error).startswith(f"{error.file}:{error.line}:{error.column}: ")
    return error


# ---- good scenes --------------------------------------------------------------------------------------------


def test_a_scene_is_read(tmp_path: Path) -> None:
    loaded = load_scene(write(tmp_path, GOOD))
    scene = loaded.scene
    assert isinstance(scene.body, BodySpec)
    assert scene.body.material.young == 2e4
    assert [type(phase) for phase in scene.motion] == [ClosePhase, HoldPhase, MovePhase]
    assert loaded.text == GOOD and loaded.bundle.files == {}
    assert scene_from_bundle(loaded.bundle) == scene


@pytest.mark.parametrize("path", sorted((Path(__file__).parents[2] / "scenes").glob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_scenes_are_valid(path: Path) -> None:
    loaded = load_scene(path)
    again, scene = scene_from_bundle(loaded.bundle), loaded.scene
    assert dict(again.bodies) == dict(scene.bodies) and scene_json(again) == scene_json(scene)
    assert again == scene or any(body.repeat is not None for body in scene.many.values()), "copies are written once"
    assert loaded.scene.name == path.stem


@pytest.mark.parametrize(
    ("cell", "read"), [("0.025", 0.025), ("[0.0125, 0.025, 0.05]", (0.0125, 0.025, 0.05)), ("null", None)]
)
def test_cells_may_be_cubes_or_bricks(cell: str, read: object) -> None:
    body = parse_scene(GOOD.replace("[0.0125, 0.025, 0.025]", cell)).body
    assert isinstance(body, BodySpec)
    assert body.cell == read


def test_a_mesh_travels_with_the_scene(tmp_path: Path) -> None:
    write(tmp_path, b"solid\0bytes", "meshes.stl")
    loaded = load_scene(write(tmp_path, GOOD.replace(SHAPE, "{kind: mesh, path: meshes.stl, scale: 0.02}")))
    assert isinstance(loaded.scene.body, BodySpec)
    assert isinstance(loaded.scene.body.shape, MeshShape)
    assert loaded.bundle.files == {"meshes.stl": b"solid\0bytes"}
    assert scene_from_bundle(loaded.bundle) == loaded.scene
    with pytest.raises(SceneError, match=r"body\.shape\.path: the file 'meshes\.stl' is not in the bundle"):
        scene_from_bundle(Bundle(loaded.bundle.scene, {}))


def test_meshes_of_tools_travel_too(tmp_path: Path) -> None:
    finger = "tools:\n  finger: {kind: mesh, path: finger.stl, position: [1, 0, 0]}"
    write(tmp_path, b"solid\0bytes", "finger.stl")
    loaded = load_scene(write(tmp_path, GOOD.replace("tools:", finger, 1)))
    assert loaded.bundle.files == {"finger.stl": b"solid\0bytes"}
    with pytest.raises(SceneError, match=r"tools\.finger\.path: the file 'finger\.stl' is not in the bundle"):
        scene_from_bundle(Bundle(loaded.bundle.scene, {}))
    error = refused(write(tmp_path, GOOD.replace("tools:", finger.replace("finger.stl", "fingr.stl"), 1)))
    assert (error.line, error.key) == (11, "tools.finger.path") and "did you mean 'finger.stl'?" in str(error)


def test_the_hash_is_of_the_content_not_the_form(tmp_path: Path) -> None:
    scene = parse_scene(GOOD)
    rewritten = parse_scene(json.dumps(json.loads(scene_json(scene))))
    assert scene_hash(bundle_scene(scene)) == scene_hash(bundle_scene(rewritten))
    assert scene_hash(Bundle(scene.model_dump_json(), {})) == scene_hash(bundle_scene(scene))
    other = parse_scene(GOOD.replace("poisson: 0.45", "poisson: 0.46"))
    hashes = {scene_hash(bundle_scene(s, f)) for s in (scene, other) for f in ({}, {"a": b"bc"}, {"ab": b"c"})}
    assert len(hashes) == 6


def test_numbers_are_those_of_yaml_1_2() -> None:
    """PyYAML reads `2e4` as a text, `0o17` or `1:30` as numbers, `no` as false: ours follows JSON."""
    assert parse_scene(GOOD.replace("name: cube", "name: no")).name == "no"
    assert parse_scene(GOOD.replace("step: 0.01", "step: 1e-2")).step == 0.01
    assert parse_scene(GOOD.replace("step: 0.01", "step: .01")).step == 0.01
    for text in ("1:30", "0o17", "0x1f", "1_000", "'0.01'", "yes", "true", "2026-01-01"):
        with pytest.raises(SceneError, match="step: should be a number"):
            parse_scene(GOOD.replace("step: 0.01", f"step: {text}"))


# ---- bad scenes: one error with file, line, key -------------------------------------------------------------

BAD = [
    # replaced, by, line, key, words
    ("gravity:", "gravty:", 4, "gravty", "unknown key; did you mean 'gravity'?"),
    ("poisson: 0.45", "poison: 0.45", 9, "body.material.poison", "did you mean 'poisson'? (allowed: kind, young"),
    ("friction: 0.6}\nmotion", "frction: 0.6}\nmotion", 13, "tools.right.frction", "did you mean 'friction'?"),
    ("within:", "withn:", 20, "regions.near.withn", "did you mean 'within'?"),
    ("young: 2e4", "young: soft", 9, "body.material.young", 'should be a number, but this is "soft"'),
    ("young: 2e4", "young: true", 9, "body.material.young", "should be a number, but this is true"),
    ("young: 2e4", "young: -2e4", 9, "body.material.young", "greater than 0, but this is -20000.0"),
    ("young: 2e4", "young: .inf", 9, "body.material.young", "must be a finite number"),
    ("young: 2e4", "young: .nan", 9, "body.material.young", "must be a finite number"),
    ("young: 2e4", "young: 1e999", 9, "body.material.young", "must be a finite number"),
    ("young: 2e4", "young:", 9, "body.material.young", "but this is empty"),
    ("young: 2e4, ", "", 9, "body.material.young", "the key 'young' is missing"),
    ("poisson: 0.45", "poisson: 0.5", 9, "body.material.poisson", "less than 0.5, but this is 0.5"),
    ("density: 1050", "density: -1050", 9, "body.material.density", "greater than 0"),
    ("kind: neo_hookean", "kind: neo_hokean", 9, "body.material.kind", "did you mean 'neo_hookean'?"),
    ("neo_hookean", "mooney_rivlin", 9, "body.material.ratio", "the key 'ratio' is missing"),
    ("density: 1050", "density: 1050, ratio: 0.2", 9, "body.material.ratio", "neo_hookean has no ratio"),
    ("kind: neo_hookean", "kind: mooney_rivlin, ratio: 2", 9, "body.material.ratio", "less than or equal to 1"),
    ("quant", f"{FEM}{{integrator: bdf2}}}}\nquant", 21, "models.fem.integrator", "bdf2 cannot meet a seam, a mult"),
    ("quant", f"{FEM}{{integrator: newmark}}}}\nquant", 21, "models.fem.integrator", "use implicit_euler or midpoint"),
    ("quant", "seam: {scheme: gc}\nquant", 21, "seam.scheme", "gc is not among the schemes, a multiplier in"),
    ("quant", "seam: {scheme: velocity}\nquant", 21, "seam.scheme", "gain energy with every integrator: use position"),
    ("quant", "seam: {scheme: arlequin}\nquant", 21, "seam.scheme", "a study of linear bars so far: use position"),
    ("quant", "seam: {scheme: postion}\nquant", 21, "seam.scheme", "did you mean 'position'?"),
    ("quant", "seam: {scheme: ph}\nquant", 21, "seam.scheme", "(Prakash-Hjelmstad) let the gap drift: use position"),
    ("quant", "seam: {acceleration: aitken}\nquant", 21, "seam.acceleration", "unknown key"),
    ("quant", "seam: {scheme: staggered, exchanges: 2}\nquant", 21, "seam.exchanges", "use 3 exchanges or more"),
    (
        "quant",
        f"seam: {{scheme: staggered}}\n{FEM}{{integrator: midpoint}}}}\nquant",
        22,
        "models.fem.integrator",
        "use implicit_euler, or give all cells to fem",
    ),
    ("quant", f"{FEM}{{integrator: symplectic_euler}}}}\nquant", 21, "models.fem.integrator", "solves no equations"),
    ("quant", f"{FEM}{{integrator: static}}}}\nquant", 21, "models.fem.integrator", "static needs something"),
    ("quant", f"{FEM}{{radius: 0.5}}}}\nquant", 21, "models.fem.radius", "implicit_euler has no radius"),
    ("softseam: 1\n", "", 2, "softseam", "the key 'softseam' is missing"),
    ("softseam: 1", "softseam: 2", 2, "softseam", "2 is not known here (allowed: 1)"),
    ("name: cube", "name: my cube", 3, "name", "'my cube' is not a name"),
    ("name: cube", "name: ''", 3, "name", "at least 1 character"),
    ("step: 0.01", "step: 0.01\nstep: 0.02", 6, "step", "given twice (first in line 5)"),
    ("step: 0.01", "step: 2", 5, "step", "less than or equal to 1"),
    ("step: 0.01", "step: !!python/name:os.system x", 5, "step", "is not allowed"),
    ("step: 0.01", "step: !!python/object/apply:os.system [x]", 5, "step", "but this is a list of 1"),
    ("step: 0.01", "duration: 1e9", 5, "duration", "steps, more than 10,000,000"),
    ("size: [0.05, 0.05, 0.05]", "size: [0.05, 0.05]", 7, "body.shape.size", "a list of 2 has too few entries"),
    ("size: [0.05, 0.05, 0.05]", "size: [1, 1, 1, 1]", 7, "body.shape.size", "a list of 4 has too many entries"),
    ("size: [0.05, 0.05, 0.05]", "size: [1, 1, x]", 7, "body.shape.size.2", 'should be a number, but this is "x"'),
    ("size: [0.05, 0.05, 0.05]", "size: 0.05", 7, "body.shape.size", "should be a list, but this is 0.05"),
    ("size: [0.05, 0.05, 0.05]", "size: [50, 50, 5000]", 7, "body.shape.size.2", "lengths are in metres"),
    ("size: [0.05, 0.05, 0.05]", "size: [1, 1, 5e-6]", 7, "body.shape.size.2", "lengths are in metres"),
    ("kind: block", "kind: blck", 7, "body.shape.kind", "did you mean 'block'? (allowed: block, mesh)"),
    ("kind: block, ", "", 7, "body.shape.kind", "the key 'kind' is missing"),
    (SHAPE, "{kind: mesh, path: gone.stl}", 7, "body.shape.path", "gone.stl cannot be read: No such file"),
    (SHAPE, "{kind: mesh, path: .}", 7, "body.shape.path", "Is a directory"),
    ("[0.0125, 0.025, 0.025]", "0.0001", 8, "body.cell", "cells, more than 200,000"),
    ("[0.0125, 0.025, 0.025]", "0", 8, "body.cell", "greater than 0"),
    ("[0.0125, 0.025, 0.025]", "[0.0125, 0.025, -1]", 8, "body.cell.2", "greater than 0"),
    ("[0.0125, 0.025, 0.025]", "fine", 8, "body.cell", "should be a number"),
    ("1050}", "1050}\n  friction_field: {spread: .3}", 10, "body.friction_field.length", "is missing"),
    ("1050}", "1050}\n  friction_field: {spread: 3, length: 1}", 10, "body.friction_field.spread", "equal to 1, but"),
    ("kind: plane", "kind: plain", 11, "tools.ground.kind", "(allowed: plane, box, sphere, capsule, cylinder, mesh)"),
    ("normal: [0, 0, 1]", "normal: [0, 0, 0]", 11, "tools.ground.normal", "must not be zero"),
    ("friction: 0.6}\n  left", "friction: -0.6}\n  left", 11, "tools.ground.friction", "greater than or equal to 0"),
    ("  left:", "  le ft:", 12, "tools.le ft", "is not a name"),
    ("  left:", "\tleft:", 12, "", "a tab where YAML wants spaces"),
    ("  left: {", "  left: 3 #", 12, "tools.left", "but this is 3"),
    ("[left, right], close", "[lft, right], close", 15, "motion.0.tools.0", "did you mean 'left'? (allowed: ground"),
    ("[left, right], close", "[left, left], close", 15, "motion.0.tools.1", "cannot close on itself"),
    ("[left, right], close", "[left], close", 15, "motion.0.tools", "too few"),
    ("close: 0.02", "close: fast", 15, "motion.0.close", "should be a number"),
    ("close: 0.02", "clse: 0.02", 15, "motion.0", "did you mean 'close'?"),
    (CLOSE, "3", 15, "motion.0", "a phase says what happens"),
    (CLOSE, "{tools: [ground], turn: [0, 0, 0], speed: 1}", 15, "motion.0.turn", "a turn by no angle"),
    (CLOSE, "{tools: [ground], turn: [0, 0, 1], speed: 90}", 15, "motion.0.speed", "0.9 rad a step, more than 0.5"),
    (CLOSE, "{tools: [grond], turn: [0, 0, 1], speed: 1}", 15, "motion.0.tools.0", "did you mean 'ground'?"),
    (CLOSE, "{tools: [ground], trun: [0, 0, 1], speed: 1}", 15, "motion.0", "did you mean 'turn'?"),
    ("until: {compression: 0.15}", "until: {}", 15, "motion.0.until", "say when to stop"),
    ("until: {compression: 0.15}", "until: {compression: 15}", 15, "motion.0.until.compression", "less than 1"),
    (", until: {compression: 0.15}", "", 15, "motion.0.until", "the key 'until' is missing"),
    ("{hold: 0.3}", "{tools: [left, ground], open: 1}", 16, "motion.1.tools", "closes left and ground together"),
    ("{hold: 0.3}", "{tools: [left, right], opn: 1}", 16, "motion.1", "did you mean 'open'?"),
    ("{hold: 0.3}", "{hold: 0.3, speed: 1}", 16, "motion.1.speed", "unknown key (allowed: hold)"),
    ("move: [0, 0, 0.05]", "move: [0, 0, 0]", 17, "motion.2.move", "zero length: use hold"),
    ("[left, right], move", "[], move", 17, "motion.2.tools", "too few"),
    ("default: pbd", "default: mpm", 19, "regions.default", '"mpm" is not in the table of models (allowed: fem, pbd)'),
    ("within: 0.012", "patience: 3", 20, "regions.near", "say which cells are near"),
    ("within: 0.012", "within: 1, tools: [thumb]", 20, "regions.near.tools.0", "no tool is called 'thumb'"),
    ("within: 0.012", "boxes: [{min: [0, 2, 0], max: [1, 1, 1]}]", 20, "regions.near.boxes.0.min.1", "exceeds max 1"),
    ("default: pbd", "default: pbd\n  goal: sag", 20, "regions.goal", "'sag' is not among the goals: grip_force"),
    ("grip_force", "gripforce", 21, "quantities.0", "did you mean 'grip_force'?"),
    ("quantities:", "models: {pbd: {substeps: atuo}}\nquantities:", 21, "models.pbd.substeps", "did you mean 'auto'?"),
    ("quantities:", "models: {pbd: {substeps: 0}}\nquantities:", 21, "models.pbd.substeps", "but this is 0"),
    ("quantities:", "models: {pbd: {substeps: 2.5}}\nquantities:", 21, "models.pbd.substeps", "but this is 2.5"),
    ("quantities:", "models: {fem: {element: hex20}}\nquantities:", 21, "models.fem.element", "(allowed: hex27,"),
    ("quantities:", "seam: &s {tolerance: *s}\nquantities:", 21, "seam", "contains itself"),
    ("quantities:", "? [a]\n: 1\nquantities:", 21, "", "a key must be a text"),
    (GOOD, "", 1, "", "the file is empty"),
    (GOOD, "# nothing\n", 1, "", "the file is empty"),
    (GOOD, "- softseam\n", 1, "", "a scene is a mapping of keys, but this is a list of 1"),
    (GOOD, "hello", 1, "", 'but this is "hello"'),
    (GOOD, "a: [1,\nb", 2, "", "not YAML"),
    (GOOD, "a: 1\n---\nb: 2\n", 2, "", "not YAML"),
    (GOOD, "a: 1\nb: \x07", 2, "", "is not allowed in YAML"),
    (GOOD, "[" * 3000, 1, "", "nested deeper"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "line", "key", "words"), BAD, ids=[f"{k or 'file'}-{i}" for i, (*_, k, _) in enumerate(BAD)]
)
def test_a_bad_scene_gives_one_error_with_its_place(
    tmp_path: Path, old: str, new: str, line: int, key: str, words: str
) -> None:
    assert old in GOOD
    error = refused(write(tmp_path, GOOD.replace(old, new, 1)))
    assert (error.line, error.key) == (line, key), str(error)
    assert words in str(error)
    assert error.file == str(tmp_path / "cube.yaml")


def test_a_run_without_an_end_is_refused() -> None:
    text = GOOD[: GOOD.index("motion:")] + GOOD[GOOD.index("regions:") :]
    with pytest.raises(SceneError, match="give a duration, or a motion"):
        parse_scene(text)
    assert parse_scene(text + "duration: 1.0\n").duration == 1.0


def test_a_thin_plate_is_refused_with_cells_as_long_as_it_is_thick_and_has_longer_ones_by_default() -> None:
    thin = GOOD.replace("size: [0.05, 0.05, 0.05]", "size: [1, 1, 0.001]")
    parse_scene(thin.replace("  cell: [0.0125, 0.025, 0.025]\n", ""))
    with pytest.raises(SceneError, match=r"body\.cell: .* in 1,000,000 cells, more than 200,000"):
        parse_scene(thin.replace("cell: [0.0125, 0.025, 0.025]", "cell: 0.001"))


def test_newmark_may_not_meet_tools_nor_others_a_seam() -> None:
    whole = GOOD.replace("  default: pbd\n  near: {model: fem, within: 0.012}\n", "  default: fem\n")
    for kind in ("midpoint", "bdf2", "generalised_alpha"):
        parse_scene(whole + f"models: {{fem: {{integrator: {kind}}}}}\n")
    with pytest.raises(SceneError, match=r"newmark cannot meet tools, .*: use one of implicit_euler, midpoint, bdf2"):
        parse_scene(whole + "models: {fem: {integrator: newmark}}\n")
    parse_scene(GOOD + "models: {fem: {integrator: midpoint, radius: 0.5}}\n")
    # settings of a model that the scene does not use say nothing
    parse_scene(GOOD.replace("model: fem", "model: pbd") + "models: {fem: {integrator: newmark}}\n")


def test_a_missing_scene_names_its_neighbours(tmp_path: Path) -> None:
    write(tmp_path, GOOD, "tofu_grasp.yaml")
    error = refused(tmp_path / "tofu_grsp.yaml")
    assert "cannot be read: No such file" in str(error) and "tofu_grasp.yaml" in str(error)
    assert "cannot be read" in str(refused(tmp_path))


def test_a_missing_mesh_names_its_neighbour(tmp_path: Path) -> None:
    write(tmp_path, b"", "bread.vtk")
    error = refused(write(tmp_path, GOOD.replace(SHAPE, "{kind: mesh, path: braed.vtk}")))
    assert error.nearest == "bread.vtk" and error.line == 7


def test_what_is_not_text_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "not UTF-8" in str(refused(write(tmp_path, b"a: 1\nb: \xff\xfe")))
    assert refused(write(tmp_path, b"a: 1\nb: \xff\xfe")).line == 2
    monkeypatch.setattr(scene_file, "MAX_SCENE_BYTES", 10)
    assert "larger than 10 bytes" in str(refused(write(tmp_path, GOOD)))


def test_a_bundle_of_many_bodies_is_read_once(tmp_path: Path) -> None:
    """Each body is built from the whole text."""
    loaded = load_scene(write(tmp_path, GOOD))
    assert scene_from_bundle(loaded.bundle) is scene_from_bundle(Bundle(str(loaded.bundle.scene), {}))


def test_a_bundle_is_not_trusted() -> None:
    for text in ("", "{}", "[]", "nonsense", scene_json(parse_scene(GOOD)).replace("0.45", "0.5"), "{" * 5000):
        with pytest.raises(SceneError, match="<bundle>"):
            scene_from_bundle(Bundle(text, {}))


@settings(max_examples=150, deadline=None)
@given(st.integers(0, len(GOOD)), st.integers(0, 30), st.text(max_size=8))
def test_a_mangled_scene_is_read_or_refused(place: int, cut: int, text: str) -> None:
    """Whatever happens to a scene file, nothing but a SceneError comes out."""
    try:
        parse_scene(GOOD[:place] + text + GOOD[place + cut :])
    except SceneError as error:
        assert error.line >= 1 and error.column >= 1


@settings(max_examples=150, deadline=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=6),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(
            st.sampled_from(["softseam", "name", "body", "tools", "motion", "kind", "hold", "close", "shape", "x"]),
            inner, max_size=4,
        ),
        max_leaves=12,
    )
)  # fmt: skip
def test_any_data_is_read_or_refused(data: object) -> None:
    try:
        parse_scene(json.dumps(data))
    except SceneError:
        return
