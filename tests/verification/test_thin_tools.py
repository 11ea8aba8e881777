"""Round and thin tools pressed into a block: found wherever they are set down, and as firm as they should be."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import solids

from softseam.claims.beside import reported, run_here
from softseam.claims.claim import Scale, claims
from softseam.claims.sibling import sibling_of
from softseam.embedded import EmbeddedBackend
from softseam.session import Session
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

PLACES = ((0.0, 0.0), (1.5e-3, 1e-3), (3.1e-3, 2.7e-3), (5e-3, 5e-3), (7.5e-3, 2.5e-3))
ROD = 0.784
"""force of a round rod of 10 mm, 5 mm deep in a bonded block, on 3 mm cells with points of an eighth [N]"""
BLADES = {1e-3: 0.53, 2e-3: 0.63, 3e-3: 0.70}
"""force of a box by its width [m], 1 mm deep across the block: 1/F falls by 1.22 to .76 from 5 to 15 mm with the
logarithm of the width, on cells of 6 and 10 mm, and so goes on [N]"""
PUNCH, ROUND = 5.81, 1.59
"""of a square punch 2 mm deep and a round one .8 mm deep, from cells refined evenly and graded [N]"""

WITHIN = 0.1
"""of a rod's force on default cells, wherever it is set down and however deep [1]"""
REST = 0.1
"""for which a tool is held [s]: by then forces are within 6e-5 of what they are after twice as long, by both models"""
THIRD = 0.04 / 3
"""edge of cells [m]"""
SQUARE_END, ROUND_END = 4.98, 0.117
"""of a square of 30 mm 1.5 mm deep, by a box on cells of a fourth, extrapolated; and of a cylinder of 6 mm .3 mm deep,
.875 times that of a square of its width, as it is for flat ends on a half-space [N]"""

BOTH = {"default": "pbd", "near": {"model": "fem", "boxes": [{"min": [-1, -1, -1], "max": [1e-6, 1, 1]}]}}
"""FEM on one half of a block, to x = 0"""
both = pytest.mark.parametrize("model", ["fem", "pbd"])


def pressed(scene: Scene, files: dict[str, bytes] | None = None) -> float:
    """Force on the tool of `scene_of` at its end [N]."""
    simulation = Simulation(Bundle(scene.model_dump_json(), files or {}), EmbeddedTransport())
    report = simulation.step()
    while not report.done:
        report = simulation.step()
    simulation.close()
    kind = scene.tools["tool"].kind
    assert kind not in ("capsule", "sphere") or report.penetration > 0.0  # edges may press beside a patch's middle
    assert report.penetration < (1.5e-3 if kind == "box" else 9e-4)
    return float(np.linalg.norm(report.wrench[0, :3]))


def scene_of(
    tool: dict[str, Any],
    depth: float,
    block: tuple[float, float, float],
    cell: float | None,
    young: float,
    poisson: float,
    model: str = "fem",
) -> Scene:
    """A tool that begins half a millimetre above a block bonded to the ground and ends so deep [m]."""
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "thin",
            "step": 0.01,
            "gravity": [0, 0, 0],
            "body": {
                "shape": {"kind": "block", "size": block},
                **({} if cell is None else {"cell": cell}),
                "material": {"young": young, "poisson": poisson, "density": 1000.0},
                "fixed": [{"min": [-1, -1, -1e-3], "max": [1, 1, 1e-3]}],
            },
            "tools": {"tool": tool},
            "motion": [{"tools": ["tool"], "move": [0, 0, -depth - 5e-4], "speed": 0.02}, {"hold": REST}],
            "regions": {"default": model} if model != "both" else BOTH,
        }
    )


@cache  # some places are asked for by several tests
def rod(
    place: tuple[float, float], cell: float | None, depth: float = 5e-3, kind: str = "capsule", model: str = "fem"
) -> float:
    """Force of the rod at a place on the block's face [m], with its axis upright."""
    tool: dict[str, Any] = {"kind": "capsule", "radius": 5e-3, "length": 0.04, "position": [*place, 0.0555]}
    if kind == "sphere":
        tool = {"kind": "sphere", "radius": 5e-3, "position": [*place, 0.0355]}
    files = {"ball.obj": solids.obj(*solids.sphere(5e-3, 4))}
    if kind == "mesh":
        tool = {"kind": "mesh", "path": "ball.obj", "position": [*place, 0.0355]}
    return pressed(scene_of(tool, depth, (0.06, 0.06, 0.03), cell, 20e3, 0.4, model), files)


@both
@pytest.mark.parametrize(("cell", "within"), [(0.01, 0.11), (0.006, 0.05)])
def test_a_rod_is_felt_alike_wherever_it_is_set_down(cell: float, within: float, model: str) -> None:
    """With nodes alone it was felt at two of these places on cells of 10 mm, and by a quarter."""
    for place in PLACES if cell == 0.01 else PLACES[3:]:
        assert rod(place, cell, model=model) == pytest.approx(ROD, rel=within)


