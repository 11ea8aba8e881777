"""Sheets and ropes in scenes: what is refused and where, what `check` tells, what tools may not do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from particle_run import ParticleRun, particle_scene

import softseam
from softseam.pictures import draw_pictures
from softseam.recording import Recording
from softseam.replay.verify import verify
from softseam.view.surface import DisplaySurface
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Bundle, Configure, Configured, Failure
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_protocol.scene.particles import SheetBody
from softseam_protocol.scene.scene import Scene
from softseam_services.body.errors import ToolError
from softseam_services.body.skin import rope_skin, sheet_skin
from softseam_services.body.surface_check import enclosed_volume
from softseam_services.pbd.particles.batches import batches
from softseam_services.server import ParticipantServer

SHEET = """softseam: 1
name: sheet
duration: 0.1
body:
  kind: sheet
  size: [0.2, 0.1]
  divisions: [20, 10]
  density: 0.2
  stretch: 100
"""
HAND = "tools: {hand: {kind: sphere, radius: 0.01, position: [0, 0, 0.1]}}\n"


def refusal(text: str) -> SceneError:
    with pytest.raises(SceneError) as caught:
        parse_scene(text)
    return caught.value


def test_a_sheet_is_read_and_cells_stay_the_default() -> None:
    assert isinstance(parse_scene(SHEET).body, SheetBody)
    cells = "{shape: {size: [1, 1, 1]}, material: {young: 1, poisson: 0, density: 1}}"
    text = "softseam: 1\nname: a\nduration: 1\nbody: " + cells
    assert isinstance(parse_scene(text.replace("size", "kind: block, size")).body, BodySpec)


@pytest.mark.parametrize(
    ("extra", "key", "words"),
    [
        ("regions: {default: fem}\n", "regions.default", "made of particles"),
        ("regions: {near: {model: fem, within: 0.01}}\n", "regions.near", "made of particles"),
        ("probes: {a: [0, 0, 0]}\n", "probes", "no stress"),
        ("quantities: [peak_von_mises]\n", "quantities.0", "peak_von_mises"),
        (HAND.replace("radius", "force_limit: 2, radius"), "tools.hand.force_limit", "need cells"),
    ],
)
def test_what_only_cells_can_do_is_refused_by_name(extra: str, key: str, words: str) -> None:
    error = refusal(SHEET + extra)
    assert error.key == key
    assert words in error.problem


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("kind: sheet", "kind: shet", "body.kind", "not known"),
        ("density", "densty", "body.densty", "unknown key"),
        ("[20, 10]", "[20, 4]", "body.divisions", "too unlike"),
        ("[20, 10]", "[2000, 1000]", "body.divisions", "fewer divisions"),
        ("[20, 10]", "[20, 13]\n  shear: 1000", "body.shear", "lattice of springs"),
        ("stretch: 100", "stretch: 100\n  thickness: 0.005", "body.thickness", "slip through"),
        ("[0.2, 0.1]", "[200, 100]", "body.size.0", "metres"),
    ],
)
def test_a_sheet_that_cannot_be_is_refused(old: str, new: str, key: str, words: str) -> None:
    error = refusal(SHEET.replace(old, new))
    assert error.key == key
    assert words in error.problem


def test_a_key_of_another_kind_is_no_key_that_is_meant() -> None:
    """What is allowed is what a sheet has."""
    error = refusal(SHEET.replace("stretch: 100", "stretch: 100\n  spin: [0, 0, 8]"))
    assert error.key == "body.spin" and error.problem == "unknown key" and error.nearest == ""
    assert "stretch" in error.allowed and "shape" not in error.allowed


BLOCK = """softseam: 1
name: block
duration: 1
body:
  kind: tet_mesh
  size: [0.05, 0.05, 0.1]
  divisions: [2, 2, 4]
  density: 1000
  young: 20.0e3
  poisson: 0.3
