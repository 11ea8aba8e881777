"""What counts in a plan: quantities of the reference that are known well enough for its tolerance."""

from __future__ import annotations

from dataclasses import replace

from softseam.columns import unit_of
from softseam.study.errors import KNOWN
from softseam.study.reference import Reference, in_words

REFERENCE = 0.25
"""the reference is refined until it is known to this share of the tolerance [1]"""
WORST_REFERENCE = 0.75
"""what is known worse than this share of the tolerance, or of 5 %, does not count; while what does is known worse than
this share of the tolerance, the reference is refined [1]"""
VAGUEST = 0.95
"""and no plan is made where what counts is known worse than this: next to nothing would be left for runs [1]"""


def counts_to(tolerance: float) -> float:
    """How uncertain a quantity may be that counts in a plan of this tolerance [1].

    Whoever wants less than 5 % wants it of all that a plan of 5 % counts; what is known too little for that forbids it,
    but for stresses (`counting`).
    """
    return WORST_REFERENCE * max(KNOWN, tolerance)


def known_to(tolerance: float) -> float:
    """How uncertain a reference's cells and its steps may each leave a quantity for a plan of this tolerance [1]."""
    return 0.5 * REFERENCE * tolerance


def looser(reference: Reference, tolerance: float) -> dict[str, float]:
    """Stresses that are known well enough for some tolerance from this one to 5 %, and for which [1]."""
    return {
        name: true.uncertainty / WORST_REFERENCE
        for name, true in reference.truth.items()
        if unit_of(name) == "Pa"
        and true.has_limit
        and WORST_REFERENCE * tolerance < true.uncertainty <= counts_to(tolerance)
    }


def counting(reference: Reference, tolerance: float) -> Reference:
    """The reference with what counts in a plan of this tolerance.

    A stress follows from derivatives, and is known an order worse than what moves and presses. It forbids no plan, as
    one that is known even less does not: it has to be within the tolerance that it is known well enough for. Where
    nothing else counts, it does.
    """
    held = looser(reference, tolerance)
    if all(name in held for name in reference.counted):
        return reference
    known = {name: in_words(reference.truth[name].uncertainty) for name in held}
    left_out = {name: f"known to {known[name]} only, and held to {in_words(bound)}" for name, bound in held.items()}
    truth = {name: replace(true, left_out=left_out.get(name, true.left_out)) for name, true in reference.truth.items()}
    return replace(reference, truth=truth)
