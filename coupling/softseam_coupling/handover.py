"""One state of the whole body out of two sides, at a region switch, with momentum and angular momentum kept exactly.

Sides a and b hold the same node i with their own share of the mass. Merged: m = m_a + m_b and

    x = (m_a x_a + m_b x_b) / m,   v = (m_a v_a + m_b v_b) / m                    (1)

keep P and the centre of mass. Angular momentum changes by the work of the gap, with the reduced mass mu = m_a m_b / m,

    D = L_before - L_after = sum_i mu_i (x_a - x_b) x (v_a - v_b)                 (2)

and is repaired by the velocity change dv of least kinetic norm sum m |dv|^2 with sum m dv = 0 and sum m x x dv = D. Its
stationarity gives dv_i = a + omega x x_i: the 6 x 6 system in (a, omega) splits about the centre of mass c of the
corrected nodes, with r = x - c, into

    dv_i = omega x r_i,   (sum m (|r|^2 I - r r^T)) omega = D                     (3)

The corrected nodes are the merged ones; all free nodes where those lie on a line or a point, so that (3) is singular.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

__all__ = ["HandOver", "Side", "angular_momentum", "merge_sides"]

SINGULAR = 1e-6
"""least eigenvalue of the inertia over the largest below which the merged nodes count as lying on a line"""


@dataclass(frozen=True, slots=True)
class Side:
    """One region's nodes (n,)."""

    nodes: Ints
    """global node ids, each at most once (n,)"""
    mass: Floats
    """this region's share of each node's mass (n,) [kg]"""
    x: Floats
    """positions (n, 3) [m]"""
    v: Floats
    """velocities (n, 3) [m/s]"""


@dataclass(frozen=True, slots=True)
class HandOver:
    """The merged body (N nodes)."""

    mass: Floats
    """(N,) [kg]"""
    x: Floats
    """(N, 3) [m]"""
    v: Floats
    """(N, 3) [m/s]"""
    gap: float
    """largest distance between the two copies of a node [m]"""


def angular_momentum(mass: Floats, x: Floats, v: Floats) -> Floats:
    """Angular momentum about the origin, sum m x cross v (3,) [kg m^2/s]."""
    momentum = mass[:, None] * v
    return np.array(
        [
            x[:, 1] @ momentum[:, 2] - x[:, 2] @ momentum[:, 1],
            x[:, 2] @ momentum[:, 0] - x[:, 0] @ momentum[:, 2],
            x[:, 0] @ momentum[:, 1] - x[:, 1] @ momentum[:, 0],
        ]
    )


def merge_sides(near: Side, far: Side, n_nodes: int, fixed: NDArray[np.bool_] | None = None) -> HandOver:
    """Merge two sides that together cover all n_nodes nodes of the body; a side may be empty.

    fixed  (N,)  clamped nodes: merged, but never moved by the repair
    """
    mass = np.zeros(n_nodes)
    mass[near.nodes] += near.mass
    mass[far.nodes] += far.mass
    if not (mass > 0.0).all():
        raise ValueError(
            f"{int(np.count_nonzero(~(mass > 0.0)))} nodes have no mass: the two sides must cover the body"
        )
    x, v = np.empty((2, n_nodes, 3))
    x[near.nodes], v[near.nodes] = near.x, near.v
    x[far.nodes], v[far.nodes] = far.x, far.v
    shared, a, b = np.intersect1d(near.nodes, far.nodes, assume_unique=True, return_indices=True)
    if len(shared) == 0:
        return HandOver(mass, x, v, 0.0)
    weight = (near.mass[a] / mass[shared])[:, None]
    gap, jump = near.x[a] - far.x[b], near.v[a] - far.v[b]
    x[shared] = far.x[b] + weight * gap  # eq. (1): where the two agree, the value stays bit for bit
    v[shared] = far.v[b] + weight * jump
    mu = near.mass[a] * far.mass[b] / mass[shared]
    defect = (mu[:, None] * np.cross(gap, jump)).sum(axis=0)  # eq. (2)
    if defect.any():
        free = np.ones(n_nodes, dtype=np.bool_) if fixed is None else ~fixed
        change = _spin(mass[shared] * free[shared], x[shared], defect)
        nodes = shared
        if change is None:
            nodes = np.arange(n_nodes, dtype=shared.dtype)
            change = _spin(mass * free, x, defect)
        if change is not None:
            change[~free[nodes]] = 0.0
            v[nodes] += change
    largest = float(np.sqrt((gap * gap).sum(axis=1).max()))
    return HandOver(mass, x, v, largest)


def _spin(mass: Floats, x: Floats, defect: Floats) -> Floats | None:
    """The velocity change of eq. (3) (n, 3) [m/s], or None where the inertia is singular; no mass, no say."""
    total = mass.sum()
    if not total > 0.0:
        return None
    r = x - (mass @ x) / total
    second = (mass[:, None] * r).T @ r
    inertia = np.trace(second) * np.eye(3) - second
    values = np.linalg.eigvalsh(inertia)
    if not values[0] > SINGULAR * values[-1]:
        return None
    change: Floats = np.cross(np.linalg.solve(inertia, defect), r)
    return change
