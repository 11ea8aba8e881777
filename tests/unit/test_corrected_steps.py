"""A step that is corrected, moved on by its linear answer to a force on the seam: how near to being solved again."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, block, tofu
from numpy.typing import NDArray
from pbd_run import PbdRun, block_scene

from softseam_protocol.messages.participant import Advance, Advanced, Bundle, Commit, Configure, Correct, Failure
from softseam_services.body.body import Body
from softseam_services.body.region import shared_nodes
from softseam_services.fem.face_forces import point_positions
from softseam_services.server import ParticipantServer

pytestmark = pytest.mark.kernels

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def _left(body: Body) -> Ints:
    return np.flatnonzero(body.cell_grid[:, 0] == 0).astype(np.int32)


def _seam(body: Body, cells: Ints) -> Ints:
    return shared_nodes(body, cells, np.setdiff1d(np.arange(body.n_cells), cells).astype(np.int32))


def _correct(run: FemRun | PbdRun, push: Floats, force: Floats, exchange: int) -> Advanced:
    """Move the tentative step on by its answer to a push; `force` acts then."""
    header = dataclasses.replace(run.request(exchange=exchange).header)
    return run.solver.correct(Correct(header, push, force))


def _coupled(run: FemRun, force: Floats, exchange: int, velocities: dict[str, tuple[float, float, float]]) -> Advance:
    """With a stiffness beside it as of what is missing, told in every request."""
    request = run.request(velocities, force=force, exchange=exchange)
    anchor = run.body.x_rest[run.region.nodes[run.region.seam]]
    return dataclasses.replace(request, coupling_target=anchor, coupling_impedance=40.0 * np.eye(3 * len(anchor)))


def _fem_squeezed() -> FemRun:
    """A column of a cube that a plate pressed against the other, which is a spring here; it sticks to the plate.

    Of a material that is little wider for it, so that no point lifts off that the factor took to touch.
    """
    run = FemRun(tofu(friction=5.0, poisson=0.3), cells=_left, seam=_seam)
    for step in range(30):
        velocities = CLOSE if step < 20 else {}
        reply = run.solver.advance(_coupled(run, np.zeros((len(run.region.seam), 3)), 0, velocities))
        assert reply.status == "converged"
        run.position = run.position + run.scene.step * np.array(
            [velocities.get(n, (0.0,) * 3) for n in run.tools.names]
        )
        run.n_steps += 1
    assert reply.extras["n_contacts"] > 0
    return run


def known_move(reply: Advanced, force: Floats) -> Floats:
    """What the seam moves by where it is pushed by `force`, as the reply tells (s, 3) [m]."""
    known = reply.coupling.root @ reply.coupling.root.T
    return (known @ force.ravel()).reshape(-1, 3)


def test_fem_settled_is_nearly_fem_solved_again() -> None:
    """What is left is of second order: a quarter where the force is half. The seam moves as the yield told says."""
    run = _fem_squeezed()
    rng = np.random.default_rng(1)
    direction = rng.standard_normal((len(run.region.seam), 3))
    left = []
    state = run.solver.snapshot()
    for n, size in enumerate((2e-3, 1e-3)):
        run.solver.restore(state)  # so that the factor is this step's
        force = size * direction
        reply = run.solver.advance(_coupled(run, np.zeros_like(force), 3 * n, {}))
        assert reply.coupling.correctable
        before = run.x.copy(), run.solver.state.v.copy()
        acted = reply.coupling.force - 40.0 * known_move(reply, force) + force
        corrected = _correct(run, force, acted, 3 * n + 1)
        x, v = run.x.copy(), run.solver.state.v.copy()
        moved = (x - before[0])[run.region.seam]
        np.testing.assert_allclose(moved, known_move(reply, force), atol=1e-9 * np.abs(moved).max())
        np.testing.assert_allclose(v - before[1], (x - before[0]) / run.scene.step, atol=1e-12)
        again = run.solver.advance(_coupled(run, force, 3 * n + 2, {}))
        for name in ("kinetic", "strain", "gravity"):
            assert getattr(corrected, name) == pytest.approx(getattr(again, name), rel=2e-3, abs=1e-9), name
        there = again.coupling.force
        np.testing.assert_allclose(corrected.coupling.force, there, atol=2e-3 * np.abs(there).max())
        pushed = (corrected.coupling.force - reply.coupling.force).sum(0)
        balance = (corrected.momentum - reply.momentum) / run.scene.step - pushed
        tools = (corrected.wrench - reply.wrench)[:, :3].sum(axis=0)
        np.testing.assert_allclose(balance, -tools, atol=1e-9 * np.abs(acted).max())
        left.append(np.abs(x - run.x).max() / np.abs(x - before[0]).max())
    assert left[0] < 2e-3
    assert left[1] < 0.6 * left[0]


def test_what_sticks_comes_back_to_where_it_stuck_before_a_settled_step() -> None:
    """A force that was there for a settled step only leaves no way behind, but where two tools hold."""
    run = _fem_squeezed()
    still = np.zeros((len(run.region.seam), 3))
    force = 5e-3 * np.random.default_rng(1).standard_normal(still.shape)
    run.solver.advance(_coupled(run, still, 0, {}))
    before = run.x.copy()
    _correct(run, force, force, 1)
    moved = np.abs(run.x - before).max()
    for _ in range(40):
        run.n_steps += 1
        run.solver.advance(_coupled(run, still, 0, {}))
    held = (np.abs(run.solver.state.contact[:, :, :3]).sum(axis=2) > 0.0).sum(axis=1)
    back = point_positions(run.model, run.parameters, run.x) - point_positions(run.model, run.parameters, before)
    assert (held == 1).sum() >= 30
    assert np.abs(back[held == 1]).max() < 1e-4 * moved


def test_fem_tells_its_yield_once_a_factor_and_anew_after_a_snapshot() -> None:
    run = FemRun(block(), cells=_left, seam=_seam)
    force = np.zeros((len(run.region.seam), 3))
    first = run.solver.advance(_coupled(run, force, 0, {}))
    again = run.solver.advance(_coupled(run, force, 1, {}))
    assert first.coupling.root.size and not again.coupling.root.size
    run.solver.snapshot()
    run.n_steps += 1
    after = run.solver.advance(_coupled(run, force, 0, {}))
    assert after.coupling.root.shape == first.coupling.root.shape
    assert run.solver.advance(run.request(exchange=1)).coupling.correctable, (
        "by a factor without a stiffness beside it, too"
    )


def test_fem_tells_the_yield_of_the_factor_after_a_hard_step_however_many_came_before() -> None:
    """A step that one iteration does not solve leaves no factor: that of the next one is new, whatever its number."""
    run = FemRun(block(gravity=(0.0, 0.0, 0.0), models={"fem": {"iterations": 1}}), cells=_left, seam=_seam)
    rest, still = run.solver.snapshot(), np.zeros((len(run.region.seam), 3))
    for n_before in range(1, 8):
        run.solver.restore(rest)
        for n in range(n_before):
            request = _coupled(run, still, n, {})
            stiffness = (1.0 + n) * request.coupling_impedance
            assert run.solver.advance(dataclasses.replace(request, coupling_impedance=stiffness)).coupling.root.size
        assert not run.solver.advance(_coupled(run, still + 0.01, n_before, {})).coupling.correctable
        assert run.solver.advance(_coupled(run, still, n_before + 1, {})).coupling.root.size, n_before


def _pbd(length: int, spin: bool = False) -> PbdRun:
    """A free bar of so many cells of 2 cm but the last one, which the seam's forces stand for."""
    scene = block_scene((0.02 * (length + 1), 0.02, 0.02), 0.02, step=0.005)
    whole = PbdRun(scene).body
    far = np.flatnonzero(whole.cell_grid[:, 0] < length).astype(np.int32)
    v = np.cross([0.0, 0.0, 5.0], whole.x_rest) if spin else None
    return PbdRun(scene, cells=far, seam=_seam(whole, far), v=v)


