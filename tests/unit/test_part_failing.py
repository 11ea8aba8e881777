"""What a participant of a few methods does where its solver fails or returns what does not fit."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from small_part import (
    TOO_MUCH,
    Springs,
    advance,
    ask,
    begun,
    configure,
    correct,
    handler,
    header,
    refused,
    same,
    seen,
    taken,
    upset,
)

from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.participant import (
    Advanced,
    Commit,
    Configure,
    Observe,
    Restore,
    Snapshot,
    SnapshotTaken,
    ToolMotion,
)
from softseam_protocol.participant.part import Part, Unconverged
from softseam_protocol.participant.state import State
from softseam_protocol.wire.codec import decode, encode

Floats = NDArray[np.float64]


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
