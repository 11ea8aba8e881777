"""What mirrors itself is solved on one side of its mirrors, and comes to what the whole comes to; until a tool goes its
own way."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, block, tofu
from numpy.typing import NDArray

from softseam.embedded import mirror_axes
from softseam_protocol.messages import Advanced, BodyState, Header
from softseam_protocol.scene import Scene
from softseam_services.body.mirrors import find_mirrors
from softseam_services.fem.state import FemState

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]

ALIKE = 1e-7
"""relative to their size, for what a Newton iteration to 1e-10 of a cell leaves"""
TO_EDGES = {"kind": "block", "size": (0.05, 0.05, 0.05), "grading": 3.0, "towards": ["left", "right"]}
TIPS = {"kind": "box", "size": (0.01, 0.024, 0.024), "friction": 0.6}
FINGERS = {
    "ground": {"kind": "plane", "friction": 0.4, "point": (0.3, -0.2, 0.0)},
    "left": {**TIPS, "position": (-0.0305, 0.0, 0.025)},
    "right": {**TIPS, "position": (0.0305, 0.0, 0.025)},
}
SPAN: list[dict[str, Any]] = [{"tools": ("left", "right"), "close": 0.02, "until": {"compression": 0.15}}]
BALL = {"ground": {"kind": "plane"}, "ball": {"kind": "sphere", "radius": 0.02, "position": (0.0, 0.0, 0.0705)}}
ROLLER = {"kind": "cylinder", "radius": 0.01, "length": 0.06, "axis": (0, 1, 0)}
ROLLERS = {
    "ground": {"kind": "plane"},
    "left": {**ROLLER, "position": (-0.0355, 0.0, 0.03)},
    "right": {**ROLLER, "position": (0.0355, 0.0, 0.03)},
}
DOWN: dict[str, Vector] = {"ball": (0.0, 0.0, -0.05)}
UP: dict[str, Vector] = {"left": (0.0, 0.0, 0.05), "right": (0.0, 0.0, 0.05)}


GRAIN = {"kind": "sphere", "radius": 1e-4}


def core(x: float) -> dict[str, Any]:
    """An inclusion of half the body's edges, its middle at this x [m]."""
    shape = {"kind": "box", "position": (x, 0.0, 0.025), "size": (0.025, 0.025, 0.025)}
    return {"shape": shape, "material": {"young": 2e5, "poisson": 0.4}}


def fine(scene: Scene, mirrored: bool, **fem: Any) -> Scene:
    """Solved to the last digits that mean something."""
    spec = scene.models.fem.model_copy(update={"tolerance": 1e-10, "iterations": 200, "mirrored": mirrored, **fem})
    return scene.model_copy(update={"models": scene.models.model_copy(update={"fem": spec})})


def runs(scene: Scene, **fem: Any) -> tuple[FemRun, FemRun]:
    """One that folds, and one that does not."""
    return FemRun(fine(scene, True, **fem)), FemRun(fine(scene, False, **fem))


def same(one: Floats, other: Floats, scale: float | None = None, most: float = ALIKE) -> None:
    size = float(np.abs(other).max()) if scale is None else scale
    np.testing.assert_allclose(one, other, rtol=0.0, atol=most * size)


def told_the_same(one: Advanced, other: Advanced, weight: float, size: float) -> None:
    """Forces are compared with a weight [N], energies and momenta with what it comes to over the body's size [m]."""
    same(one.wrench[:, :3], other.wrench[:, :3], weight)
    same(one.wrench[:, 3:], other.wrench[:, 3:], weight * size)
    for name in ("kinetic", "strain", "gravity", "tool_work"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=ALIKE * weight * size), name
    mass = weight / 9.81
    same(one.momentum, other.momentum, mass * 0.1)
    same(one.angular_momentum, other.angular_momentum, mass * 0.1 * size)
    same(one.bounds, other.bounds, size)
    same(one.cell_distance, other.cell_distance, size)
    assert one.penetration == pytest.approx(other.penetration, abs=ALIKE * size)
    assert one.slip == pytest.approx(other.slip, abs=ALIKE * size)
    assert one.n_contacts == other.n_contacts and one.n_crushed == other.n_crushed