"""


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("  size: [0.05, 0.05, 0.1]\n", "", "body.kind", "`path`, a file of tetrahedra, or `size` and `divisions`"),
        ("  divisions: [2, 2, 4]\n", "", "body.kind", "`size` and `divisions`"),
        ("density", "path: a.vtk\n  density", "body.size", "leave out size, or path"),
        ("density", "scale: 0.001\n  density", "body.scale", "a block has no scale"),
        ("density", "up: x\n  density", "body.up", "a block has no up"),
        ("density", "part: a\n  density", "body.part", "a block has no part"),
        ("[2, 2, 4]", "[200, 200, 400]", "body.divisions", "fewer divisions"),
        ("0.1]", "1000]", "body.size.2", "metres"),
    ],
)
def test_a_block_of_tetrahedra_that_cannot_be_is_refused(old: str, new: str, key: str, words: str) -> None:
    error = refusal(BLOCK.replace(old, new))
    assert error.key == key
    assert words in error.problem


def test_what_came_later_is_said_only_where_a_scene_has_it() -> None:
    """The hashes of scenes that were there before hold: keys that nobody gave are not in their text."""
    file = BLOCK.replace("  size: [0.05, 0.05, 0.1]\n  divisions: [2, 2, 4]\n", "  path: a.vtk\n")
    older, block = (parse_scene(text).model_dump() for text in (file, BLOCK))
    assert not {"size", "divisions", "constraints"} & older["body"].keys()
    assert block["body"]["size"] == (0.05, 0.05, 0.1) and block["body"]["path"] is None
    assert "volume" not in older["models"]["pbd"]["classic"]
    assert parse_scene(SHEET).model_dump()["body"]["size"] == (0.2, 0.1)
    softer = parse_scene(BLOCK + "models: {pbd: {method: pbd, classic: {volume: 0.5}}}\n")
    assert softer.model_dump()["models"]["pbd"]["classic"]["volume"] == 0.5


def test_cells_are_not_gripped_and_have_no_classic_stiffness() -> None:
    text = (
        "softseam: 1\nname: a\nbody: {shape: {kind: block, size: [1, 1, 1]}, "
        "material: {young: 1, poisson: 0, density: 1}}\n"
    )
    assert "friction" in refusal(text + HAND + "motion: [{tools: [hand], grip: 0.1}]\n").problem
    assert "xpbd" in refusal(text + "duration: 1\nmodels: {pbd: {method: pbd}}\n").problem
    assert "only sheets" in refusal(text + "duration: 1\nquantities: [held]\n").problem


@pytest.mark.kernels
def test_a_participant_of_fem_refuses_a_sheet() -> None:
    scene = parse_scene(SHEET)
    header = Header(SCHEMA_VERSION, "s", "far", 0, 0, 0, 0.0)
    none = np.zeros(0, dtype=np.int32)
    reply = ParticipantServer().handle(Configure(header, Bundle(scene.model_dump_json(), {}), "fem", none, none))
    assert isinstance(reply, Failure)
    assert "only pbd can" in reply.message


@pytest.mark.kernels
def test_a_participant_tells_the_energies_that_a_sheet_begins_with() -> None:
    scene = parse_scene(SHEET + "  velocity: [0, 0, 0.3]\n")
    header = Header(SCHEMA_VERSION, "s", "far", 0, 0, 0, 0.0)
    none = np.zeros(0, dtype=np.int32)
    reply = ParticipantServer().handle(Configure(header, Bundle(scene.model_dump_json(), {}), "pbd", none, none))
    assert isinstance(reply, Configured)
    assert reply.kinetic == pytest.approx(0.5 * 0.2 * 0.2 * 0.1 * 0.3**2)
    assert reply.strain == pytest.approx(0.0, abs=1e-15) and reply.gravity == pytest.approx(0.0, abs=1e-15)


@pytest.mark.kernels
def test_tools_must_start_clear_of_particles() -> None:
    body = {"kind": "rope", "length": 1.0, "divisions": 10, "density": 0.1, "stretch": 10.0, "radius": 0.01}
    tools: dict[str, Any] = {"ball": {"kind": "sphere", "radius": 0.1, "position": (0.0, 0.0, 0.105)}}
    with pytest.raises(ToolError, match=r"tools\.ball: it starts 5 mm inside the rope"):
        ParticleRun(particle_scene(body, tools=tools))
    tools["ball"]["position"] = (0.0, 0.0, 0.11)
    ParticleRun(particle_scene(body, tools=tools))


@pytest.mark.kernels
def test_skins_are_closed() -> None:
    """A sheet's encloses area times thickness, a rope's the prism of its ring; both for any turn of the body."""
    x = np.stack(np.meshgrid(np.linspace(0, 0.2, 5), np.linspace(0, 0.1, 4), [0.0]), axis=-1).reshape(-1, 3)
    skin = sheet_skin(4, 3, 0.01)
    assert enclosed_volume(skin.points(x), skin.triangles) == pytest.approx(0.2 * 0.1 * 0.02)
    line = np.outer(np.linspace(0.0, 1.0, 9), [2.0, 1.0, -2.0])
    skin = rope_skin(9, 0.1)
    hexagon = 1.5 * np.sqrt(3.0) * 0.1**2
    assert enclosed_volume(skin.points(line), skin.triangles) == pytest.approx(3.0 * hexagon)
    assert skin.share.sum() == pytest.approx(9.0)


@pytest.mark.kernels
def test_batches_share_no_particle_and_leave_nothing_out() -> None:
    rng = np.random.default_rng(2)
    nodes = np.array([rng.choice(50, 3, replace=False) for _ in range(300)], dtype=np.int32)
    made = batches(50, nodes, tile=64)
    real = made.row >= 0
    assert sorted(made.row[real]) == list(range(300))
    for ids in made.nodes:
        assert len(np.unique(ids)) == 3 * 8 if (ids < 50).all() else True
        owned = ids[:, (ids < 50).all(axis=0)].ravel()
        assert len(np.unique(owned)) == len(owned)
    values = rng.normal(size=(300, 2))
    assert np.array_equal(made.back(made.lanes(values)), values)


@pytest.mark.kernels
def test_automatic_substeps_keep_a_hanging_sheet_short() -> None:
    """What the rule promises: unfinished sweeps stretch a sheet that hangs by an edge by no more than 0.5 %."""
    body = {
        "kind": "sheet",
        "size": (0.1, 0.2),
        "divisions": (10, 20),
        "density": 0.2,
        "stretch": 1e5,
        "rotation": (np.pi / 2, 0.0, 0.0),
        "damping": 20.0,
        "self_contact": False,
        "fixed": [{"min": (-1.0, -1.0, 0.1), "max": (1.0, 1.0, 1.0)}],
    }
    run = ParticleRun(particle_scene(body, gravity=(0.0, 0.0, -9.81)))
    assert 0.0005 < run.run(0.5).extras["worst_stretch"] < 0.005


def test_the_scene_of_a_run_is_itself_again() -> None:
    scene = parse_scene(SHEET)
    assert Scene.model_validate_json(scene.model_dump_json()) == scene


FOLD = """
softseam: 1
name: fold
body: {kind: sheet, size: [0.2, 0.1], divisions: [20, 10], density: 0.3, stretch: 500, position: [0, 0, 0.004]}
tools:
  ground: {kind: plane, friction: 0.5}
  hand: {kind: box, size: [0.01, 0.08, 0.006], position: [0.11, 0, 0.005]}