@both
@pytest.mark.parametrize(
    ("place", "depth", "right"),
    [((2.5e-3, 2.5e-3), 2e-3, 0.208), ((4e-3, -7e-3), 3.2e-3, 0.409), ((0.0, 0.0), 5.5e-3, 0.872)],
)
def test_default_cells_are_as_short_as_a_narrow_tool_asks_for(
    place: tuple[float, float], depth: float, right: float, model: str
) -> None:
    """On cells of 10 mm, a third of the block's height, the first was 30 % too firm by FEM, 53 by XPBD. Right is what
    cells of 3.75 mm tell."""
    assert rod(place, None, depth, model=model) == pytest.approx(right, rel=WITHIN)


@both
@pytest.mark.parametrize(("radius", "depth"), [(0.02, 2e-3), (0.015, 1.5e-3), (0.03, 2e-3)])
def test_a_ball_on_a_node_presses_as_hertz_says(radius: float, depth: float, model: str) -> None:
    """Where a ball is felt most firmly; on a bonded layer, by Dimitriadis et al., Biophysical Journal 82 (2002)."""
    young, poisson, height = 1e5, 0.3, 0.06
    tool = {"kind": "sphere", "radius": radius, "position": [0, 0, height + radius + 5e-4]}
    force = pressed(scene_of(tool, depth, (0.12, 0.12, height), 0.01, young, poisson, model))
    hertz = 4.0 / 3.0 * young / (1.0 - poisson**2) * np.sqrt(radius) * depth**1.5
    alpha = -(1.2876 - 1.4678 * poisson + 1.3442 * poisson**2) / (1.0 - poisson)
    thin = np.sqrt(radius * depth) / height
    layer = 1.0 - 2.0 * alpha * thin / np.pi + (2.0 * alpha * thin / np.pi) ** 2
    assert force == pytest.approx(hertz * layer, rel=0.08)


@both
def test_at_any_depth_coarse_cells_tell_what_fine_ones_do(model: str) -> None:
    random = np.random.default_rng(7)
    for _ in range(2):
        place, depth = tuple(random.uniform(-0.018, 0.018, 2).tolist()), float(random.uniform(0.002, 0.006))
        coarse, fine = (rod(place, cell, depth, model=model) for cell in (0.01, 0.006))
        assert 0.92 < coarse / fine < 1.1


@pytest.mark.slow
@both
def test_a_rod_drawn_across_the_face_meets_no_steps(model: str) -> None:
    """Set down at six places from a row of nodes to half way to the next: force changes by little from each to the
    next, and from there on it is the same backwards."""
    forces = np.array([rod((x, 0.0), 0.01, model=model) for x in np.linspace(0.0, 0.005, 6)])
    assert np.ptp(forces) < 0.1 * ROD
    assert np.abs(np.diff(forces)).max() < 0.06 * ROD


@pytest.mark.slow
@both
def test_a_run_claims_what_its_rod_is_off(model: str) -> None:
    """At three places and depths on default cells every claim holds, and is no more than a fifth of the force."""
    random = np.random.default_rng(23)
    for _ in range(3):
        place, depth = tuple(random.uniform(-0.011, 0.011, 2).tolist()), float(random.uniform(0.0015, 0.005))
        force, claim = claimed(place, depth, model)
        assert 0.0 < claim < 0.2 * force
        assert abs(force - right_force(depth)) < claim


def claimed(place: tuple[float, float], depth: float, model: str) -> tuple[float, float]:
    """The rod's force, and what a run claims that it is off [N]."""
    tool = {"kind": "capsule", "radius": 5e-3, "length": 0.04, "position": [*place, 0.0555]}
    scene = scene_of(tool, depth, (0.06, 0.06, 0.03), None, 20e3, 0.4, model)
    bundle = bundle_scene(scene)
    with Session(scene, bundle, EmbeddedBackend(bundle)) as session:
        sibling = sibling_of(scene, session.reset().frames)
        report = reported(session)
    both = report["quantities"], run_here(bundle_scene(sibling.scene))["quantities"]
    found = claims(*both, Scale.of(scene, report, sibling.finer))["tool.force"]
    return report["quantities"]["tool.force"]["final"], float(found["absolute"] or 0.0)


def right_force(depth: float) -> float:
    """Of the rod [N], by a curve through what cells of 3 and 3.75 mm tell at 1 to 6 mm, which lie within 3 % of it
    (docs/decisions/43)."""
    d = 1e3 * depth
    return float(d**1.5 * (0.07328 + 0.000398 * d - 0.000268 * d**2))


@pytest.mark.slow
@both
def test_tools_of_one_outline_press_alike(model: str) -> None:
    """A rod's end, a ball and a mesh of it, as deep."""
    others = [rod(PLACES[2], 0.01, kind=kind, model=model) for kind in ("sphere", "mesh")]
    forces = [rod(PLACES[2], 0.01, model=model), *others]
    assert np.ptp(forces) < 0.03 * ROD


