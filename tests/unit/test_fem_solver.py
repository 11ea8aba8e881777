"""The FEM solver as a participant: exchanges, snapshots, compliance, failures."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, block, tofu
from numpy.typing import NDArray

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import Advance, BodyState
from softseam_services.body.body import Body
from softseam_services.body.region import shared_nodes

pytestmark = pytest.mark.kernels


def _ends(body: Body) -> NDArray[np.int32]:
    return np.flatnonzero(body.cell_grid[:, 0] != 1).astype(np.int32)


def _seam(body: Body, cells: NDArray[np.int32]) -> NDArray[np.int32]:
    return shared_nodes(body, cells, np.setdiff1d(np.arange(body.n_cells), cells).astype(np.int32))


def _grip(**keys: Any) -> FemRun:
    """Two columns of a cube between plates, held by the seam to where they were: 0.1 s of a squeeze."""
    run = FemRun(tofu(cell=(0.05 / 3, 0.025, 0.025)), cells=_ends, seam=_seam, **keys)
    for _ in range(20):
        run.step(CLOSE)
    return run


@pytest.fixture(scope="module")
def gripped() -> tuple[FemRun, bytes]:
    run = _grip()
    return run, run.solver.snapshot()


@pytest.fixture
def grip(gripped: tuple[FemRun, bytes]) -> FemRun:
    run, state = gripped
    run.solver.restore(state)
    return run


def test_requests_give_the_same_bits(grip: FemRun) -> None:
    """Twice the same steps from the same snapshot: equal to the last bit, contact and friction included."""
    state = grip.solver.snapshot()
    force = np.random.default_rng(0).standard_normal((len(grip.region.seam), 3)) * 1e-3
    replies = []
    for _ in range(2):
        grip.solver.restore(state)
        steps = [grip.solver.advance(_numbered(grip, force, n)) for n in range(5)]
        replies.append([(r.coupling.x.tobytes(), r.wrench.tobytes(), r.kinetic) for r in steps])
    assert replies[0] == replies[1]


def _numbered(run: FemRun, force: NDArray[np.float64], n: int, exchange: int = 0) -> Advance:
    request = run.request(force=force, exchange=exchange)
    return dataclasses.replace(request, header=dataclasses.replace(request.header, step=100 + n, exchange=exchange))


def test_a_run_goes_on_alike_after_snapshot_and_restore(grip: FemRun) -> None:
    """One run takes a snapshot and goes on; another solver restores it: bit for bit the same from there."""
    for _ in range(3):
        grip.step(CLOSE)
    state = grip.solver.snapshot()
    other = FemRun(grip.scene, cells=_ends, seam=_seam)
    other.solver.restore(state)
    other.position, other.n_steps = grip.position, grip.n_steps
    for _ in range(5):
        mine, theirs = grip.step(CLOSE), other.step(CLOSE)
        assert mine.coupling.x.tobytes() == theirs.coupling.x.tobytes()
        assert mine.wrench.tobytes() == theirs.wrench.tobytes()
    assert grip.solver.snapshot() == other.solver.snapshot()


def test_a_higher_exchange_starts_from_the_committed_state(grip: FemRun) -> None:
    """The third exchange with the first one's force ends where the first did, to the solver's tolerance."""
    zero = np.zeros((len(grip.region.seam), 3))
    force = np.random.default_rng(0).standard_normal(zero.shape) * 1e-2
    first = grip.solver.advance(_numbered(grip, zero, 0))
    second = grip.solver.advance(_numbered(grip, force, 0, 1))
    third = grip.solver.advance(_numbered(grip, zero, 0, 2))
    assert np.abs(second.coupling.x - first.coupling.x).max() > 1e-6
    np.testing.assert_allclose(third.coupling.x, first.coupling.x, atol=1e-8)
    later = grip.solver.advance(_numbered(grip, zero, 1))
    assert np.abs(later.coupling.x - third.coupling.x).max() > 1e-6


@pytest.mark.parametrize(("friction", "tolerance"), [(5.0, 1e-3), (0.0, 1e-3), (0.6, 0.2)])
def test_compliance_is_the_derivative_of_the_seam(friction: float, tolerance: float) -> None:
    """Central differences through whole steps, in contact: exact where points stick or slide freely.

    With points that slip against friction, the change of the friction's bound with the pressure is left out.
    """
    run = FemRun(tofu(cell=(0.05 / 3, 0.025, 0.025), friction=friction), cells=_ends, seam=_seam)
    for _ in range(8):
        run.step(CLOSE)
    zero = np.zeros((len(run.region.seam), 3))
    reply = run.solver.advance(run.request(compliance=True))
    assert reply.extras["n_contacts"] >= 30
    way = np.random.default_rng(1).standard_normal(zero.shape)
    e = 1e-4
    ahead = run.solver.advance(run.request(force=e * way, exchange=1)).coupling.x
    behind = run.solver.advance(run.request(force=-e * way, exchange=2)).coupling.x
    expected = (reply.coupling.compliance @ way.ravel()).reshape(-1, 3)
    np.testing.assert_allclose((ahead - behind) / (2.0 * e), expected, atol=tolerance * np.abs(expected).max())


def test_columns_do_not_feel_each_other(grip: FemRun) -> None:
    """The compliance of two disjoint columns has no cross terms."""
    zero = np.zeros((len(grip.region.seam), 3))
    compliance = grip.solver.advance(dataclasses.replace(_numbered(grip, zero, 0), compliance=True)).coupling.compliance
    left = grip.body.x_rest[grip.region.nodes[grip.region.seam], 0] < 0.0
    mask = np.repeat(left, 3)
    assert not compliance[np.ix_(mask, ~mask)].any()
    np.testing.assert_allclose(compliance, compliance.T, atol=1e-12 * np.abs(compliance).max())


@pytest.mark.parametrize(("steps", "apart"), [(40, 1e-8), (10, 1e-6)])
def test_state_is_taken_over_at_a_switch(steps: int, apart: float) -> None:
    """A solver built from the fields of another goes on with the same motion and contact forces.

    What sticks does so where it is then: on the way to rest that is not quite where it stuck before.
    """
    run = FemRun(tofu())
    for _ in range(steps):
        run.step()
    before = run.step(CLOSE)
    run.solver.commit()
    fields = run.solver.fields(before.header)
    state = BodyState(fields.x, fields.v, fields.contact_force, fields.contact_tool)
    other = FemRun(run.scene, state=state)
    other.position, other.n_steps = run.position, run.n_steps
    after, expected = other.step(), run.step()
    np.testing.assert_allclose(other.x, run.x, atol=apart)
    np.testing.assert_allclose(after.wrench, expected.wrench, atol=1e-4 * np.abs(expected.wrench).max())


def test_the_same_force_on_a_linear_body_takes_one_iteration() -> None:
    """A constant matrix: the first correction is exact, the next step needs no new factor."""
    run = FemRun(block(kind="linear", gravity=(0.0, 0.0, 0.0)), seam=lambda body, cells: np.arange(3, dtype=np.int32))
    force = 1e-3 * np.ones((3, 3))
    assert run.step(force=force).extras["iterations"] <= 2
    factors = run.solver.factorisations
    assert all(run.step(force=force).extras["iterations"] <= 2 for _ in range(5))
    assert run.solver.factorisations == factors


def _request(run: FemRun, **changes: Any) -> Advance:
    return dataclasses.replace(run.request(), **changes)


def _failures(run: FemRun) -> dict[str, Advance]:
    seam = len(run.region.seam)
    bad = run.request().tools
    return {
        "force": _request(run, coupling_force=np.full((seam, 3), np.nan)),
        "shape": _request(run, coupling_force=np.zeros((seam + 1, 3))),
        "step": _request(run, dt=float("nan")),
        "backwards": _request(run, dt=-0.01),
        "pose": _request(run, tools=dataclasses.replace(bad, position_next=bad.position * np.inf)),
    }


@pytest.mark.parametrize("case", ["force", "shape", "step", "backwards", "pose"])
def test_nonsense_is_refused_and_changes_nothing(grip: FemRun, case: str) -> None:
    before = grip.solver.snapshot()
    with np.errstate(invalid="ignore"):
        reply = grip.solver.advance(_failures(grip)[case])
    assert reply.status != "converged"
    assert np.isfinite(reply.coupling.x).all() and np.isfinite(reply.wrench).all()
    assert grip.solver.snapshot() == before


def test_a_hopeless_step_fails_with_a_remedy_and_without_nan() -> None:
    """A force of a million newtons at one node: refused after the last sub-step, and the next step is fine."""
    run = FemRun(block(gravity=(0.0, 0.0, 0.0)), seam=lambda body, cells: np.array([0], dtype=np.int32))
    run.step(force=np.zeros((1, 3)))
    before = run.solver.snapshot()
    reply = run.solver.advance(run.request(force=np.array([[1e12, 0.0, 0.0]]), dt=1.0))
    assert "shorten the step" in reply.why and "cell" in reply.why
    for value in (reply.coupling.x, reply.wrench, reply.momentum, reply.bounds, reply.cell_distance):
        assert not np.isnan(value).any()
    assert run.solver.snapshot() == before
    run.n_steps += 1
    assert run.step(force=np.zeros((1, 3))).status == "converged"


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["crushed", "scrambled", "mirrored"])
def test_crushed_starts_recover(shape: str) -> None:
    """Cells pressed flat or turned inside out come back to rest; a whole body mirrored only stays finite."""
    run = FemRun(block(gravity=(0.0, 0.0, 0.0), step=0.01))
    rest = run.body.x_rest
    noise = np.random.default_rng(0).standard_normal(rest.shape)
    x = {
        "crushed": rest * np.array([1.0, 1.0, 0.2]),
        "mirrored": rest * np.array([-1.0, 1.0, 1.0]) + 1e-4 * noise,
        "scrambled": rest + 0.004 * noise,
    }[shape]
    points = len(run.body.surface.cell)
    state = BodyState(x, np.zeros_like(x), np.zeros((points, 3)), np.full(points, -1, dtype=np.int32))
    run = FemRun(run.scene, state=state)
    for _ in range(10 if shape == "mirrored" else 100):  # a step that fails takes a second
        reply = run.solver.advance(run.request())
        run.n_steps += 1
        assert reply.status == "converged" or shape == "mirrored"
    assert np.isfinite(run.x).all()
    if shape != "mirrored":
        assert reply.strain < 1e-6 * 20e3 * 0.05**3


def test_a_damaged_snapshot_is_refused(grip: FemRun) -> None:
    state = grip.solver.snapshot()
    for damaged in (state[:-8], b"x" + state[1:], state[:-8] + b"\xff" * 8):
        with pytest.raises(ValueError, match="snapshot"):
            grip.solver.restore(damaged)


def test_a_body_without_tools_has_fields() -> None:
    run = FemRun(block())
    run.step()
    fields = run.solver.fields(Header(1, "test", "near", 0, 0, 0, 0.0))
    assert fields.contact_force.shape == fields.point_x.shape and not fields.contact_force.any()
    assert set(fields.contact_tool.tolist()) == {-1}
