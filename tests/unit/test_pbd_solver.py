"""The PBD solver keeps the participant's contract: tentative steps, snapshots, hand-over, fields, refusals."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from pbd_run import Floats, PbdRun, block_scene, cantilever

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Advanced
from softseam_protocol.wire.codec import decode, encode
from softseam_services.body.region import shared_nodes

pytestmark = pytest.mark.kernels

GROUND = {"kind": "plane", "point": (0.0, 0.0, 0.0), "normal": (0.0, 0.0, 1.0), "friction": 0.6}
PLATE = {"kind": "box", "size": (0.01, 0.06, 0.06), "friction": 0.6}


def _gripped() -> PbdRun:
    """The tofu cube on the ground, squeezed by about 8 %."""
    scene = block_scene(
        gravity=(0.0, 0.0, -9.81),
        tools={
            "ground": GROUND,
            "left": {**PLATE, "position": (-0.0305, 0.0, 0.025)},
            "right": {**PLATE, "position": (0.0305, 0.0, 0.025)},
        },
        moved=("left", "right"),
    )
    run = PbdRun(scene)
    run.velocity[1:, 0] = 0.02, -0.02
    run.run(0.125)
    return run


def _split(kind: str = "neo_hookean", dt: float = 0.005, pbd: Mapping[str, Any] | None = None) -> PbdRun:
    """The clamped 6/10 of a cantilever, with its seam."""
    scene = cantilever((0.2, 0.05, 0.05), (0.04, 0.025, 0.025), 1e5, 0.4, kind=kind, pbd=pbd)
    scene = scene.model_copy(update={"step": dt})
    whole = PbdRun(scene).body
    x = whole.x_rest[whole.cell_nodes].mean(axis=1)[:, 0]
    far, near = np.flatnonzero(x < 0.12).astype(np.int32), np.flatnonzero(x > 0.12).astype(np.int32)
    return PbdRun(scene, cells=far, seam=shared_nodes(whole, near, far))


def _bits(reply: Advanced) -> bytes:
    """Everything but the header and the wall time."""
    return encode(dataclasses.replace(reply, header=Header(SCHEMA_VERSION, "s", "", 0, 0, 0, 0.0), seconds=0.0))


def test_same_requests_same_bits() -> None:
    a, b = _gripped(), _gripped()
    assert [_bits(a.step()) for _ in range(3)] == [_bits(b.step()) for _ in range(3)]


def test_a_step_is_tentative_until_it_is_committed() -> None:
    run = _split()
    push = np.zeros((len(run.region.seam), 3))
    first = run.solver.advance(run.request(push))
    push[:, 2] = -0.01
    other = run.solver.advance(run.request(push, exchange=1))
    again = run.solver.advance(run.request(np.zeros_like(push), exchange=2))
    assert _bits(first) == _bits(again) != _bits(other)
    run.solver.commit()
    run.solver.commit()  # nothing tentative: nothing happens
    np.testing.assert_array_equal(run.x[run.region.seam], again.coupling.x)


def test_restored_runs_go_on_with_the_same_bits() -> None:
    run = _gripped()
    data, position = run.solver.snapshot(), run.position
    expected = [_bits(run.step()) for _ in range(5)]
    fresh = PbdRun(run.scene)
    fresh.solver.restore(data)
    fresh.position, fresh.velocity = position, run.velocity
    run.solver.restore(data)
    run.position = position
    assert [_bits(run.step()) for _ in range(5)] == expected
    assert [_bits(fresh.step()) for _ in range(5)] == expected


@pytest.mark.parametrize(
    ("damage", "text"),
    [
        (lambda data: b"", "not a snapshot"),
        (lambda data: b"x" + data[1:], "not a snapshot"),
        (lambda data: data[:-1], "configure the region"),
        (lambda data: data[:15] + (7).to_bytes(8, "little") + data[23:], "configure the region"),
    ],
)
def test_damaged_snapshots_are_refused_and_change_nothing(damage: Callable[[bytes], bytes], text: str) -> None:
    run = _gripped()
    data = run.solver.snapshot()
    with pytest.raises(ValueError, match=text):
        run.solver.restore(damage(data))
    assert run.solver.snapshot() == data


def test_hand_over_at_rest_is_no_jolt() -> None:
    """A body squeezed and at rest, rebuilt from positions, velocities and contact forces alone, stays put.

    Points on the bottom edges touch a plate and the ground, and a state names one tool a point: how much of their
    friction each tool carries is not known any more, but their sum is.
    """
    run = _gripped()
    run.velocity[:] = 0.0
    run.run(8.0)
    handed = run.handed()
    speed = np.abs(handed.v).max()
    assert speed < 1e-6
    rebuilt = PbdRun(run.scene, state=handed)
    rebuilt.position = run.position
    force, expected = rebuilt.step().wrench[:, :3], run.step().wrench[:, :3]
    np.testing.assert_allclose(force.sum(axis=0), expected.sum(axis=0), atol=3e-3)
    np.testing.assert_allclose(force[:, 2], expected[:, 2], atol=0.01)
    np.testing.assert_allclose(force[:, 0], expected[:, 0], atol=0.5)
    last = rebuilt.run(0.1)[-1]
    assert last.extras["n_contacts"] == run.step().extras["n_contacts"]
    np.testing.assert_allclose(rebuilt.x, handed.x, atol=5e-6)


def test_hand_over_with_one_tool_a_point_is_exact() -> None:
    """A block on a steep slope, held by friction: nothing moves by more than the rest of its own motion."""
    scene = block_scene(gravity=(4.0, 0.0, -8.96), tools={"ground": GROUND})
    run = PbdRun(scene)
    run.run(20.0)
    handed = run.handed()
    rebuilt = PbdRun(scene, state=handed)
    np.testing.assert_allclose(rebuilt.step().wrench, run.step().wrench, atol=1e-7)
    rebuilt.run(0.2)
    run.run(0.2)
    np.testing.assert_allclose(rebuilt.x, run.x, atol=1e-9)
    np.testing.assert_allclose(rebuilt.x, handed.x, atol=1e-7)


def test_hand_over_in_motion_goes_on() -> None:
    """A bent, swinging beam rebuilt in mid-swing keeps its course: within 0.1 % of the amplitude after 0.1 s."""
    run = PbdRun(cantilever((0.2, 0.05, 0.05), 0.05, 1e5, 0.4))
    run.run(0.12)
    rebuilt = PbdRun(run.scene, state=run.handed())
    run.run(0.1)
    rebuilt.run(0.1)
    amplitude = np.abs(run.x - run.body.x_rest).max()
    np.testing.assert_allclose(rebuilt.x, run.x, atol=1e-3 * amplitude)


@pytest.mark.parametrize("kind", ["neo_hookean", "linear"])
@pytest.mark.parametrize(("dt", "damping"), [(0.005, 0.0), (0.01, 0.0), (0.005, 0.005)])
def test_compliance_is_the_derivative_of_the_step(kind: str, dt: float, damping: float) -> None:
    """Against central differences of the real step in mid-swing, seam loaded; 5 % is what the coupling tolerates."""
    run = _split(kind, dt, {"damping": {"mass": 50.0 * damping, "stiffness": damping}})
    force = np.zeros((len(run.region.seam), 3))
    force[:, 2] = -0.5 / len(force)
    for _ in range(round(0.1 / dt)):
        run.step(force)
    compliance = run.solver.advance(run.request(force, compliance=True)).coupling.compliance
    n = force.size
    assert compliance.shape == (n, n)
    difference: Floats = np.zeros((n, n))
    for column in range(n):
        ends = []
        for sign in (1.0, -1.0):
            pushed = force.copy()
            pushed.reshape(-1)[column] += sign * 1e-6
            ends.append(run.solver.advance(run.request(pushed)).coupling.x.ravel())
        difference[:, column] = (ends[0] - ends[1]) / 2e-6
    assert np.linalg.norm(compliance - difference) < 0.05 * np.linalg.norm(difference)
    assert np.linalg.eigvalsh(compliance + compliance.T).min() > 0.0
    assert run.solver.advance(run.request(force)).coupling.compliance.shape == (0, 0)


def test_seam_work_and_balance() -> None:
    """Momentum: the seam force and the clamps are all that acts; energy: its work is what the body gains and loses."""
    run = _split()
    force = np.zeros((len(run.region.seam), 3))
    force[:, 2] = -0.2 / len(force)
    before = run.run(0.02)[-1]
    for _ in range(40):
        start = run.x[run.region.seam]
        after = run.step(force)
        np.testing.assert_allclose(
            after.coupling.work, np.sum(force * (after.coupling.x - start)), rtol=1e-9, atol=1e-15
        )
        rise = (after.kinetic + after.strain + after.gravity) - (before.kinetic + before.strain + before.gravity)
        # Implicit Euler dissipates, and only that; most of the little energy that is left while the load shakes it.
        energy = after.kinetic + after.strain
        assert -0.3 * energy < rise - after.coupling.work < 1e-3 * energy
        before = after


def test_fields_describe_the_last_step() -> None:
    run = _gripped()
    fields = run.fields()
    np.testing.assert_array_equal(fields.nodes, run.region.nodes)
    assert fields.cauchy.shape == (8, 8, 6)
    # Squeezed along x by 8 %: about -E 0.08 there, and symmetric about y = 0.
    assert -4000 < fields.cauchy[..., 0].mean() < -1000
    assert abs(fields.cauchy[..., 5].mean()) < 100
    np.testing.assert_array_equal(
        fields.point_x, fields.x[np.searchsorted(fields.nodes, run.region.nodes)][_surface(run)]
    )
    left, right = fields.contact_tool == 1, fields.contact_tool == 2
    assert left.sum() >= 25 and right.sum() >= 25
    assert fields.contact_force[left, 0].sum() > 0 > fields.contact_force[right, 0].sum()
    np.testing.assert_array_equal(fields.contact_force[fields.contact_tool < 0], 0.0)


def _surface(run: PbdRun) -> np.ndarray:
    """Nodes that carry the surface points of a block, in the order of the points."""
    model = run.solver.model
    return model.node


def test_cell_distance_and_bounds() -> None:
    run = _gripped()
    reply = run.step()
    x = run.x
    np.testing.assert_array_equal(reply.bounds, [x.min(axis=0), x.max(axis=0)])
    assert reply.cell_distance.shape == (8,)
    np.testing.assert_allclose(reply.cell_distance, 0.0, atol=2e-4)
    apart = PbdRun(block_scene(tools={"ground": GROUND})).step()
    assert np.isinf(apart.cell_distance).all()


@pytest.mark.parametrize("what", ["seam force", "dt", "tool"])
def test_requests_that_are_not_finite_are_answered_and_change_nothing(what: str) -> None:
    run = _split() if what != "tool" else _gripped()
    before = run.solver.snapshot()
    request = run.request(compliance=True)
    if what == "seam force":
        request.coupling_force[0, 0] = np.nan
    elif what == "dt":
        request = dataclasses.replace(request, dt=float("nan"))
    else:
        request.tools.position_next[0, 0] = np.inf
    reply = run.solver.advance(request)
    assert "not finite" in reply.why and not reply.coupling.compliance.size
    decode(encode(reply), Advanced)  # which refuses numbers that are not finite
    assert run.solver.snapshot() == before


def test_a_seam_that_yields_is_refused_by_name() -> None:
    run = _split()
    before = run.solver.snapshot()
    request = dataclasses.replace(run.request(compliance=True), coupling_target=run.x[run.region.seam])
    assert "coupling_target" in run.solver.advance(request).why
    assert run.solver.snapshot() == before


def test_a_force_beyond_all_reason_fails_with_a_remedy() -> None:
    run = _split()
    force = np.full((len(run.region.seam), 3), 1e200)
    reply = run.solver.advance(run.request(force))
    assert "fem" in reply.why
    assert np.isfinite(reply.coupling.x).all()
    assert run.solver.advance(run.request(np.zeros_like(force), exchange=1)).status == "converged"


def test_substeps_follow_the_scene_or_the_wave_speed() -> None:
    assert PbdRun(block_scene(pbd={"substeps": 7})).step().extras["iterations"] == 7
    assert PbdRun(block_scene(pbd={"substeps": 7, "sweeps": 2})).step().extras["iterations"] == 14
    coarse, fine = (PbdRun(block_scene(cell=cell)).solver.substeps for cell in (0.025, 0.0125))
    assert coarse < fine <= 2 * coarse + 1
    soft, stiff = (PbdRun(block_scene(young=young)).solver.substeps for young in (20e3, 2e6))
    assert 8 * soft <= stiff <= 10 * soft
