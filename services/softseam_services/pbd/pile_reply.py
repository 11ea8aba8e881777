"""The answer of a pile to a step: sums over its bodies, and each by itself."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Detail, Status
from softseam_protocol.messages.participant import Advanced
from softseam_protocol.messages.pile import Members, Met, Note
from softseam_services.body.body import Floats

from . import watch
from .kernels import summary as k

Said = tuple[watch.Fault, dict[Detail, str]]
"""what is wrong with a body's step, and what its monitor says"""


class Stepped(NamedTuple):
    """What became of all b bodies of a pile in a step between t tools."""

    results: Floats
    """(b, N_RESULTS)"""
    wrenches: Floats
    """(b, t, 6) [N, N m]"""
    sweeps: NDArray[np.int64]
    """(b,)"""
    substeps: NDArray[np.int64]
    dissipated: Floats
    """(b,) [J]"""
    met: list[Met]
    """what contacts between them did"""


def reply_of(
    header: Header, awake: NDArray[np.int64], stepped: Stepped, said: Mapping[int, Said], seconds: float
) -> Advanced:
    """Of the bodies that took the step; said: of those of which there is something to say, by their numbers."""
    rows = np.ascontiguousarray(stepped.results[awake].T)
    wrench, dissipated = stepped.wrenches[awake], stepped.dissipated[awake]
    places = {number: place for place, number in enumerate(awake.tolist())} if said else {}
    notes = [
        Note(places[number], fault.status, _why(fault), "; ".join(text.values()), list(text))
        for number, (fault, text) in sorted(said.items())
        if text or fault is not watch.Fault.NONE
    ]
    members = Members(
        rows[k.KINETIC],
        rows[k.STRAIN],
        rows[k.GRAVITY],
        rows[k.TOOL_WORK],
        dissipated,
        np.ascontiguousarray(rows[k.MOMENTUM : k.MOMENTUM + 3].T),
        np.ascontiguousarray(rows[k.ANGULAR : k.ANGULAR + 3].T),
        rows[k.PENETRATION],
        rows[k.SLIP],
        rows[k.RESIDUAL],
        rows[k.N_CONTACTS].astype(np.int32),
        stepped.sweeps[awake].astype(np.int32),
        stepped.substeps[awake].astype(np.int32),
        wrench,
        np.ascontiguousarray(rows[k.BOUNDS : k.BOUNDS + 3].T),
        np.ascontiguousarray(rows[k.BOUNDS + 3 : k.BOUNDS + 6].T),
        notes,
        stepped.met,
        rows[k.SEAM_WORK],
    )
    bounds = np.zeros((2, 3))
    if len(awake):
        bounds = np.stack((members.low.min(axis=0), members.high.max(axis=0)))
    wrong = [note for note in notes if note.status is not Status.CONVERGED]
    return Advanced(
        header,
        wrong[0].status if wrong else Status.CONVERGED,
        np.zeros((0, 3)),
        np.zeros((0, 0)),
        wrench.sum(axis=0),
        float(rows[k.KINETIC].sum()),
        float(rows[k.STRAIN].sum()),
        float(rows[k.GRAVITY].sum()),
        float(rows[k.TOOL_WORK].sum()),
        0.0,
        members.momentum.sum(axis=0),
        members.angular_momentum.sum(axis=0),
        float(rows[k.PENETRATION].max(initial=0.0)),
        float(rows[k.SLIP].max(initial=0.0)),
        int(members.n_contacts.sum()),
        int(members.iterations.max(initial=0)),
        seconds,
        np.zeros(0),
        bounds,
        n_substeps=int(members.n_substeps.max(initial=1)),
        residual=float(rows[k.RESIDUAL].max(initial=0.0)),
        why=wrong[0].why if wrong else "",
        dissipated=float(dissipated.sum()),
        members=members,
    )


def _why(fault: watch.Fault) -> str:
    """What is wrong with a step and the remedy; '' where nothing is."""
    return "" if fault is watch.Fault.NONE else fault.value
