"""The loop of a pile and its guests, with a guest of one node and a pile that are formulas."""

from typing import cast

import numpy as np
import pytest

from softseam_coupling.loops.hosted import LOOKS, Hosted
from softseam_coupling.loops.loop import Correction, Outcome, PartRequest
from softseam_protocol.messages.participant import Advanced, Coupled
from softseam_protocol.messages.pile import Guest, Push

ANSWER, NODE = 2.0, (1, 3)
"""of the guest to a force, from none [m/N]"""


class Reply:
    """What is read of an answer to a step; answer: to a force, where it is said [m/N]."""

    def __init__(self, x: float, answer: float | None = None) -> None:
        root = np.zeros((0, 0)) if answer is None else np.sqrt(answer) * np.eye(3)
        self.coupling = Coupled(x=np.full(NODE, x), root=root, correctable=True)


def solve(bends: float, presses: float, exchanges: int = 16) -> tuple[Outcome, list[Guest], list[PartRequest]]:
    """A step of a guest that answers force f by ANSWER f + bends f^2, and says of a change ANSWER at first, and what is
    right where it finds that anew; the pile holds it where it is looked for, times -presses. What came of it, and all
    that the pile and the guest were asked with."""
    asked: list[Guest] = []
    requests: list[PartRequest] = []
    answer = ANSWER

    def ask(wanted: dict[str, PartRequest]) -> dict[str, Advanced]:
        nonlocal answer
        request, force = wanted["guest"], float(wanted["guest"].force[0, 0])
        if request.renew:
            answer = ANSWER + 2.0 * bends * force
        requests.append(request)
        x = 0.01 + ANSWER * force + bends * force**2
        return {"guest": cast(Advanced, Reply(x, answer if request.renew or len(requests) == 1 else None))}

    def ask_pile(guests: list[Guest]) -> list[Push]:
        (guest,) = guests
        asked.append(guest)
        return [Push(guest.force + (-presses * guest.x_ahead - guest.x_next) / answer, np.zeros(0))]

    def correct(corrections: dict[str, Correction]) -> dict[str, Advanced]:
        return {name: cast(Advanced, Reply(0.0)) for name in corrections}

    loop = Hosted({"guest": np.zeros(NODE)}, {"guest": np.ones(1)}, 1e-9, 1.0, exchanges)
    return loop.solve(ask, ask_pile, correct, lambda: ["guest"], 0.01), asked, requests


@pytest.mark.kernels
@pytest.mark.parametrize("presses", [0.0, 0.9, 1.0])
def test_forces_settle_where_the_pile_finds_others_whenever_the_guest_goes_elsewhere(presses: float) -> None:
    """With faces and points looked for in each exchange, presses = 1 has the guest's places go by turns."""
    outcome, asked, _ = solve(bends=20.0, presses=presses)
    assert not outcome.note
    assert len(asked) <= 8


@pytest.mark.kernels
def test_the_pile_looks_for_guests_where_they_go_twice() -> None:
    _, asked, _ = solve(bends=20.0, presses=1.0)
    assert len(asked) > LOOKS
    for number, guest in enumerate(asked):
        looked = asked[min(number, LOOKS - 1)]
        np.testing.assert_array_equal(guest.x_ahead, looked.x_next)


@pytest.mark.kernels
@pytest.mark.parametrize(("bends", "times"), [(0.0, 0), (20.0, 0), (80.0, 1)])
def test_a_guest_that_goes_otherwise_finds_its_answer_anew_once(bends: float, times: int) -> None:
    _, _, requests = solve(bends=bends, presses=0.0)
    assert [request.renew for request in requests].count(True) == times
    assert not any(request.renew for request in requests[:2])