motion:
  - {tools: [hand], grip: 0.02}
  - {tools: [hand], turn: [0, -1.0, 0], speed: 7.0, about: [0, 0, 0.01]}
  - {tools: [hand], release: 0.02}
quantities: [held, worst_stretch]
"""


@pytest.mark.kernels
@pytest.mark.slow
def test_a_fold_is_recorded_drawn_and_simulated_again(tmp_path: Path) -> None:
    """Grips are in the recording: the same steps come out, bit for bit; pictures show the stretch."""
    path = tmp_path / "fold.mcap"
    with softseam.open(parse_scene(FOLD), record=path) as session:
        session.reset()
        held = [session.step().quantities["held"] for _ in range(15)]
    assert held[0] > 0.0 and held[-1] > 0.0
    recording = Recording(path)
    found = verify(recording)
    assert found.same and found.steps == 15, found.text
    assert recording.surfaces
    surface = DisplaySurface(recording.surfaces["body"])
    loads = [surface.load(frame) for frame in recording.frames()]
    assert surface.load_label == "stretch [%]"
    assert loads[0].shape == (2 * 21 * 11,) and loads[-1].max() > 1e-4
    assert len(draw_pictures(recording, tmp_path)) == 3


@pytest.mark.kernels
def test_a_client_grips_by_a_seventh_number() -> None:
    """And a saved state remembers: what goes on from it holds on."""
    with softseam.open(parse_scene(FOLD)) as session:
        session.reset()
        assert session.step({"hand": [0, 0, 0.1]}).quantities["held"] == 0.0
        assert session.step({"hand": [0, 0, 0.1, 0, 0, 0, 1]}).quantities["held"] > 0.0
        taken = session.snapshot()
        assert session.step({"hand": [0, 0, 0.1]}).quantities["held"] > 0.0
        assert session.step({"hand": [0, 0, 0.1, 0, 0, 0, 0]}).quantities["held"] == 0.0
        session.restore(taken)
        assert session.step({"hand": [0, 0, 0.1]}).quantities["held"] > 0.0