@pytest.mark.parametrize("length", [2, 12])
def test_pbd_settled_is_nearly_pbd_advanced_again(length: int) -> None:
    """Two cells are probed whole, of twelve the nearest; both take up all the momentum that the force brings.

    The monitor must know the energy that the settled state has, or it would take the rest for energy from nowhere.
    """
    run = _pbd(length, spin=True)
    rng = np.random.default_rng(2)
    force = 1e-3 * rng.standard_normal((len(run.region.seam), 3))
    run.solver.advance(run.request(force, compliance=True))
    run.solver.commit()
    run.n_steps += 1
    more = 1e-4 * rng.standard_normal(force.shape)
    reply = run.solver.advance(run.request(force))
    assert reply.coupling.correctable
    before = run.solver.fields(run.header())
    _correct(run, more, force + more, 1)
    settled = run.solver.fields(run.header())
    monitor = run.work.monitor.copy()
    impulse = run.region.mass @ (settled.v - before.v)
    np.testing.assert_allclose(impulse, run.scene.step * more.sum(axis=0), rtol=2e-5)  # the probes' rounding
    again = run.solver.advance(run.request(force + more, exchange=2))
    solved = run.solver.fields(run.header())
    moved = np.abs(solved.x - before.x).max()
    assert np.abs(settled.x - solved.x).max() < 0.05 * moved
    assert np.abs(settled.v - solved.v).max() < 0.1 * np.abs(solved.v - before.v).max()
    np.testing.assert_allclose(monitor[1:4], [again.kinetic, again.strain, again.gravity], rtol=2e-3, atol=1e-12)


