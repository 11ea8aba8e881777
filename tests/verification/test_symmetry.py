"""A scene that says where it is symmetric is solved on one side, and comes to what the whole comes to."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, block, tofu
from numpy.typing import NDArray
from symmetric import FINGERS, SPAN, core, fine

from softseam.scenes import load_scene
from softseam.session import open_as_given
from softseam.variants import with_model, with_settings
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Figure
from softseam_protocol.messages.participant import Advanced, BodyState
from softseam_protocol.scene.scene import Scene
from softseam_services.body.errors import SettingError
from softseam_studies.study.configurations import configurations
from softseam_studies.study.frame import frame_of

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]

ALIKE = 1e-7
"""relative to their size, for what a Newton iteration to 1e-10 of a cell leaves"""
TO_EDGES = {"kind": "block", "size": (0.05, 0.05, 0.05), "grading": 3.0, "towards": ["left", "right"]}
BALL = {"ground": {"kind": "plane"}, "ball": {"kind": "sphere", "radius": 0.02, "position": (0.0, 0.0, 0.0705)}}
ROLLER = {"kind": "cylinder", "radius": 0.01, "length": 0.06, "axis": (0, 1, 0)}
ROLLERS = {
    "ground": {"kind": "plane"},
    "left": {**ROLLER, "position": (-0.0355, 0.0, 0.03)},
    "right": {**ROLLER, "position": (0.0355, 0.0, 0.03)},
}
DOWN: dict[str, Vector] = {"ball": (0.0, 0.0, -0.05)}
UP: dict[str, Vector] = {"left": (0.0, 0.0, 0.05), "right": (0.0, 0.0, 0.05)}


BESIDE = {"ground": {"kind": "plane"}, "ball": {"kind": "sphere", "radius": 0.02, "position": (0.3, 0.0, 0.0705)}}


def runs(scene: Scene, symmetry: str, **fem: Any) -> tuple[FemRun, FemRun]:
    """One that is reduced, and one of the whole."""
    reduced, whole = FemRun(fine(scene, symmetry, **fem)), FemRun(fine(scene, **fem))
    assert reduced.solver.times == 2 ** len(symmetry) and whole.solver.times == 1
    return reduced, whole


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
    assert one.extras["penetration"] == pytest.approx(other.extras["penetration"], abs=ALIKE * size)
    assert one.extras["slip"] == pytest.approx(other.extras["slip"], abs=ALIKE * size)
    assert one.extras["n_contacts"] == other.extras["n_contacts"]
    assert one.figure(Figure.BLENDED) == other.figure(Figure.BLENDED)


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
    reduced, whole = runs(tofu(cell=0.025, step=0.01), "xy", **GRASPED[name])
    for velocities, steps in (({}, 3), (CLOSE, 12), (UP, 6), ({}, 2)):
        for _ in range(steps):
            told_the_same(reduced.step(velocities), whole.step(velocities), 1.3, 0.05)
    reads_the_same(reduced, whole)


SCENES: dict[str, tuple[dict[str, Any], dict[str, Vector], str]] = {
    "fingertips": ({"tools": FINGERS, "motion": SPAN, "cell": (0.0125, 0.0125, 0.0166)}, CLOSE, "xy"),
    "to edges": ({"tools": FINGERS, "motion": SPAN, "cell": 0.0125, "body": {"shape": TO_EDGES}}, CLOSE, "xy"),
    "aside": ({"tools": BESIDE, "cell": 0.025, "body": {"position": (0.3, 0.0, 0.0)}}, DOWN, "xy"),
    "ball": ({"tools": BALL, "cell": 0.025}, DOWN, "xy"),
    "rollers": ({"tools": ROLLERS, "cell": (0.0125, 0.025, 0.0166)}, CLOSE, "yx"),
    "one plane": ({"tools": ROLLERS, "cell": (0.0125, 0.05, 0.0166)}, CLOSE, "x"),
    "one of two": ({"tools": BALL, "cell": 0.025}, DOWN, "y"),
    "small strain": ({"tools": FINGERS, "motion": SPAN, "cell": 0.025, "kind": "linear"}, CLOSE, "xy"),
    "inclusion": ({"tools": BALL, "cell": 0.0125, "body": {"inclusions": [core(0.0)]}}, DOWN, "xy"),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_other_bodies_and_tools(name: str) -> None:
    keys, velocities, symmetry = SCENES[name]
    reduced, whole = runs(block(gravity=(0, 0, -9.81), step=0.01, **keys), symmetry)
    for _ in range(8):
        told_the_same(reduced.step(velocities), whole.step(velocities), 1.3, 0.05)
    reads_the_same(reduced, whole)


def test_a_body_without_weight_is_an_eighth() -> None:
    """Between fingertips that hit it from both sides at once."""
    tools = {name: tool for name, tool in FINGERS.items() if name != "ground"}
    reduced, whole = runs(block(tools=tools, motion=SPAN, cell=0.025, gravity=(0, 0, 0), step=0.01), "xyz")
    for _ in range(8):
        told_the_same(reduced.step(CLOSE), whole.step(CLOSE), 1.3, 0.05)
    reads_the_same(reduced, whole)


def test_a_half_hangs_as_the_whole_does() -> None:
    """Clamped at one end, and in statics."""
    clamp = {"fixed": [{"min": (-1, -1, -1), "max": (-0.0499, 1, 1)}]}
    scene = block(size=(0.1, 0.02, 0.02), cell=(0.02, 0.01, 0.02), body=clamp, gravity=(0, 0, -9.81))
    reduced, whole = runs(scene, "y", integrator="static")
    told_the_same(reduced.step(), whole.step(), 0.4, 0.1)
    reads_the_same(reduced, whole)


SHIPPED: dict[str, tuple[str, tuple[str, ...], int]] = {
    "tofu_grasp": ("y", ("body.cell=[0.025, 0.025, 0.025]",), 60),
    "tofu_pads": ("xy", ("body.cell=[0.0125, 0.025, 0.025]",), 60),
    "tofu_slab": ("y", ("body.cell=[0.03, 0.04, 0.03]",), 40),
    "cantilever": ("y", (), 60),
}


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_scenes_come_to_the_same(name: str) -> None:
    """To 1e-9 of the largest, by all that a run tells: FEM alone, through contact.

    Other cells of tofu_slab may differ more: where a tool's edge lies in the middle between points, rounding decides
    which of them stick, and the whole leaves its own symmetry.
    """
    axes, settings, n_steps = SHIPPED[name]
    scene = with_settings(with_model(load_scene(name), "fem"), (*settings, "models.fem.tolerance=1e-12"))
    told = []
    for symmetry in ((), tuple(axes)):
        with open_as_given(scene.model_copy(update={"symmetry": symmetry})) as session:
            session.reset()
            seen = [session.step() for _ in range(n_steps)]
        told.append(
            (
                np.array([[*each.quantities.values()] for each in seen]),
                np.array([np.ravel([*each.wrench.values()]) for each in seen]),
                np.array([each.positions.ravel() for each in seen]),
            )
        )
    quantities, wrenches, places = zip(*told, strict=True)
    assert (np.abs(quantities[1] - quantities[0]) <= 1e-9 * np.abs(quantities[0]).max(axis=0)).all()
    for one, other in (wrenches, places):
        assert np.abs(other - one).max(initial=0.0) <= 1e-9 * np.abs(one).max(initial=1e-300)


def test_tools_that_turn_against_each_other() -> None:
    """Images turn the other way; a step in which two turn alike is refused, and the state stays."""
    for sign in (-1.0, 1.0):
        symmetry = "xy" if sign < 0.0 else "y"
        reduced, whole = runs(block(tools=FINGERS, motion=SPAN, cell=0.025, gravity=(0, 0, -9.81), step=0.01), symmetry)
        for run in (reduced, whole):
            run.run(0.08, CLOSE)
        for angle in (0.05, 0.1, 0.15):
            turned = reduced.orientation.copy()
            for tool, about in ((1, sign), (2, 1.0)):
                turned[tool] = np.cos(angle / 2), 0.0, about * np.sin(angle / 2), 0.0
            told_the_same(reduced.step(turned=turned), whole.step(turned=turned), 1.3, 0.05)


def test_a_step_in_which_a_tool_leaves_the_symmetry_is_refused() -> None:
    """With the tool and the axis; the step can be taken again with tools that keep it."""
    reduced, whole = runs(tofu(cell=0.025, step=0.01), "xy")
    for run in (reduced, whole):
        run.run(0.1, CLOSE)
    askew: dict[str, Vector] = {"left": (0.02, 0.01, 0.0), "right": (-0.02, 0.0, 0.0)}
    for velocities, said in (
        (askew, "tool 'left' is no image of 'right'"),
        ({"ground": (0, 0.01, 0)}, "leaves the pl"),
    ):
        with pytest.raises(SettingError, match=f"{said}.* out of `symmetry`"):
            reduced.solver.advance(reduced.request(velocities))
    for _ in range(3):
        told_the_same(reduced.step(CLOSE), whole.step(CLOSE), 1.3, 0.05)


def test_a_state_put_back_goes_on_to_the_last_bit() -> None:
    """A snapshot of a part is one of the whole, also for a solver of the whole."""
    scene = block(tools=BESIDE, cell=0.025, step=0.01, gravity=(0, 0, -9.81), body={"position": (0.3, 0.0, 0.0)})
    first = FemRun(fine(scene, "xy", integrator="bdf2"))
    first.run(0.15, DOWN)
    taken = first.solver.snapshot()
    second, third = FemRun(fine(scene, "xy", integrator="bdf2")), FemRun(fine(scene, integrator="bdf2"))
    for other in (second, third):
        other.solver.restore(taken)
        other.position, other.n_steps = first.position.copy(), first.n_steps
    np.testing.assert_array_equal(second.x, first.x)
    np.testing.assert_allclose(third.x, first.x, rtol=0.0, atol=1e-15)
    for _ in range(5):
        one, two, whole = first.step(DOWN), second.step(DOWN), third.step(DOWN)
        np.testing.assert_array_equal(one.wrench, two.wrench)
        told_the_same(one, whole, 1.3, 0.05)
    np.testing.assert_array_equal(first.x, second.x)


def test_snapshots_do_not_add_up() -> None:
    """A beam that swings, in short steps of bdf2: what is on rollers stays there, however often a snapshot is taken."""
    settings = ("models.fem.integrator=bdf2", "step=3.125e-5")
    reduced, whole = runs(with_settings(with_model(load_scene("cantilever"), "fem"), settings), "y", integrator="bdf2")
    for step in range(640):
        one, other = reduced.step(), whole.step()
        if step % 32 == 31:
            reduced.solver.snapshot()
            whole.solver.snapshot()
    assert one.kinetic == pytest.approx(other.kinetic, rel=1e-6)


def test_a_state_that_is_taken_over_keeps_its_momentum() -> None:
    """As at a switch of regions, from a model whose sweeps are not symmetric: its mean image goes on."""
    run = FemRun(fine(tofu(cell=0.025, step=0.01), "xy"))
    run.run(0.15, CLOSE)
    told = run.solver.fields(Header(1, "test", "near", 0, 0, 0, 0.0))
    state = BodyState(told.x, told.v, told.contact_force, told.contact_tool)
    reduced, whole = (FemRun(fine(run.scene, symmetry), state=state) for symmetry in ("xy", ""))
    for other in (reduced, whole):
        other.position = run.position.copy()
    for _ in range(5):
        told_the_same(reduced.step(UP), whole.step(UP), 1.3, 0.05)
    noise = np.random.default_rng(5).standard_normal((2, *state.v.shape))
    x, v = state.x + 1e-5 * noise[0], state.v + 1e-3 * noise[1]
    other = FemRun(fine(run.scene, "xy"), state=BodyState(x, v, state.contact_force, state.contact_tool))
    found, mass = other.solver.state, run.solver.tables.whole.parameters.mass
    assert mass @ found.v[:, 2] == pytest.approx(mass @ v[:, 2], rel=1e-12)
    assert abs(mass @ found.v[:, 0]) < 1e-12 and abs(mass @ found.v[:, 1]) < 1e-12
    assert mass @ found.x[:, 2] == pytest.approx(mass @ x[:, 2], rel=1e-12)


def test_a_part_of_a_body_is_solved_whole() -> None:
    run = FemRun(fine(block(cell=0.025, gravity=(0, 0, 0)), "xyz"), cells=lambda body: np.arange(4, dtype=np.int32))
    assert run.solver.times == 1


def test_charts_keep_the_symmetry_that_cells_have() -> None:
    """Of FEM alone where an even number of cells lies along an axis; other models solve for all."""
    name = "tofu_pads"
    settings = ("symmetry=[x, y]",)
    frame = frame_of(with_settings(load_scene(name), settings), name, settings)
    assert frame.mirrors == (0, 1) and frame.n_solved((4, 4, 4)) == 16 and frame.n_solved((4, 3, 3)) == 18
    tried = configurations(frame)
    for one in tried:
        scene = with_settings(frame.scene, one.settings)
        if one.method in ("XPBD", "hybrid"):
            assert scene.symmetry == ()
        if one.fem is not None:
            counts, tets = one.fem.counts, one.fem.element.startswith("tet")
            assert scene.symmetry == tuple(
                axis for axis, n in zip("xy", counts, strict=False) if n % 2 == 0 and not tets
            )
            assert ("of it solved for" in one.label) is bool(scene.symmetry)
    assert any(with_settings(frame.scene, one.settings).symmetry == ("x", "y") for one in tried)


def test_a_column_buckles_unless_it_is_said_to_be_symmetric() -> None:
    """A column that is pressed gives way to a side where it may; said to be symmetric it stays straight, as does the
    whole without a push. So `symmetry` is left out where that is looked for."""
    plates = {
        "ground": {"kind": "plane", "friction": 2.0},
        "plate": {"kind": "box", "size": (0.1, 0.1, 0.01), "position": (0, 0, 0.1051), "friction": 2.0},
    }
    push: dict[str, Any] = {"body": {"velocity": (1e-3, 0.0, 0.0)}}
    press: dict[str, Vector] = {"plate": (0.0, 0.0, -0.1)}
    bent = []
    cases: tuple[tuple[dict[str, Any], str], ...] = (({}, "xy"), ({}, ""), (push, ""))
    for keys, symmetry in cases:
        scene = block(size=(0.01, 0.01, 0.1), cell=(0.005, 0.005, 0.01), tools=plates, step=0.01, **keys)
        run = FemRun(scene.model_copy(update={"models": fine(scene).models, "symmetry": tuple(symmetry)}))
        run.run(0.3, press)
        bent.append(float(np.abs(run.x[:, 0].mean())))
    assert bent[0] < 1e-12 and bent[2] > 1e-3