def reads_the_same(one: FemRun, other: FemRun) -> None:
    header = Header(1, "test", "near", 0, one.n_steps, 0, 0.0)
    left, right = one.solver.fields(header, indicators=True), other.solver.fields(header, indicators=True)
    same(left.x, right.x, 0.05)
    same(left.v, right.v, 0.1)
    same(left.contact_force, right.contact_force, max(1e-3, float(np.abs(right.contact_force).max())), 1e-6)
    same(left.cauchy, right.cauchy, 1e4, 1e-6)
    same(left.cell_energy, right.cell_energy, most=1e-6)
    same(left.mesh_error, right.mesh_error, most=1e-5)
    loaded = np.linalg.norm(right.contact_force, axis=1) > 1e-6
    np.testing.assert_array_equal(left.contact_tool[loaded], right.contact_tool[loaded])


GRASPED: dict[str, dict[str, Any]] = {
    "hex27": {},
    "hex27_reduced": {"element": "hex27_reduced"},
    "hex8": {"element": "hex8"},
    "hex8_bbar": {"element": "hex8_bbar"},
    "midpoint": {"integrator": "midpoint"},
    "bdf2": {"integrator": "bdf2"},
    "generalised_alpha": {"integrator": "generalised_alpha"},
    "substeps": {"step_error": 3e-3},
}


@pytest.mark.parametrize("name", GRASPED)
def test_a_grasp_on_a_quarter_is_one_on_the_whole(name: str) -> None:
    folded, whole = runs(tofu(cell=0.025, step=0.01), **GRASPED[name])
    assert folded.solver.folded == 4 and whole.solver.folded == 1
    for velocities, steps in (({}, 3), (CLOSE, 12), (UP, 6), ({}, 2)):
        for _ in range(steps):
            told_the_same(folded.step(velocities), whole.step(velocities), 1.3, 0.05)
    assert folded.solver.folded == 4
    reads_the_same(folded, whole)


