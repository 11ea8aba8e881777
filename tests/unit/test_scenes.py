"""The scenes that ship: each validates, builds, and says what its header says; meshes are what their script makes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from softseam.checks import doubts
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import load_scene, scene_from_bundle
from softseam_protocol.scene.particles import RopeBody, SheetBody, TetMeshBody
from softseam_services import checks
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.check import check_body
from softseam_services.body.particles import ParticleBody
from softseam_services.checks.seen import Cells
from softseam_services.server import build_setup
from softseam_services.tools.build import build_tools

SCENES = Path(__file__).parents[2] / "scenes"
CELLS = [
    "calamari",
    "cantilever",
    "dumpling",
    "gelatin",
    "heavy_on_soft",
    "sausage",
    "sausage_bend",
    "sausage_bent",
    "silken_tofu",
]
CELLS += [
    "stiff_inclusion",
    "tofu_drop",
    "tofu_grasp",
    "tofu_held",
    "tofu_pads",
    "tofu_push",
    "tofu_slab",
    "template_fem",
]
SEVERAL = {"cheese_in_tofu": 19, "dumplings": 12, "strawberries": 14, "tofu_tray": 28}
PARTICLES = ["cloth_fold", "jelly", "pudding", "rope", "template_pbd"]


def maker() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_meshes", SCENES / "make_meshes.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_scene_is_listed() -> None:
    assert sorted(path.stem for path in SCENES.glob("*.yaml")) == sorted([*CELLS, *PARTICLES, *SEVERAL])


@pytest.mark.kernels
@pytest.mark.parametrize("name", CELLS)
def test_scene_builds(name: str) -> None:
    loaded = load_scene(SCENES / f"{name}.yaml")
    scene = scene_from_bundle(loaded.bundle)
    assert scene.name == name
    body = build_body(scene, loaded.bundle.files)
    tools = build_tools(scene, body)
    check = check_body(body)
    assert isinstance(scene.body, BodySpec)
    of_body = [
        checks.CELLS[row].look(Cells(scene, scene.body, body, tools)) for row in ("cells", "materials", "inclusions")
    ]
    assert not any(map(list, of_body)) or name == "dumpling"
    more = sum(part.volume * (part.density - scene.body.material.density) for part in check.parts)
    assert check.mass == pytest.approx(scene.body.material.density * check.volume + more, rel=1e-12)
    assert tools.followed.any() == bool(scene.motion)


@pytest.mark.kernels
@pytest.mark.parametrize("name", PARTICLES)
def test_scene_of_particles_builds(name: str) -> None:
    """As heavy as its density says; the cloth case has the constraints that the textbook chapter asks for."""
    loaded = load_scene(SCENES / f"{name}.yaml")
    setup = build_setup(loaded.bundle)
    spec, body = setup.scene.body, setup.body
    assert isinstance(body, ParticleBody) and isinstance(spec, SheetBody | RopeBody | TetMeshBody)
    if isinstance(spec, TetMeshBody):
        corners = body.x_rest[body.skin.owner][body.skin.triangles]
        size = np.linalg.det(corners).sum() / 6.0  # what its boundary encloses
    else:
        size = np.prod(spec.own_lengths)
    assert body.total_mass == pytest.approx(spec.density * size, rel=1e-12)
    if name == "cloth_fold":
        assert len(body.springs.rest) == 10_100
        assert len(body.bends.stiffness) == 4_998 + 2_500


@pytest.mark.kernels
@pytest.mark.parametrize("name", SEVERAL)
def test_scene_of_several_builds(name: str) -> None:
    """Nothing in it is doubtful, and nothing is inside anything else."""
    loaded = load_scene(SCENES / f"{name}.yaml")
    assert len(loaded.scene.bodies) == SEVERAL[name]
    setups = {body: build_setup(loaded.bundle, body) for body in loaded.scene.bodies}
    assert not doubts(loaded.scene, {body: (checks.size_of(one), checks.doubts(one)) for body, one in setups.items()})


@pytest.mark.kernels
def test_tofu_settles_on_its_own_and_turns_near_as_plates_approach() -> None:
    """The reference wants plates clear of the cube at first; the switch wants them farther than `within`."""
    loaded = load_scene(SCENES / "tofu_grasp.yaml")
    scene = scene_from_bundle(loaded.bundle)
    body, near = build_body(scene, {}), scene.regions.near
    assert near is not None
    assert near.within is not None
    tools = build_tools(scene, body)
    for t in np.flatnonzero(tools.followed):
        clear = abs(tools.position[t, 0]) - tools.shape[t, 0] - 0.025
        assert near.within < clear < 0.016
        assert tools.position[t, 2] - tools.shape[t, 2] <= 0.0  # covers the lowest points, or they spread under it


@pytest.mark.kernels
def test_the_heavy_layer_and_the_stiff_core_are_where_their_headers_say() -> None:
    """A layer to the middle of the body, five times as heavy; a core of 32 octants, 4 % larger than its sphere."""
    (layer,) = check_body(_body("heavy_on_soft")).parts
    assert layer.volume == pytest.approx(0.06 * 0.04 * 0.02)
    (core,) = check_body(_body("stiff_inclusion")).parts
    assert core.octants == 32
    assert core.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.0125**3, rel=0.05)


def _body(name: str) -> Body:
    return build_body(scene_from_bundle(load_scene(SCENES / f"{name}.yaml").bundle), {})


def test_cantilever_is_half_near() -> None:
    scene = scene_from_bundle(load_scene(SCENES / "cantilever.yaml").bundle)
    body = build_body(scene, {})
    middles = body.x_rest[body.cell_nodes[:, 13]]
    assert scene.regions.near is not None
    (box,) = scene.regions.near.boxes
    assert ((middles >= box.min) & (middles <= box.max)).all(axis=1).sum() == body.n_cells // 2
    np.testing.assert_array_equal(body.fixed, body.x_rest[:, 0] == 0.0)


@pytest.mark.parametrize("name", ["sausage.obj", "dumpling.obj", "calamari.vtk", "pudding.vtk"])
def test_meshes_are_what_the_script_makes(name: str) -> None:
    """To the last digit written, 0.1 um, whose rounding may differ between mathematical libraries."""
    committed = (SCENES / name).read_text(encoding="ascii").splitlines()
    script = maker()
    made = (script.obj_text(name) if name.endswith(".obj") else script.vtk_text(name)).splitlines()
    assert len(made) == len(committed)
    for a, b in zip(made, committed, strict=True):
        if "." in a and a[0] in "v-0123456789":
            here, there = (np.array([float(word) for word in line.split() if word != "v"]) for line in (a, b))
            np.testing.assert_allclose(here, there, rtol=0, atol=1.01e-4)
        else:
            assert a == b
    assert (SCENES / name).stat().st_size < 100_000