@both
@pytest.mark.parametrize(("cell", "within"), [(0.02, 0.08), (0.01, 0.04)])
def test_a_cube_as_a_mesh_presses_as_a_box(cell: float, within: float, model: str) -> None:
    """Once it was 5.12 and 3.65 N, where a box gave 6.04 and 5.79. With round edges both are up to 7 % too soft by FEM
    and 4 by XPBD on cells of 20 mm, two thirds of the cube's edge, of which the edges are rounded by 3 mm."""
    files = {"cube.obj": solids.obj(*solids.box((0.03, 0.03, 0.03)))}
    at = [0, 0, 0.0555]
    size = (0.08, 0.08, 0.04)
    punch = {"kind": "mesh", "path": "cube.obj", "position": at}
    mesh = pressed(scene_of(punch, 2e-3, size, cell, 50e3, 0.3, model), files)
    punch = {"kind": "box", "size": [0.03, 0.03, 0.03], "position": at}
    box = pressed(scene_of(punch, 2e-3, size, cell, 50e3, 0.3, model))
    assert mesh == pytest.approx(PUNCH, rel=within)
    assert mesh == pytest.approx(box, rel=0.08)


@pytest.mark.parametrize(
    ("cell", "model", "within"), [(0.02, "fem", 0.12), (0.12 / 9, "fem", 0.08), (0.12 / 9, "pbd", 0.06)]
)
def test_the_flat_end_of_a_cylinder(cell: float, model: str, within: float) -> None:
    """Its rim is round by .15 of a cell, and more than two cells go on its width: 10, 7 and 5 % too soft."""
    tool = {"kind": "cylinder", "radius": 0.015, "length": 0.02, "position": [0, 0, 0.0905]}
    force = pressed(scene_of(tool, 0.8e-3, (0.12, 0.12, 0.08), cell, 50e3, 0.3, model))
    assert force == pytest.approx(ROUND, rel=within)


@both
@pytest.mark.parametrize(("x", "turn"), [(0.0, 0.0), (THIRD / 4, 0.0), (0.0, 0.3)])
def test_a_flat_face_presses_by_what_it_covers(x: float, turn: float, model: str) -> None:
    """A square of 30 mm as a mesh, on cells of 13.3 mm in whose faces its edges are; with round edges up to 10 %
    too little by FEM, and 7 too much or too little by XPBD."""
    files = {"punch.obj": solids.obj(*solids.box((0.03, 0.03, 0.03)))}
    tool = {"kind": "mesh", "path": "punch.obj", "position": [x, x, 2 * THIRD + 0.0155], "rotation": [0, 0, turn]}
    force = pressed(scene_of(tool, 1.5e-3, (4 * THIRD, 4 * THIRD, 2 * THIRD), THIRD, 50e3, 0.3, model), files)
    assert force == pytest.approx(SQUARE_END, rel=0.11 if model == "fem" else 0.08)


FIRM = "half way between nodes a cell yields less than at them: 61 % too firm"


@pytest.mark.parametrize(
    ("x", "model"),
    [
        *((x, model) for x in (0.0, THIRD / 2) for model in ("fem", "pbd")),
        (THIRD / 4, "fem"),
        pytest.param(THIRD / 4, "pbd", marks=pytest.mark.xfail(reason=FIRM, strict=True)),
    ],
)
def test_an_end_of_half_a_cell(x: float, model: str) -> None:
    """A cylinder of 6 mm: in the middle of cells and faces and at corners 8 to 16 % too soft, between them 25 % too
    firm, for there a cell's functions yield less."""
    tool = {"kind": "cylinder", "radius": 3e-3, "length": 0.02, "position": [x, x, 2 * THIRD + 0.0105]}
    force = pressed(scene_of(tool, 3e-4, (4 * THIRD, 4 * THIRD, 2 * THIRD), THIRD, 50e3, 0.3, model))
    assert force == pytest.approx(ROUND_END, rel=0.28 if x == THIRD / 4 else 0.17)


@pytest.mark.parametrize("x", [0.0, 2.5e-3])
def test_a_rod_over_the_seam_of_two_models(x: float) -> None:
    """On it, and in the half cell beside it, whose nodes at the seam have their points on the other side: with nothing
    there it was felt with a half and an eighth."""
    assert rod((x, 0.0), 0.01, model="both") == pytest.approx(rod((x, 0.0), 0.01, model="pbd"), rel=0.06)


@pytest.mark.parametrize(
    ("cell", "width", "within"),
    [
        (0.02, 1e-3, 0.85),
        (0.01, 1e-3, 0.45),
        (0.01, 2e-3, 0.3),
        (0.01, 3e-3, 0.2),
        (0.006, 1e-3, 0.23),
        (0.006, 2e-3, 0.15),
        (0.006, 3e-3, 0.15),
    ],
)
def test_a_box_narrower_than_a_block_presses_as_a_blade(cell: float, width: float, within: float) -> None:
    """On cells of 20 mm, and of 10 at one place of three, too firmly: a cell has no waves as short as a blade. With
    patches looked at in nine places alone 1 mm was felt with 0 to .1 N."""
    for x in (0.0, 3.1e-3, 5e-3):
        tool = {"kind": "box", "size": [width, 0.08, 0.02], "position": [x, 0, 0.0405]}
        scene = scene_of(tool, 1e-3, (0.06, 0.06, 0.03), cell, 20e3, 0.4, "pbd")
        assert pressed(scene) == pytest.approx(BLADES[width], rel=within)
