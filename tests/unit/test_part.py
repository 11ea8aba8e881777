"""What a participant of a few methods does with what it never claimed, and with messages that come twice, late or out
of order. Its conformance on the bus is `tests/contract/test_serve.py`."""

from __future__ import annotations

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

from softseam.conform.examined_part import STEP
from softseam_protocol.messages.participant import (
    Advanced,
    Capabilities,
    Commit,
    Configured,
    Failure,
    Fields,
    Observe,
    Release,
    Released,
    Request,
    Restore,
    Snapshot,
    ToolMotion,
)
from softseam_protocol.participant.state import State

Floats = NDArray[np.float64]


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
