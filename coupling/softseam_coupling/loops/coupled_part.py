"""A part as a loop sees it: its coupling nodes' share in the rows of all interfaces, and their compliance.

With B_p (c, n) of part p over all rows, the gap is g = sum_p B_p x_p - offset, and the multipliers lambda put the force
B_p^T lambda on the part's nodes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interface import Interface
from softseam_coupling.loops.loop import wider

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

__all__ = ["HARDLY", "CoupledPart", "gap_of", "laws_of", "parts_of"]

_NONE = np.zeros((0, 0))
HARDLY = 1e-6
"""added to the diagonal of a compliance that is to be inverted, of its mean: stiff directions [1]"""


@dataclass(slots=True)
class CoupledPart:
    """What is known of a part: n coupling nodes, c rows of all interfaces. All but rows and sign evolves."""

    rows: Floats
    """B_p (c, n) [1]"""
    sign: float
    """+1 or -1 where B_p is the identity times that, 0 where it is no such thing"""
    compliance: Floats = field(default_factory=lambda: _NONE)
    """H_p (3n, 3n) [m/N], as reported and updated since; empty: the part reports Y"""
    reported: Floats = field(default_factory=lambda: _NONE)
    """H_p as the part reported it, by which it is corrected (3n, 3n) [m/N]; empty: not reported"""
    reported_inverse: Floats = field(default_factory=lambda: _NONE)
    """its inverse [N/m]; empty: not needed yet"""
    root: Floats = field(default_factory=lambda: _NONE)
    """R with Y = R R^T (3n, r); with an impedance of none Y is H_p"""
    impedance: Floats = field(default_factory=lambda: _NONE)
    """S (3n, 3n) [N/m]; empty: none"""
    asked: Mask = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    """nodes whose answers to forces are wanted (n,): those that rows act on"""

    def look_at_rows(self) -> None:
        """Rows are others: so may be the nodes that are asked for."""
        needed: Mask = np.asarray(self.rows.any(axis=0))
        self.asked = wider(self.asked if len(self.asked) else needed, needed)

    def save(self) -> tuple[Floats, ...]:
        """What of it evolves, for `restore`."""
        return self.compliance, self.reported, self.reported_inverse, self.root, self.impedance

    def restore(self, saved: tuple[Floats, ...]) -> None:
        """Be as `save` found it."""
        self.compliance, self.reported, self.reported_inverse, self.root, self.impedance = saved

    @property
    def pushed(self) -> bool:
        """Whether its unknown is the push of eq. (2)."""
        return self.root.size > 0 and self.impedance.size > 0

    def to_rows(self, vectors: Floats) -> Floats:
        """B_p x (c, 3) of vectors on the part's nodes (n, 3)."""
        return self.sign * vectors if self.sign else np.asarray(self.rows @ vectors)

    def force(self, multipliers: Floats) -> Floats:
        """B_p^T lambda (n, 3) [N]."""
        return self.sign * multipliers if self.sign else np.asarray(self.rows.T @ multipliers)

    def move(self, force: Floats) -> Floats:
        """H_p times a force on its nodes, or Y times a push (n, 3) [m]."""
        flat = force.reshape(-1)
        moved = self.root @ (self.root.T @ flat) if self.root.size else self.compliance @ flat
        return np.asarray(moved.reshape(-1, 3))

    def push_for(self, change: Floats, move: Floats, free: bool) -> tuple[Floats, Floats | None]:
        """The push (n, 3) [N] that moves the part on by `move` (n, 3) [m], and what that is short of it (n, 3) [m].

        None where it is not short: a part whose answer is `change` times what it reported.

        A part is corrected by the compliance that it reported, and knows nothing of updates since. Where it is free of
        contacts the push is the change of force itself, so that it is given exactly that impulse.
        """
        if self.reported is self.compliance or not self.reported.size:
            return change, None
        push = change
        if not free:
            if not self.reported_inverse.size:
                regularised = self.reported.copy()
                regularised.flat[:: len(regularised) + 1] += HARDLY * np.trace(regularised) / len(regularised)
                self.reported_inverse = np.asarray(np.linalg.inv(regularised))
            push = np.asarray((self.reported_inverse @ move.reshape(-1)).reshape(-1, 3))
        return push, np.asarray(move - (self.reported @ push.reshape(-1)).reshape(-1, 3))

    def row_compliance(self) -> Floats:
        """B_p H_p B_p^T (3c, 3c) [m/N]."""
        if self.sign:
            return self.root @ self.root.T if self.root.size else self.compliance
        found = np.zeros((3 * len(self.rows),) * 2)
        self.add_row_compliance(found)
        return found

    def add_row_compliance(self, to: Floats) -> None:
        """Add it to a matrix (3c, 3c), in place; of rows that do not act on the part nothing is looked at."""
        n = self.rows.shape[1]
        mine = np.flatnonzero(self.rows.any(axis=1))
        if not len(mine):
            return
        c, places = len(mine), (3 * mine[:, None] + np.arange(3)).ravel()
        where = (slice(None), slice(None)) if c == len(self.rows) else np.ix_(places, places)
        if self.root.size:
            acted = np.flatnonzero(self.rows.any(axis=0))
            root = self.root.reshape(n, 3, -1)[acted]
            answer = np.tensordot(self.rows[np.ix_(mine, acted)], root, axes=(1, 0)).reshape(3 * c, -1)
            to[where] += answer @ answer.T
            return
        half = np.tensordot(self.rows[mine], self.compliance.reshape(n, 3, n, 3), axes=(1, 0))
        found = np.tensordot(half, self.rows[mine], axes=(2, 1))  # [c, 3, 3, d]
        to[where] += np.moveaxis(found, 3, 2).reshape(3 * c, 3 * c)