SCENES: dict[str, tuple[dict[str, Any], dict[str, Vector], int]] = {
    "fingertips": ({"tools": FINGERS, "motion": SPAN, "cell": (0.0125, 0.0125, 0.0166)}, CLOSE, 4),
    "to edges": ({"tools": FINGERS, "motion": SPAN, "cell": 0.0125, "body": {"shape": TO_EDGES}}, CLOSE, 4),
    "ball": ({"tools": BALL, "cell": 0.025}, DOWN, 4),
    "rollers": ({"tools": ROLLERS, "cell": (0.0125, 0.025, 0.0166)}, CLOSE, 4),
    "one mirror": ({"tools": ROLLERS, "cell": (0.0125, 0.05, 0.0166)}, CLOSE, 2),
    "small strain": ({"tools": FINGERS, "motion": SPAN, "cell": 0.025, "kind": "linear"}, CLOSE, 4),
    "inclusion": ({"tools": BALL, "cell": 0.0125, "body": {"inclusions": [core(0.0)]}}, DOWN, 4),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_other_bodies_and_tools(name: str) -> None:
    keys, velocities, times = SCENES[name]
    folded, whole = runs(block(gravity=(0, 0, -9.81), step=0.01, **keys))
    assert folded.solver.folded == times
    for _ in range(8):
        told_the_same(folded.step(velocities), whole.step(velocities), 1.3, 0.05)
    reads_the_same(folded, whole)


def test_a_body_without_weight_is_an_eighth() -> None:
    """Between fingertips that hit it from both sides at once."""
    tools = {name: tool for name, tool in FINGERS.items() if name != "ground"}
    folded, whole = runs(block(tools=tools, motion=SPAN, cell=0.025, gravity=(0, 0, 0), step=0.01))
    assert folded.solver.folded == 8
    for _ in range(8):
        told_the_same(folded.step(CLOSE), whole.step(CLOSE), 1.3, 0.05)
    reads_the_same(folded, whole)


def test_a_half_hangs_as_the_whole_does() -> None:
    """Clamped at one end, and in statics."""
    clamp = {"fixed": [{"min": (-1, -1, -1), "max": (-0.0499, 1, 1)}]}
    scene = block(size=(0.1, 0.02, 0.02), cell=(0.02, 0.01, 0.02), body=clamp, gravity=(0, 0, -9.81))
    folded, whole = runs(scene, integrator="static")
    assert folded.solver.folded == 2
    told_the_same(folded.step(), whole.step(), 0.4, 0.1)
    reads_the_same(folded, whole)


def test_tools_that_turn_against_each_other() -> None:
    """Mirror images turn the other way; two that turn alike are none."""
    for sign, times in ((-1.0, 4), (1.0, 2)):
        folded, whole = runs(block(tools=FINGERS, motion=SPAN, cell=0.025, gravity=(0, 0, -9.81), step=0.01))
        for run in (folded, whole):
            run.run(0.08, CLOSE)
        for angle in (0.05, 0.1, 0.15):
            turned = folded.orientation.copy()
            for tool, about in ((1, sign), (2, 1.0)):
                turned[tool] = np.cos(angle / 2), 0.0, about * np.sin(angle / 2), 0.0
            told_the_same(folded.step(turned=turned), whole.step(turned=turned), 1.3, 0.05)
        assert folded.solver.folded == (times if sign < 0.0 else 1)


def test_a_tool_that_goes_its_own_way_ends_it() -> None:
    """The whole goes on from where the part was, also in the middle of a step that is tried again."""
    folded, whole = runs(tofu(cell=0.025, step=0.01))
    for run in (folded, whole):
        run.run(0.1, CLOSE)
    assert folded.solver.folded == 4
    askew: dict[str, Vector] = {"left": (0.02, 0.01, 0.0), "right": (-0.02, 0.0, 0.0)}
    folded.solver.advance(folded.request(CLOSE))
    folded.solver.advance(folded.request(askew, exchange=1))
    for _ in range(6):
        told_the_same(folded.step(askew), whole.step(askew), 1.3, 0.05)
    assert folded.solver.folded == 1
    reads_the_same(folded, whole)


def test_a_state_put_back_goes_on_to_the_last_bit() -> None:
    """A snapshot of a part is one of the whole, and either folds it again; one of what is askew stays whole."""
    first = FemRun(fine(tofu(cell=0.025, step=0.01), True))
    first.run(0.15, CLOSE)
    taken = first.solver.snapshot()
    second = FemRun(fine(tofu(cell=0.025, step=0.01), True))
    second.solver.restore(taken)
    second.position, second.n_steps = first.position.copy(), first.n_steps
    assert first.solver.folded == second.solver.folded == 4
    for _ in range(5):
        one, other = first.step(UP), second.step(UP)
        np.testing.assert_array_equal(one.wrench, other.wrench)
    np.testing.assert_array_equal(first.x, second.x)
    third = FemRun(fine(tofu(cell=0.025, step=0.01), False))
    third.solver.restore(taken)
    np.testing.assert_array_equal(third.x, second.solver._unfolded(_restored(taken)).x)
    second.run(0.03, {"left": (0.0, 0.01, 0.0)})
    askew = second.solver.snapshot()
    first.solver.restore(askew)
    assert first.solver.folded == second.solver.folded == 1
    first.solver.restore(taken)
    assert first.solver.folded == 4


def _restored(taken: bytes) -> FemState:
    run = FemRun(fine(tofu(cell=0.025, step=0.01), True))
    run.solver.restore(taken)
    return run.solver._committed


def test_a_state_taken_over_folds_where_it_mirrors_itself() -> None:
    """As at a switch of regions: with the forces that act, and with a velocity that is askew."""
    run = FemRun(fine(tofu(cell=0.025, step=0.01), True))
    run.run(0.15, CLOSE)
    told = run.solver.fields(Header(1, "test", "near", 0, 0, 0, 0.0))
    state = BodyState(told.x, told.v, told.contact_force, told.contact_tool)
    folded, whole = (FemRun(fine(run.scene, mirrored), state=state) for mirrored in (True, False))
    assert folded.solver.folded == 4
    for other in (folded, whole):
        other.position = run.position.copy()
    for _ in range(5):
        told_the_same(folded.step(UP), whole.step(UP), 1.3, 0.05)
    askew = state.v.copy()
    askew[0, 1] += 1e-3
    assert (
        FemRun(run.scene, state=BodyState(state.x, askew, state.contact_force, state.contact_tool)).solver.folded == 1
    )


UNLIKE: dict[str, tuple[dict[str, Any], int]] = {
    "an odd number of cells": ({"cell": (0.05, 0.0166, 0.025)}, 1),
    "gravity across": ({"gravity": (1.0, 0.0, -9.81)}, 2),
    "a tool at one side": ({"tools": {"left": {**TIPS, "position": (-0.0305, 0.0, 0.025)}}}, 2),
    "fingers at two heights": ({"tools": {**FINGERS, "left": {**TIPS, "position": (-0.0305, 0.0, 0.03)}}}, 2),
    "unlike friction": ({"tools": {**FINGERS, "left": {**FINGERS["left"], "friction": 0.2}}}, 2),
    "a slope": ({"tools": {"ground": {"kind": "plane", "normal": (0.1, 0.0, 1.0), "point": (0, 0, -0.1)}}}, 2),
    "a clamped face": ({"body": {"fixed": [{"min": (-1, -1, -1), "max": (-0.024, 1, 1)}]}}, 2),
    "a spin": ({"body": {"spin": (0.0, 0.0, 1.0)}}, 1),
    "a throw": ({"body": {"velocity": (0.0, 1.0, 1.0)}}, 2),
    "an inclusion at one side": ({"cell": 0.0125, "body": {"inclusions": [core(0.0125)]}}, 2),
}  # fmt: skip


@pytest.mark.parametrize("name", UNLIKE)
def test_what_does_not_mirror_itself_is_left_whole(name: str) -> None:
    keys, times = UNLIKE[name]
    run = FemRun(block(**{"gravity": (0, 0, -9.81), "cell": 0.025, **keys}))
    assert run.solver.folded == times


@pytest.mark.parametrize("spec", [{"element": "tet10"}, {"integrator": "symplectic_euler"}, {"mirrored": False}])
def test_what_is_not_divided_alike_is_left_whole(spec: dict[str, Any]) -> None:
    """Nor what is asked to be, nor what solves no equations."""
    assert FemRun(block(cell=0.025, models={"fem": spec})).solver.folded == 1


FORESEEN: dict[str, tuple[dict[str, Any], tuple[int, ...]]] = {
    "fingers": ({"tools": FINGERS, "cell": (0.02, 0.05, 0.05)}, (0, 1)),
    "a mesh": ({"tools": {"wedge": {"kind": "mesh", "path": "wedge.obj", "position": (0.1, 0, 0)}}}, ()),
    "a grain": ({"body": {"inclusions": [{**core(0.0), "shape": {**GRAIN, "position": (0.006, 0.006, 0.006)}}]}}, ()),
    "not asked for": ({"models": {"fem": {"mirrored": False}}}, ()),
}


@pytest.mark.parametrize("name", FORESEEN)
def test_charts_and_plans_foresee_mirrors(name: str) -> None:
    """From the scene alone, whatever its cells, and without an error where eight cells do not do."""
    keys, axes = FORESEEN[name]
    assert mirror_axes(block(**{"gravity": (0, 0, -9.81), "cell": 0.025, **keys})) == axes


def test_a_part_of_a_body_is_not_folded() -> None:
    run = FemRun(block(cell=0.025, gravity=(0, 0, 0)), cells=lambda body: np.arange(4, dtype=np.int32))
    assert len(find_mirrors(run.body)) == 3 and run.solver.folded == 1


def test_mirrored_false_lets_a_column_buckle() -> None:
    """A column that is pressed gives way to a side where it may; folded it stays straight, as does the whole without a
    push. So `mirrored` is asked for where that is looked for."""
    plates = {
        "ground": {"kind": "plane", "friction": 2.0},
        "plate": {"kind": "box", "size": (0.1, 0.1, 0.01), "position": (0, 0, 0.1051), "friction": 2.0},
    }
    push: dict[str, Any] = {"body": {"velocity": (1e-3, 0.0, 0.0)}}
    press: dict[str, Vector] = {"plate": (0.0, 0.0, -0.1)}
    bent = []
    cases: tuple[tuple[dict[str, Any], bool], ...] = (({}, True), ({}, False), (push, False))
    for keys, mirrored in cases:
        scene = block(size=(0.01, 0.01, 0.1), cell=(0.005, 0.005, 0.01), tools=plates, step=0.01, **keys)
        run = FemRun(scene.model_copy(update={"models": fine(scene, mirrored).models}))
        run.run(0.3, press)
        bent.append(float(np.abs(run.x[:, 0].mean())))
    assert bent[0] < 1e-12 and bent[2] > 1e-3
