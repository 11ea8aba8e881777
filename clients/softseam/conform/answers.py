"""What a part reports of how it yields, and steps that are corrected by it."""

import numpy as np

from softseam.conform.examined_part import ExaminedPart, Floats, Service, expect, near, some_force
from softseam_protocol.messages.participant import Advanced

_LINEAR, _TOLD = 0.03, 1e-6
"""largest share of a compliance that may be asymmetric, as of XPBD, whose sweeps have an order; of a move that a small
correction may be off by, which FEM is by 0.0005, to second order, and XPBD by 0.015; and of what was reported before
[1]"""


def _told(part: ExaminedPart, reply: Advanced, before: Floats | None = None) -> Floats:
    """The compliance that a reply reports, in either form, or what was reported before. Raises Unmet."""
    root, n = reply.coupling.root, 3 * len(part.coupling)
    H = root @ root.T if root.size else reply.coupling.compliance
    if before is not None and not H.size:
        return before
    expect(H.shape == (n, n), f"a compliance of shape ({n}, {n}), as was asked for", H.shape)
    return H


def definite(service: Service) -> None:
    """The compliance, by which parts are coupled, is declared; symmetric and positive definite, where nothing touches
    the part."""
    part = ExaminedPart(service)
    able = part.configured.capabilities
    expect(able is not None and able.compliance, "Capabilities.compliance: true, as parts are coupled by it", "false")
    H = _told(part, part.advance(0, 0, None, compliance=True))
    size = float(np.abs(H).max())
    near("a symmetric compliance", H, H.T, _LINEAR * size)
    least = float(np.linalg.eigvalsh(0.5 * (H + H.T)).min())
    expect(least > -1e-9 * size, "no negative eigenvalue", f"{least:.3g} of {size:.3g} m/N")


def predicts(service: Service) -> None:
    """The compliance says how far a small force moves the coupling nodes in a step, to 5 %."""
    part, force = ExaminedPart(service), some_force()
    still = part.advance(0, 0, None, compliance=True)
    went = part.advance(0, 1, force).coupling.x - still.coupling.x
    foreseen = (_told(part, still) @ force.ravel()).reshape(-1, 3)
    near("the move that the compliance foresees", foreseen, went, 0.05 * float(np.abs(went).max()))


def corrects(service: Service) -> None:
    """Correct moves by the last compliance reported; at once, that is what redoing gives, to 3 % of a small move.

    The part turns meanwhile: what was reported first is not what would be reported now.
    """
    part, push, H = ExaminedPart(service), some_force(), np.zeros((0, 0))
    for step in range(4):
        pull = some_force(2e-2 if step else 2e-3, 1)
        reply = part.advance(step, 0, pull, compliance=step == 0)
        expect(reply.coupling.correctable, "a step that can be corrected, as declared", "correctable: false")
        H = _told(part, reply, H if step else None)
        moved = part.correct(step, 1, push, pull + push).coupling.x - reply.coupling.x
        size = float(np.abs(moved).max())
        near("the move that was foreseen", moved, (H @ push.ravel()).reshape(-1, 3), 1e-9 + _TOLD * size)
        expect(size > 0.0, "a move", "none")
        if step == 0:
            redone = part.advance(step, 2, pull + push).coupling.x - reply.coupling.x
            near("what redoing the step gives", moved, redone, _LINEAR * size)


def goes_on(service: Service) -> None:
    """The first request of the next step, sent with Correct, is answered as it is when sent after; or it is left.

    Left or answered, the step after follows it.
    """
    push, ends = some_force(), []
    for together in (False, True):
        part = ExaminedPart(service)
        part.advance(0, 0, some_force(2e-3, 1), compliance=True)
        then = part.request(1, 0, some_force(2e-3, 2))
        corrected = part.correct(0, 1, push, push, then if together else None)
        went = corrected.then or part.advance(1, 0, some_force(2e-3, 2))
        expect(went.header == then.header, "Advanced.then with the header of Correct.then", went.header)
        ends.append((corrected.coupling.x, went.coupling.x, part.advance(2, 0).coupling.x))
        service.release()
    for one, other in zip(*ends, strict=True):
        expect(np.array_equal(one, other), "the same bits as in two requests", f"{np.abs(one - other).max():.3g} m off")