def test_a_restored_pbd_settles_to_the_same_bits() -> None:
    one, other = _pbd(3), _pbd(3)
    force = np.full((len(one.region.seam), 3), 1e-3)
    one.solver.advance(one.request(force, compliance=True))
    other.solver.restore(one.solver.snapshot())
    found = []
    for run in (one, other):
        run.n_steps += 1
        assert run.solver.advance(run.request(force)).coupling.correctable
        _correct(run, 0.1 * force, 1.1 * force, 1)
        found.append(run.solver.snapshot())
    assert found[0] == found[1]


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_what_cannot_be_corrected_is_refused(model: str) -> None:
    run: FemRun | PbdRun = FemRun(block(), cells=_left, seam=_seam) if model == "fem" else _pbd(2)
    none = np.zeros((len(run.region.seam), 3))
    with pytest.raises(ValueError, match="cannot be corrected"):
        _correct(run, none, none, 1)
    reply = run.solver.advance(run.request())
    assert reply.coupling.correctable == (model == "fem"), "PBD's answers are not known before they were probed"
    if model == "pbd":
        with pytest.raises(ValueError, match="cannot be corrected"):
            _correct(run, none, none, 1)
        return
    with pytest.raises(ValueError, match="has shape"):
        _correct(run, none[1:], none, 1)
    with pytest.raises(ValueError, match="not finite"):
        _correct(run, none, none + np.nan, 1)


def test_a_correction_that_comes_again_is_made_once() -> None:
    """And the step that follows begins from the corrected state."""
    ends = []
    for times in (1, 2, 0):
        run = _pbd(2)
        server = ParticipantServer()
        bundle = Bundle(run.scene.model_dump_json(), {})
        nodes = run.region.nodes[run.region.seam].astype(np.int32)
        configured = server.handle(Configure(run.header(), bundle, "pbd", run.region.cells, nodes))
        assert not isinstance(configured, Failure)
        force = np.full((len(nodes), 3), 1e-3)
        first = server.handle(run.request(force, compliance=True))
        assert not isinstance(first, Failure)
        again = run.request(exchange=1).header
        for _ in range(times):
            corrected = server.handle(Correct(again, 0.1 * force, 1.1 * force, fields=True))
            assert isinstance(corrected, Advanced) and corrected.fields is not None
        run.n_steps += 1
        second = server.handle(run.request(force))
        assert isinstance(second, Advanced) and 0.0 < second.seconds < 10.0
        ends.append(second.coupling.x)
    np.testing.assert_array_equal(ends[0], ends[1])
    assert np.abs(ends[0] - ends[2]).max() > 1e-9


def test_a_correction_needs_a_tentative_step_and_a_later_exchange() -> None:
    run = _pbd(2)
    server = ParticipantServer()
    nodes = run.region.nodes[run.region.seam].astype(np.int32)
    server.handle(Configure(run.header(), Bundle(run.scene.model_dump_json(), {}), "pbd", run.region.cells, nodes))
    none = np.zeros((len(nodes), 3))
    early = server.handle(Correct(run.request(exchange=1).header, none, none))
    assert isinstance(early, Failure) and early.kind == "stale"
    server.handle(run.request(compliance=True, exchange=1))
    late = server.handle(Correct(run.request(exchange=1).header, none, none))
    assert isinstance(late, Failure) and late.kind == "stale"
    server.handle(Commit(dataclasses.replace(run.header(), step=1)))
    gone = server.handle(Correct(run.request(exchange=2).header, none, none))
    assert isinstance(gone, Failure) and gone.kind == "stale"