def parts_of(interfaces: tuple[Interface, ...], n_nodes: dict[str, int]) -> tuple[dict[str, CoupledPart], Floats]:
    """The parts by name, and the offset of all rows (c, 3) [m], in the order of the interfaces."""
    n_rows = sum(interface.n_rows for interface in interfaces)
    rows = {name: np.zeros((n_rows, n)) for name, n in n_nodes.items()}
    first = 0
    for interface in interfaces:
        own = slice(first, first + interface.n_rows)
        sides = zip(interface.parts, interface.nodes, interface.weights, (1.0, -1.0), strict=True)
        for name, nodes, weights, sign in sides:
            rows[name][own, nodes] += sign * (np.eye(len(nodes)) if weights is None else weights)
        first = own.stop
    offset = np.concatenate([interface.offset for interface in interfaces])
    parts = {name: CoupledPart(b, _sign(b)) for name, b in rows.items()}
    for part in parts.values():
        part.look_at_rows()
    return parts, offset


def laws_of(interfaces: tuple[Interface, ...]) -> tuple[Floats, Floats, Floats]:
    """Of all rows, in the order of the interfaces: the compliance (c,) [m/N]; the normals along which they press (c, 3)
    [1], zero of those that hold, and their friction (c,) [1]; either is empty where no row has any."""
    compliance = [one.compliance if len(one.compliance) else np.zeros(one.n_rows) for one in interfaces]
    normal, friction = np.zeros((0, 3)), np.zeros(0)
    if any(len(one.normal) for one in interfaces):
        normal = np.concatenate([one.normal if len(one.normal) else np.zeros((one.n_rows, 3)) for one in interfaces])
    if any(len(one.friction) for one in interfaces):
        friction = np.concatenate([one.friction if len(one.friction) else np.zeros(one.n_rows) for one in interfaces])
    return np.concatenate(compliance), normal, friction


def _sign(rows: Floats) -> float:
    square = len(rows) > 0 and rows.shape[0] == rows.shape[1]
    return float(next((s for s in (1.0, -1.0) if square and np.array_equal(rows, s * np.eye(len(rows)))), 0.0))


def gap_of(parts: Mapping[str, CoupledPart], x: Mapping[str, Floats], offset: Floats) -> Floats:
    """Of all rows, where the parts' nodes are at x (n, 3) [m] (c, 3) [m]; of velocities with no offset its rate."""
    return sum((part.to_rows(x[name]) for name, part in parts.items()), -offset)
