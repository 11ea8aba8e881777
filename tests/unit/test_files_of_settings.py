"""A setting may name another mesh, of a body or a tool: it is read from beside the scene, else the working folder; and
a mesh in another unit is named before the run."""

from __future__ import annotations

from pathlib import Path

import pytest
from scene_files import collada
from solids import box, obj

import softseam
from softseam.errors import SceneRefused
from softseam.scenes import bundle_of, bundle_with
from softseam.variants import with_settings
from softseam_protocol.scene.bodies import BodySpec, MeshShape
from softseam_protocol.scene.scene import Scene
from softseam_services.body.errors import ToolError
from softseam_services.server import build_setup

SCENE = """softseam: 1
name: pad
step: 0.01
duration: 0.02
regions: {default: pbd}
body:
  shape: {kind: mesh, path: cube.obj}
  cell: 0.02
  material: {young: 5.0e4, poisson: 0.4, density: 1000}
tools:
  ground: {kind: plane}
  finger: {kind: mesh, path: finger.obj, position: [0, 0, 0.1]}
"""
CUBE, FINGER = obj(*box((0.03, 0.03, 0.03))), obj(*box((0.01, 0.02, 0.03)))
MM = obj(*box((10.0, 20.0, 50.0)))


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene in a folder of its own, with another mesh beside it; a third lies in the working folder."""
    folder, here = tmp_path / "scenes", tmp_path / "here"
    (folder / "meshes").mkdir(parents=True)
    here.mkdir()
    monkeypatch.chdir(here)
    path = folder / "pad.yaml"
    path.write_text(SCENE)
    for name, data in (
        ("cube.obj", CUBE),
        ("finger.obj", FINGER),
        ("mm.obj", MM),
        ("meshes/flat.obj", obj(*box((0.05, 0.03, 0.01)))),
    ):
        (folder / name).write_bytes(data)
    (here / "tall.obj").write_bytes(obj(*box((0.01, 0.01, 0.05))))
    (here / "cube.dae").write_bytes(
        collada('<node id="n"><instance_geometry url="#g"/></node>', '<unit meter="0.01"/>')
    )
    return path


def bundle(path: Path, *settings: str) -> dict[str, bytes]:
    loaded, given = bundle_of(path)
    return bundle_with(with_settings(loaded, settings), given, path, settings).files


def test_files_beside_the_scene_and_in_the_working_folder(scene: Path) -> None:
    beside = bundle(scene, "body.shape.path=meshes/flat.obj")
    assert set(beside) == {"meshes/flat.obj", "finger.obj"}
    here = bundle(scene, "body.shape.path=tall.obj", "tools.finger.path=cube.obj")
    assert set(here) == {"tall.obj", "cube.obj"} and here["cube.obj"] == CUBE


def test_what_is_nowhere_is_named_with_both_places(scene: Path) -> None:
    with pytest.raises(SceneRefused) as caught:
        bundle(scene, "tools.finger.path=other.obj")
    text = str(caught.value)
    assert text.startswith("--set tools.finger.path=other.obj: tools.finger.path: "), text
    assert f"{scene.parent / 'other.obj'} cannot be read: No such file or directory, nor is there other.obj" in text


@pytest.mark.kernels
def test_in_python_and_from_reset(scene: Path) -> None:
    with softseam.open(scene, settings=["body.shape.path=meshes/flat.obj"]) as sim:
        sim.reset()
        assert set(sim.bundle.files) == {"meshes/flat.obj", "finger.obj"}
        sim.reset(settings=["body.shape.path=tall.obj"])
        assert set(sim.bundle.files) == {"tall.obj", "finger.obj"}
        sim.step({})


@pytest.mark.kernels
def test_a_scene_made_in_code_reads_from_the_working_folder(scene: Path) -> None:
    made = Scene.model_validate_json(
        with_settings(bundle_of(scene)[0], ["body.shape.path=tall.obj", "tools.finger.path=tall.obj"]).model_dump_json()
    )
    with softseam.open(made, settings=["tools.finger.path=cube.dae"]) as sim:
        assert set(sim.bundle.files) == {"tall.obj", "cube.dae"}


def mesh_of(scene: Scene) -> MeshShape:
    assert isinstance(scene.body, BodySpec) and isinstance(scene.body.shape, MeshShape)
    return scene.body.shape


def test_unit_and_axis_are_those_of_the_file_that_a_setting_names(scene: Path) -> None:
    """Where the scene gives none: of an OBJ they are 1 and z, of a COLLADA file what it tells."""
    found = with_settings(bundle_of(scene)[0], ["body.shape.path=cube.dae"])
    shape = mesh_of(found)
    assert shape.scale is None and shape.up is None
    again = with_settings(with_settings(bundle_of(scene)[0], ["step=0.005"]), ["body.shape.path=cube.dae"])
    assert mesh_of(again) == shape
    for settings in (
        ["body.shape.path=cube.dae", "body.shape.scale=0.5"],
        ["body.shape.scale=0.5", "body.shape.path=cube.dae"],
    ):
        assert mesh_of(with_settings(bundle_of(scene)[0], settings)).scale == 0.5


@pytest.mark.kernels
def test_a_finger_in_another_unit_is_named_with_the_scale_that_would_do(scene: Path) -> None:
    loaded, given = bundle_of(scene)
    mm = ["tools.finger.path=mm.obj"]
    with pytest.raises(ToolError, match=r"tools\.finger\.scale: it is 50 m long, .* starts inside it; this looks like "
                                        r"millimetres: set scale: 0\.001, which makes it 50 mm long"):  # fmt: skip
        build_setup(bundle_with(with_settings(loaded, mm), given, scene))
    build_setup(
        bundle_with(
            with_settings(loaded, [*mm, "tools.finger.scale=0.001", "tools.finger.position=[0, 0, 0.08]"]), given, scene
        )
    )
    with pytest.raises(
        ToolError, match=r"tools\.finger\.scale: it is 0\.5 m long, 17 times the body.*unit of its file\?"
    ):
        build_setup(bundle_with(with_settings(loaded, [*mm, "tools.finger.scale=0.01"]), given, scene))
    with pytest.raises(ToolError, match=r"tools\.finger: it starts .* mm inside the body: move it clear"):
        build_setup(bundle_with(with_settings(loaded, ["tools.finger.position=[0, 0, 0.02]"]), given, scene))


@pytest.mark.kernels
def test_what_is_wrong_in_a_mesh_that_a_setting_names_is_told_with_the_setting(scene: Path) -> None:
    (scene.parent / "open.obj").write_bytes(CUBE.rpartition(b"f ")[0])
    with pytest.raises(
        SceneRefused, match=r"^--set tools\.finger\.path=open\.obj: tools\.finger\.path: open\.obj: 3 open edges"
    ):
        softseam.open(scene, settings=["tools.finger.path=open.obj"]).close()
