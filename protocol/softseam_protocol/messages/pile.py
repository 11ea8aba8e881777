"""Of a pile, several whole bodies that one participant holds as one part: what a step did to each of them."""

from dataclasses import field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.arrays import (
    NO_MATRIX,
    NO_VECTORS,
    Array,
    Count,
    Ids,
    Matrix,
    Scalars,
    Vectors,
    no_ids,
)
from softseam_protocol.messages.header import message
from softseam_protocol.messages.outcomes import Detail, Status

BodyWrenches = Annotated[NDArray[np.float64], Array("f8", None, None, 6)]


@message
class Guest:
    """A body of another model that may touch a pile, in a step; s nodes that its surface follows, and that may move."""

    x: Vectors = field(default_factory=NO_VECTORS)
    """where they are as the step begins (s, 3) [m]"""
    x_next: Vectors = field(default_factory=NO_VECTORS)
    """and as it ends, under `force` (s, 3) [m]; empty: it sleeps, and stays where it is"""
    force: Vectors = field(default_factory=NO_VECTORS)
    """on them over the step, that all which touch it are taken to exert (s, 3) [N]"""
    root: Matrix = field(default_factory=NO_MATRIX)
    """R of how x_next answers to a force, dx/dforce = R R^T (3s, r) [(m/N)^(1/2)]; empty: the last one sent since the
    last Configure, Snapshot or Restore"""
    x_ahead: Vectors = field(default_factory=NO_VECTORS)
    """where they are looked for as the step ends (s, 3) [m]; empty: at x_next"""


@message
class Push:
    """What acts on a guest's nodes."""

    force: Vectors
    """mean over the step (s, 3) [N]"""
    moment: Scalars
    """of it about the world's origin, where those were that exert it (3,) [N m]; empty: that of the nodes"""
    nodes: Ids = field(default_factory=no_ids)
    """places among its nodes of those that anything near enough may act on, ascending (k,)"""


@message
class Note:
    """What is to be said of one body's step."""

    body: Count
    """its place among those that took the step"""
    status: Status
    why: str = ""
    alarms: dict[Detail, str] = field(default_factory=dict)
    """as of `Advanced`"""


@message
class Meetings:
    """What k contacts between bodies of a pile, or with its guests, did in a step, ascending: those of which points
    came near enough to touch."""

    contact: Ids
    """places among all, in the order of the scene's interfaces (k,)"""
    n_points: Ids
    """that were near enough (k,)"""
    depth: Scalars
    """of a point inside the other body, at most, at the end (k,) [m]"""
    largest: Scalars
    """force on a point, or on a patch (k,) [N]"""
    work: Scalars
    """on both bodies (k,) [J]"""
    force: Vectors
    """of all points on the first body, the mean of the step (k, 3) [N]"""


def no_meetings() -> Meetings:
    """Of a step in which nothing came near."""
    ids, none = np.zeros(0, dtype=np.int32), np.zeros(0)
    return Meetings(ids, ids, none, none, none, np.zeros((0, 3)))


@message
class Members:
    """What a step did to the b bodies of a pile that took it, in the order of `Configure.bodies`; as of `Advanced` and
    its figures."""

    kinetic: Scalars
    """(b,) [J]"""
    strain: Scalars
    gravity: Scalars
    tool_work: Scalars
    dissipated: Scalars
    momentum: Vectors
    """(b, 3) [kg m/s]"""
    angular_momentum: Vectors
    """(b, 3) [kg m^2/s]"""
    penetration: Scalars
    slip: Scalars
    residual: Scalars
    n_contacts: Ids
    """(b,)"""
    iterations: Ids
    n_substeps: Ids
    wrench: BodyWrenches
    """of each on each of the t tools (b, t, 6) [N, N m]"""
    low: Vectors
    """least corner of the box around each (b, 3) [m]"""
    high: Vectors
    notes: list[Note] = field(default_factory=list)
    """of those of whose step there is something to say"""
    interface_work: Scalars = field(default_factory=lambda: np.zeros(0))
    """of other bodies of the pile on each (b,) [J]"""
    meetings: Meetings = field(default_factory=no_meetings)
    on_guests: list[Push] = field(default_factory=list)
    """by all that touch each guest, in the order of `Configure.guests`"""
    fastest: Scalars = field(default_factory=lambda: np.zeros(0))
    """speed of the fastest node of each as the step ends (b,) [m/s]"""


@message
class Begun:
    """The energies that the bodies of a pile begin with, in the order of `Configure.bodies`."""

    kinetic: Scalars
    """(b,) [J]"""
    strain: Scalars
    gravity: Scalars
