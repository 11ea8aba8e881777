"""What a participant of a few methods does with messages that come twice, late, out of order or forged, and with a
solver that fails. Its conformance on the bus is `tests/contract/test_serve.py`."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from small_part import (
    PUSH,
    TOO_MUCH,
    Answering,
    Springs,
    advance,
    ask,
    configure,
    correct,
    handler,
    header,
    refused,
    upset,
)

from softseam.conform.examined_part import ENDS, STEP
from softseam_protocol.errors import Refused
from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Capabilities,
    Commit,
    Committed,
    Configure,
    Configured,
    Failure,
    Fields,
    Observe,
    Release,
    Released,
    Reply,
    Request,
    Restore,
    Restored,
    Snapshot,
    SnapshotTaken,
    ToolMotion,
)
from softseam_protocol.participant.handler import ParticipantHandler
from softseam_protocol.participant.part import Part, Unconverged
from softseam_protocol.participant.state import State
from softseam_protocol.wire.codec import decode, encode

Floats = NDArray[np.float64]


def begun(part: type[Part] = Springs, steps: int = 2) -> ParticipantHandler:
    """A participant with a part that has taken some steps, the last of them tentative."""
    one = handler(part)
    assert isinstance(ask(one, configure()), Configured)
    for step in range(steps):
        taken(one, step)
    return one


def taken(one: ParticipantHandler, step: int, exchange: int = 0, force: Floats = PUSH) -> Advanced:
    reply = ask(one, advance(header(step, exchange), force))
    assert isinstance(reply, Advanced) and reply.status is Status.CONVERGED, reply
    return reply


def seen(one: ParticipantHandler, session: str = "s") -> Fields:
    reply = ask(one, Observe(header(session=session)))
    assert isinstance(reply, Fields)
    return reply


def same(one: Reply, other: Reply) -> bool:
    """But for the clock."""
    clocks = (Configured, Advanced, Committed, Fields, SnapshotTaken, Restored)
    first, second = (replace(each, seconds=0.0) if isinstance(each, clocks) else each for each in (one, other))
    return encode(first) == encode(second)


# ---- what it can, and what it is asked for all the same


def test_who_writes_two_methods_claims_nothing_and_tells_the_rest() -> None:
    one = handler()
    reply = ask(one, configure())
    assert isinstance(reply, Configured)
    assert reply.capabilities == Capabilities(False, False, False, 1, False, False, 0.0)
    step = taken(one, 0)
    assert step.coupling.work > 0.0 and step.kinetic > 0.0 and not step.coupling.correctable
    fields = seen(one)
    np.testing.assert_allclose(fields.point_x[0], fields.x[0], atol=1e-12)  # the first corner
    assert fields.cauchy.shape == (2, 8, 6)


def test_who_writes_a_response_corrects_by_it() -> None:
    one = handler(Answering)
    reply = ask(one, configure())
    assert isinstance(reply, Configured) and reply.capabilities is not None
    assert reply.capabilities.compliance and reply.capabilities.corrects
    first = ask(one, advance(header(), 0.0 * PUSH, compliance=True))
    assert isinstance(first, Advanced) and first.coupling.correctable and first.coupling.compliance.shape == (27, 27)
    moved = ask(one, correct(header(0, 1)))
    redone = taken(one, 0, 2)
    assert isinstance(moved, Advanced)
    np.testing.assert_allclose(moved.coupling.x, redone.coupling.x, atol=1e-15)  # springs are linear


def test_what_is_not_claimed_is_refused_with_the_remedy() -> None:
    one = begun()
    assert refused(one, advance(header(1, 1), compliance=True)) == (
        "invalid",
        "ValueError: this participant reports no compliance, as its capabilities say: ask for none",
    )
    assert "cannot be corrected" in refused(one, correct(header(1, 1)))[1]
    anchored = replace(advance(header(1, 1)), coupling_target=PUSH, coupling_impedance=np.eye(27))
    assert "constant forces alone" in refused(one, anchored)[1]


def test_no_response_is_told_for_steps_of_another_length() -> None:
    one = begun(Answering, 0)
    ask(one, advance(header(), compliance=True))
    other = ask(one, advance(header(0, 1), dt=0.5 * STEP))
    assert isinstance(other, Advanced) and not other.coupling.correctable
    assert "of its length" in refused(one, correct(header(0, 2)))[1]


def test_a_step_that_touches_is_redone_in_place_of_corrected() -> None:
    """How the wrench on a tool changes, a linear answer does not know."""
    one = begun(upset(lambda state: replace(state, advanced={"extras": {"n_contacts": 1.0}})), 0)
    reply = ask(one, advance(header(), TOO_MUCH, compliance=True))
    assert isinstance(reply, Advanced) and reply.extras["n_contacts"] == 1 and not reply.coupling.correctable
    assert "redo it" in refused(one, correct(header(0, 1)))[1]


# ---- twice, late, lost, out of order


def test_a_request_that_comes_again_is_served_once() -> None:
    """Its reply was lost: the same reply, and the step was taken once."""
    calls = []

    class Counted(Springs):
        def step(self, state: State, dt: float, force: Floats, tools: ToolMotion) -> State:
            calls.append(dt)
            return super().step(state, dt, force, tools)

    one = begun(Counted, 1)
    first = ask(one, advance(header(1)))
    assert ask(one, advance(header(1))) is first and len(calls) == 2
    # the same header with another content is that request
    assert ask(one, advance(header(1), 3.0 * PUSH)) is first and len(calls) == 2


@pytest.mark.parametrize(
    "late",
    [
        advance(header(0)),
        advance(header(0, 7)),
        advance(header(3)),
        advance(header(1, 0)),
        advance(header(1, 5, epoch=0)),
        advance(header(1, 5, epoch=2)),
        correct(header(1, 1)),
        correct(header(2, 5)),
        Commit(header(1, 5, epoch=0)),
        Commit(header(0)),
        Snapshot(header(0)),
        Snapshot(header(4)),
        Restore(header(0, epoch=0), b""),
        configure(header(epoch=0)),
    ],
    ids=lambda request: (
        f"{type(request).__name__} {request.header.epoch} {request.header.step} {request.header.exchange}"
    ),
)
def test_what_is_late_or_ahead_is_stale_and_changes_nothing(late: Request) -> None:
    one = begun(Answering, 1)
    taken(one, 1, 2)
    before = seen(one)
    assert refused(one, late)[0] == "stale"
    assert same(seen(one), before)
    untouched = begun(Answering, 2)
    assert same(taken(one, 2), taken(untouched, 2))


def test_a_late_release_leaves_the_part_of_a_newer_epoch() -> None:
    one = begun()
    assert isinstance(ask(one, configure(header(epoch=2))), Configured)
    assert isinstance(ask(one, Release(header(epoch=1))), Released)
    assert isinstance(ask(one, Observe(header(epoch=2))), Fields)
    assert isinstance(ask(one, Release(header(epoch=2))), Released)
    assert refused(one, Observe(header(epoch=2)))[0] == "not_configured"


@pytest.mark.parametrize("seed", range(8))
def test_a_run_is_the_same_whatever_comes_twice_and_late(seed: int) -> None:
    """Each request some times over, and between them some of those before."""
    rng = np.random.default_rng(seed)
    requests: list[Request] = []
    for step in range(6):
        force = rng.standard_normal(PUSH.shape) * PUSH
        requests.append(advance(header(step, 0), force, compliance=step % 2 == 0))
        if rng.random() < 0.5:
            requests.append(advance(header(step, 1), -force))
        if rng.random() < 0.7:
            requests.append(correct(header(step, 2), 0.1 * force))
        if rng.random() < 0.3:
            requests.append(Commit(header(step + 1)))
        if rng.random() < 0.3:
            requests.append(Snapshot(header(step + 1)))
    clean, disturbed = begun(Answering, 0), begun(Answering, 0)
    for place, request in enumerate(requests):
        wanted = ask(clean, request)
        assert not isinstance(wanted, Failure)
        for _ in range(rng.integers(1, 4)):
            assert same(ask(disturbed, request), wanted)
            for old in rng.integers(0, place + 1, 2):
                ask(disturbed, requests[old])
    assert same(seen(disturbed), seen(clean))


def test_sessions_and_parts_do_not_meet() -> None:
    one = begun()
    before = seen(one)
    for head in (header(session="other"), header(part="far")):
        assert refused(one, advance(replace(head, step=1, exchange=5)))[0] == "not_configured"
        assert isinstance(ask(one, configure(head)), Configured)
        assert isinstance(ask(one, advance(head, 5.0 * PUSH)), Advanced)
    assert same(seen(one), before)


# ---- forged


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (lambda r: replace(r, dt=float("nan")), "time step is nan"),
        (lambda r: replace(r, dt=0.0), "time step is 0.0"),
        (lambda r: replace(r, dt=float("inf")), "time step is inf"),
        (lambda r: replace(r, coupling_force=PUSH[:4]), "shape (4, 3)"),
        (lambda r: replace(r, coupling_force=PUSH[:, :2]), "shape (9, 2)"),
        (lambda r: replace(r, coupling_force=np.nan * PUSH), "finite numbers"),
        (lambda r: replace(r, coupling_force_start=PUSH), "constant forces alone"),
        (lambda r: replace(r, tools=replace(r.tools, position=np.zeros((1, 3)))), "send a row for each"),
    ],
)
def test_a_bad_step_does_not_even_commit_the_one_before(bad: Callable[[Advance], Advance], words: str) -> None:
    one = begun(steps=0)
    rest = seen(one).x
    first = taken(one, 0, 1)
    kind, text = refused(one, bad(advance(header(1))))
    assert kind == "invalid"
    assert words in text
    assert isinstance(ask(one, Commit(header(0))), Committed), "it is tentative still, and can be taken back"
    np.testing.assert_array_equal(seen(one).x, rest)
    assert same(taken(one, 0, 2), replace(first, header=header(0, 2)))


def test_a_correction_of_another_shape_or_for_another_step_is_refused() -> None:
    one = begun(Answering, 0)
    ask(one, advance(header(), compliance=True))
    before = seen(one)
    assert "finite numbers" in refused(one, correct(header(0, 1), np.nan * PUSH))[1]
    assert "shape (4, 3)" in refused(one, correct(header(0, 1), PUSH[:4]))[1]
    for then in (advance(header(2)), advance(header(1, 1)), advance(header(1, session="other"))):
        assert "not the first Advance" in refused(one, correct(header(0, 1), then=then))[1]
    assert same(seen(one), before)


def test_a_bad_step_sent_with_a_correction_is_left() -> None:
    one = begun(Answering, 0)
    ask(one, advance(header(), compliance=True))
    both = ask(one, correct(header(0, 1), then=advance(header(1), PUSH[:4])))
    assert isinstance(both, Advanced) and both.then is None
    assert isinstance(ask(one, correct(header(0, 2))), Advanced), "the corrected step is tentative still"


def test_a_state_is_taken_by_its_own_part_alone() -> None:
    one, other = begun(), begun()
    taken_of = ask(one, Snapshot(header(2)))
    assert isinstance(taken_of, SnapshotTaken)
    state = taken_of.state
    before = seen(other)
    flipped = bytes([state[40] ^ 1])
    for bad in (b"", b"no state", state[:-1], state + b"\0", state[:40] + flipped + state[41:], bytes(len(state))):
        assert refused(other, Restore(header(5), bad))[0] == "invalid"
    assert same(seen(other), before)
    elsewhere = handler()
    ask(elsewhere, configure(coupling=ENDS))
    assert refused(elsewhere, Restore(header(5), state))[0] == "invalid", "the same nodes, coupled at others"
    assert isinstance(ask(other, Restore(header(2), state)), Restored)
    assert same(taken(one, 2), taken(other, 2))


def test_a_restored_part_corrects_by_what_was_told_before() -> None:
    one, other = begun(Answering, 0), begun(Answering, 0)
    ask(one, advance(header(), compliance=True))
    taken_of = ask(one, Snapshot(header(1)))
    assert isinstance(taken_of, SnapshotTaken)
    ask(other, Restore(header(1), taken_of.state))
    for each in (one, other):
        assert taken(each, 1).coupling.correctable
    assert same(ask(one, correct(header(1, 1))), ask(other, correct(header(1, 1))))


@pytest.mark.parametrize("field", ["cell_nodes", "point_cell", "mass", "nodes", "x_rest", "fixed", "point_local"])
def test_a_mesh_that_is_not_whole_is_refused(field: str) -> None:
    request = configure()
    assert request.mesh is not None
    had = getattr(request.mesh, field)
    spoilt = had + np.int32(1000) if field in ("cell_nodes", "point_cell") else had[:-1]
    bad = replace(request, mesh=replace(request.mesh, **{field: spoilt}))
    assert refused(handler(), bad)[0] == "invalid"
    assert refused(handler(), replace(request, mesh=None))[0] == "invalid"


def test_a_tetrahedron_is_for_those_alone_who_carry_its_points() -> None:
    request = configure()
    assert request.mesh is not None
    cells = request.mesh.cell_nodes.copy()
    cells[:, 1] = cells[:, 13]
    tetrahedra = replace(request, mesh=replace(request.mesh, cell_nodes=cells))
    assert "a cell is a tetrahedron" in refused(handler(), tetrahedra)[1]

    class Carries(Springs):
        def surface(self, state: State) -> Floats:
            return state.x[: len(self.mesh.points)]

    assert isinstance(ask(handler(Carries), tetrahedra), Configured)


def test_another_model_and_garbage_are_refused_and_counted() -> None:
    one = handler()
    for payload in (encode(configure(model="other")), encode(Observe(header()))):
        with pytest.raises(Refused):
            one(payload)
    with pytest.raises(Exception, match="not a softseam message"):
        one(b"garbage")
    assert one.refused == {"invalid": 2, "not_configured": 1}


# ---- a solver that fails


def fails(error: Exception) -> type[Part]:
    def happens(state: State) -> State:
        raise error

    return upset(happens)


@pytest.mark.parametrize(
    ("error", "kind", "text"),
    [
        (ValueError("this tool is too thin: use a thicker one"), "invalid", "too thin: use a thicker one"),
        (RuntimeError("a bug"), "invalid", "RuntimeError: a bug"),
        (MemoryError(), "internal", "out of memory"),
    ],
)
def test_a_solver_that_raises_is_a_failure_and_leaves_the_step_before(
    error: Exception, kind: str, text: str, caplog: pytest.LogCaptureFixture
) -> None:
    one = begun(fails(error), 1)
    first = taken(one, 1)
    with caplog.at_level(logging.ERROR):
        came = refused(one, advance(header(1, 1), TOO_MUCH))
    assert came[0] == kind and text in came[1]
    assert ("Traceback" in caplog.text) == isinstance(error, RuntimeError), "a bug is shown to whoever wrote it"
    assert ask(one, advance(header(1))) is first
    assert same(taken(one, 2), taken(begun(steps=2), 2)), "and it can be committed"


@pytest.mark.filterwarnings("ignore:overflow")
@pytest.mark.parametrize(
    ("part", "status", "why"),
    [
        (fails(Unconverged("no equilibrium: use smaller cells")), Status.UNCONVERGED, "use smaller cells"),
        (fails(np.linalg.LinAlgError("Singular matrix")), Status.UNCONVERGED, "Singular"),
        (upset(lambda state: replace(state, x=np.full((45, 3), np.nan))), Status.DIVERGED, "State.x is not finite"),
        (upset(lambda state: replace(state, v=np.full((45, 3), np.inf))), Status.DIVERGED, "State.v is not finite"),
        (upset(lambda state: replace(state, x=1e200 + state.x)), Status.DIVERGED, "is not finite"),
    ],
)
def test_a_step_that_fails_says_so_and_is_redone_from_the_committed_state(
    part: type[Part], status: Status, why: str
) -> None:
    one = begun(part, 1)
    ask(one, Commit(header(1)))
    before = seen(one)
    taken(one, 1)
    reply = ask(one, advance(header(1, 1), TOO_MUCH))
    assert isinstance(reply, Advanced) and reply.status is status and why in reply.why, reply
    encode(reply)
    assert not reply.coupling.correctable and same(seen(one), before), "also the exchange before is taken back"
    assert "cannot be corrected" in refused(one, correct(header(1, 2)))[1]
    assert same(taken(one, 1, 2), taken(begun(steps=1), 1, 2))
    ask(one, Commit(header(1, 3)))
    assert same(seen(one), before)


def test_what_a_solver_returns_is_its_own_no_more() -> None:
    """It may use its arrays again; and it cannot write to the state that it is given."""
    buffer = np.zeros((45, 3))

    class Reuses(Springs):
        def step(self, state: State, dt: float, force: Floats, tools: ToolMotion) -> State:
            end = super().step(state, dt, force, tools)
            buffer[:] = end.x
            return State(buffer, end.v)

    one = begun(Reuses, 1)
    x = seen(one).x.copy()
    buffer[:] = 7.0
    np.testing.assert_array_equal(seen(one).x, x)

    class Writes(Springs):
        def step(self, state: State, dt: float, force: Floats, tools: ToolMotion) -> State:
            state.x[:] += dt
            return state

    bad = handler(Writes)
    ask(bad, configure())
    assert "read-only" in refused(bad, advance(header()))[1]


@pytest.mark.parametrize(
    ("end", "words"),
    [
        (lambda state: replace(state, x=state.x[1:]), "State.x of shape (44, 3): this part's is (45, 3)"),
        (lambda state: replace(state, own=np.zeros(2)), "State.own of shape (2,)"),
    ],
)
def test_a_state_of_another_shape_is_named(end: Callable[[State], State], words: str) -> None:
    one = begun(upset(end), 1)
    kind, text = refused(one, advance(header(1), TOO_MUCH))
    assert kind == "invalid" and words in text


def test_a_response_of_another_shape_is_named() -> None:
    class Narrow(Springs):
        def response(self, state: State, dt: float) -> Floats:
            return np.zeros((27, 27))

    one = begun(Narrow, 0)
    assert (
        "a response of shape (27, 27): this part's is (135, 27)" in refused(one, advance(header(), compliance=True))[1]
    )


def test_what_a_step_says_beside_positions_is_passed_on() -> None:
    """The work of a tool, the force on a point; NaN among them never leaves the process."""
    force = np.zeros((42, 3))
    force[3, 2] = 5.0
    more = {"tool_work": 2.0, "extras": {"n_contacts": 1.0}}
    one = begun(upset(lambda state: replace(state, advanced=more, fields={"contact_force": force})), 0)
    reply = taken(one, 0, 0, TOO_MUCH)
    assert (reply.tool_work, reply.extras["n_contacts"]) == (2.0, 1)
    np.testing.assert_array_equal(seen(one).contact_force, force)
    nan = {"tool_work": float("nan")}, {"contact_force": np.nan * force}
    bad = begun(upset(lambda state: replace(state, advanced=nan[0])), 1)
    failed = ask(bad, advance(header(1), TOO_MUCH))
    assert isinstance(failed, Advanced) and failed.status is Status.DIVERGED and "Advanced.tool_work" in failed.why
    bad = begun(upset(lambda state: replace(state, fields=nan[1])), 0)
    taken(bad, 0, 0, TOO_MUCH)
    assert "Fields.contact_force is not finite" in refused(bad, Observe(header()))[1]
    both = replace(advance(header(0, 1), TOO_MUCH), fields=True)
    assert "Fields.contact_force is not finite" in refused(bad, both)[1]
    assert refused(bad, Commit(header(1)))[0] == "stale", "a step whose answer was none is not there"
    assert same(taken(bad, 0, 1), taken(begun(steps=0), 0, 1))


def test_variables_of_its_own_are_taken_back_saved_and_restored() -> None:
    class Counts(Springs):
        def __init__(self, request: Configure) -> None:
            super().__init__(request)
            self.begin = replace(self.begin, own=np.zeros((2, 2)))

        def step(self, state: State, dt: float, force: Floats, tools: ToolMotion) -> State:
            end = super().step(state, dt, force, tools)
            return replace(end, own=state.own + 1.0)

        def strain_energy(self, state: State) -> Floats:
            return np.asarray(state.own[0])

    one, other = begun(Counts, 0), begun(Counts, 0)
    for exchange in range(3):
        assert taken(one, 0, exchange).strain == 2.0
    state = ask(one, Snapshot(header(1)))
    assert isinstance(state, SnapshotTaken)
    ask(other, Restore(header(1), state.state))
    assert taken(other, 1).strain == taken(one, 1).strain == 4.0
    decode(encode(state), SnapshotTaken)
