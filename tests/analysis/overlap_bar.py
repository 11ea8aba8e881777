"""A bar of coarse cells that goes over into one of finer cells, by a sharp seam or an overlap; what it reflects.

E A = rho A = 1 and coarse cells of length 1, so waves travel at 1. The near side is the coarse one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from analysis.arlequin import Cells, overlapping, shares
from analysis.linear_study.integrators import LinearSide

Floats = NDArray[np.float64]
Share = Callable[[Floats, int], Floats]
"""alpha at places (n,) in a layer of so many coarse cells"""


def stepped(x: Floats, layer: int) -> Floats:
    """Constant in each coarse cell, as `shares` has it."""
    return np.asarray(shares(layer)[np.clip(np.floor(x).astype(int), 0, layer - 1)])


def linear(x: Floats, layer: int) -> Floats:
    """The textbook's: 1 where the layer begins, 0 where it ends."""
    return 1.0 - x / layer


def cells(n: int, length: float, share: Floats) -> Cells:
    nodes = np.arange(n)[:, None] + np.arange(2)
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]]) / length
    return Cells(nodes, np.full((n, 2), 0.5 * length), np.tile(spring, (n, 1, 1)), share)


def sides(
    n_near: int, n_far: int, ratio: int, layer: int, share: Share = stepped
) -> tuple[LinearSide, LinearSide, Floats, Floats]:
    """Near and far side, and the places of their nodes; the layer begins at 0.

    n_near, n_far: coarse cells beside it; ratio: fine cells in one; layer: coarse cells that both have, 0: sharp seam.
    """
    x_near = np.arange(-n_near, layer + 1.0)
    x_far = np.arange(ratio * (layer + n_far) + 1.0) / ratio
    near_share, far_share = np.ones(len(x_near) - 1), np.ones(len(x_far) - 1)
    if layer:
        near_share[n_near:] = share(x_near[n_near:-1] + 0.5, layer)
        far_share[: ratio * layer] = 1.0 - share(0.5 * (x_far[: ratio * layer] + x_far[1 : ratio * layer + 1]), layer)
    tied = np.array([(n_near + i, ratio * i) for i in range(layer + 1)])
    near = cells(len(near_share), 1.0, near_share)
    far = cells(len(far_share), 1.0 / ratio, far_share)
    return (*overlapping(near, far, tied), x_near, x_far)


def reflected(nodes_a_wave: float, ratio: int, layer: int, share: Share = stepped) -> float:
    """Energy that comes back of a wave of so many coarse nodes, of what came, both sides being endless [1].

    At the frequency omega = 2 sin(pi/nodes) of lumped cells; beyond the ends u goes on as exp(i q) from node to node,
    with 2 sin(q/2) = omega times the cell's length. Nothing is cut off, so there is no noise floor.
    """
    near, far, x_near, _ = sides(4, 4, ratio, layer, share)
    omega = 2.0 * np.sin(np.pi / nodes_a_wave)
    q_near, q_far = 2.0 * np.pi / nodes_a_wave, 2.0 * np.arcsin(0.5 * omega / ratio)
    n, m, s = near.n, far.n, len(near.link)
    whole = np.zeros((n + m + s, n + m + s), dtype=np.complex128)
    whole[:n, :n] = near.stiffness - omega**2 * near.mass
    whole[n : n + m, n : n + m] = far.stiffness - omega**2 * far.mass
    whole[n + m :, :n], whole[n + m :, n : n + m] = near.link, far.link
    whole[: n + m, n + m :] = whole[n + m :, : n + m].T
    load = np.zeros(n + m + s, dtype=np.complex128)
    came = np.exp(1j * q_near * x_near[0])
    whole[0, 0] += 1.0 - np.exp(1j * q_near) - 0.5 * omega**2
    load[0] = came * (np.exp(-1j * q_near) - np.exp(1j * q_near))
    whole[n + m - 1, n + m - 1] += ratio * (1.0 - np.exp(1j * q_far)) - 0.5 * omega**2 / ratio
    return float(abs(np.linalg.solve(whole, load)[0] - came) ** 2)


def sharp_seam(nodes_a_wave: float, ratio: int) -> float:
    """The same in closed form, layer 0: ((Z_near - Z_far)/(Z_near + Z_far))^2, Z = sqrt(1 - (omega dx/2)^2)."""
    half = np.sin(np.pi / nodes_a_wave)
    near, far = np.sqrt(1.0 - half**2), np.sqrt(1.0 - (half / ratio) ** 2)
    return float(((near - far) / (near + far)) ** 2)
