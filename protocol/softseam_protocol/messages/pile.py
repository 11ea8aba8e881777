"""Of a pile, several whole bodies that one participant holds as one part: what a step did to each of them."""

from dataclasses import field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.arrays import Array, Count, Ids, Scalars, Vectors
from softseam_protocol.messages.header import message
from softseam_protocol.messages.outcomes import Detail, Status

BodyWrenches = Annotated[NDArray[np.float64], Array("f8", None, None, 6)]


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
class Met:
    """What a contact between two bodies of a pile did in a step."""

    n_points: Count
    """that were near enough to touch"""
    depth: float
    """of a point inside the other body, at most, at the end [m]"""
    force: float
    """largest on a point [N]"""
    work: float
    """on both bodies [J]"""


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
    met: list[Met] = field(default_factory=list)
    """of contacts between bodies of the pile, see `contacts`"""
    interface_work: Scalars = field(default_factory=lambda: np.zeros(0))
    """of other bodies of the pile on each (b,) [J]"""
    fastest: Scalars = field(default_factory=lambda: np.zeros(0))
    """speed of the fastest node of each as the step ends (b,) [m/s]"""
    contacts: Ids = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    """numbers of the contacts that `met` is of, among all between bodies of the pile in the order of the scene's
    interfaces, ascending (m,): those of which a body is awake"""
    pressed: Vectors = field(default_factory=lambda: np.zeros((0, 3)))
    """force of the second body of each of these on the first as the step ends (m, 3) [N]"""


@message
class Begun:
    """The energies that the bodies of a pile begin with, in the order of `Configure.bodies`."""

    kinetic: Scalars
    """(b,) [J]"""
    strain: Scalars
    gravity: Scalars
