"""How a linked step is settled: the force that moves the far side on, and what the sides would have replied."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from softseam_coupling.kernels.link import settled
from softseam_coupling.kernels.push import push_far
from softseam_coupling.mortar import SeamTie
from softseam_protocol.messages import Advanced
from softseam_protocol.quickly_made import altered
from softseam_services.orchestrator.sides import FAR, NEAR

Floats = NDArray[np.float64]

_LEAST_RCOND = 1e-9
"""reciprocal condition of a compliance that is not singular [1]"""
_MORE = 1e-6
"""of a singular one, by which it yields more everywhere [1]"""


class Settling:
    """The far side's compliance, and where the seam's nodes were; both evolve. s nodes."""

    def __init__(self, tie: SeamTie, n_nodes: int):
        self._tie, self._shape = tie, (n_nodes, 3)
        self._p = np.zeros((0, 0)) if tie.p is None else tie.p
        self._yields = self._stiffness = self._singular = np.zeros((0, 0))
        self._factor: tuple[Floats, NDArray[np.int32]]  # of the compliance that the image has
        self._x = np.zeros((2, 2, n_nodes, 3))  # seam nodes of near and far where the last step began and ended
        self._n_left = 0  # of these two places, those that are known

    @property
    def known(self) -> bool:
        """Whether the far side has told its compliance."""
        return self._yields.size > 0

    def know(self, compliance: Floats, stiffness: Floats) -> Floats:
        """Keep the far side's compliance and its inverse; its symmetric part as the near side sees it.

        Nodes that follow others (coarse cells, decision 26) make it singular: it then yields a millionth more
        everywhere, and what that is off by is asked for again.
        """
        h = self._tie.far_compliance(compliance)
        self._yields, self._stiffness = np.ascontiguousarray(compliance.T), stiffness
        self._singular = np.zeros((0, 0))
        norm = float(np.abs(h).sum(axis=0).max())
        factor, pivots, _ = lapack.dgetrf(h)
        if not lapack.dgecon(factor, norm)[0] > _LEAST_RCOND:
            self._singular = h
            factor, pivots, _ = lapack.dgetrf(h + _MORE * norm * np.eye(len(h)))
        self._factor = factor, pivots
        return 0.5 * (h + h.T)

    def bend(
        self, given: Floats, change: Floats, image: Floats, near_x: Floats, near_moved: Floats, free: bool
    ) -> tuple[Floats, Floats, float]:
        """Force on the far side's seam nodes that moves its image by -given (s, 3) [m], their moves, the gap left [m].

        A far side that touches nothing, `free`, gets exactly the impulse of the multiplier's `change` (s, 3) [N]:
        nothing is there to take a part of the force.
        """
        flat = given.reshape(-1)
        bent = lapack.dgetrs(*self._factor, flat)[0]
        if self._singular.size:
            bent += lapack.dgetrs(*self._factor, flat - self._singular @ bent)[0]
        force, moved = np.empty((2, *self._shape))
        gap = push_far(
            *(bent, free, change.reshape(-1), image.reshape(-1), self._stiffness, self._p, self._yields),
            *(near_x.reshape(-1), near_moved.reshape(-1), force.reshape(-1), moved.reshape(-1)),
        )
        return force, moved, gap

    def replies(
        self,
        solved: Mapping[str, Advanced],
        forces: Mapping[str, Floats],
        moves: Mapping[str, Floats],
        final: Mapping[str, Floats],
        dt: float,
    ) -> dict[str, Advanced]:
        """The replies as they would be of the settled step, which ends here.

        forces  on each side's seam nodes as the step was solved, and `final` as it is settled (s, 3) [N]
        moves   by which its nodes are moved on (s, 3) [m]
        """
        replies = {
            name: _settled(reply, self._way(reply, side), moves[name], forces[name], final[name], dt)
            for side, (name, reply) in enumerate(solved.items())
        }
        self.leave(replies)
        return replies

    def _way(self, reply: Advanced, side: int) -> Floats:
        """Where a side's last step and this one began (2, s, 3) [m].

        Where a cut's state was not told, its first step is taken as from rest, the second as going on at its own pace.
        """
        if not self._n_left:
            return np.stack([reply.seam_x, reply.seam_x])
        start = self._x[side, 1]
        return self._x[side] if self._n_left > 1 else np.stack([2.0 * start - reply.seam_x, start])

    def begin(self, x: Floats, way: Floats) -> None:
        """The cut begins with the seam's nodes at x, moving by `way` in a step (s, 3) [m]."""
        self._x[:, 0], self._x[:, 1], self._n_left = x - way, x, 2

    def stretch(self, share: float) -> None:
        """Steps are so many times as long from now on: so is what the last one went [1]."""
        self._x[:, 0] = self._x[:, 1] - share * (self._x[:, 1] - self._x[:, 0])

    def leave(self, replies: Mapping[str, Advanced]) -> None:
        """The step ended so."""
        self._n_left = min(self._n_left + 1, 2)
        self._x[:, 0] = self._x[:, 1]
        self._x[0, 1], self._x[1, 1] = replies[NEAR].seam_x, replies[FAR].seam_x

    @property
    def moves(self) -> bool:
        """Whether it is known where the last step began."""
        return self._n_left > 1

    def last_way(self) -> Floats:
        """What the near side's nodes moved by in the last step (s, 3) [m]."""
        way: Floats = self._x[0, 1] - self._x[0, 0]
        return way

    def to_arrays(self) -> dict[str, Floats]:
        """What evolves but the compliance."""
        return {"link_x": self._x.copy(), "link_n_left": np.array([self._n_left], dtype=np.float64)}

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`."""
        self._x, self._n_left = np.array(arrays["link_x"]), int(arrays["link_n_left"][0])


def _settled(reply: Advanced, x: Floats, moved: Floats, force: Floats, final: Floats, dt: float) -> Advanced:
    """A reply as it would be of the settled step; contact figures stay those of the step as it was solved.

    x       where the last step and this one began (2, s, 3) [m]
    moved   how the seam's nodes are moved on (s, 3) [m]
    force   on them as the step was solved, and `final` as it is settled (s, 3) [N]
    """
    seam_x, momentum, angular = reply.seam_x.copy(), reply.momentum.copy(), reply.angular_momentum.copy()
    work, kinetic, strain = settled(seam_x, moved, x[0], x[1], force, final, dt, momentum, angular)
    return altered(
        reply,
        seam_x=seam_x,
        seam_force=final,
        seam_work=work,
        kinetic=reply.kinetic + kinetic,
        strain=reply.strain + strain,
        momentum=momentum,
        angular_momentum=angular,
        fields=None,
    )
