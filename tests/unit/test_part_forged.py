"""What a participant of a few methods does with messages whose content is forged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from small_part import (
    PUSH,
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
)

from softseam.conform.examined_part import ENDS
from softseam_protocol.errors import Refused
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Commit,
    Committed,
    Configured,
    Observe,
    Restore,
    Restored,
    Snapshot,
    SnapshotTaken,
)
from softseam_protocol.participant.state import State
from softseam_protocol.wire.codec import encode

Floats = NDArray[np.float64]


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
