"""XPBD's matrix for the stresses of all blocks of a region, as they stand; see `spectrum`.

A block's multipliers are what it applies, Lambda = (P, T), conjugate to (F, q), which are linear in its nodes (see
`kernels.block`): J is constant, and alpha~^-1 = h^2 H with H = V d^2 U/d(F, q)^2 (21, 21). H has no inverse, as turns
cost nothing; so A is taken in the scale of its compliance, 1 + h^2 H^1/2 J W J^T H^1/2, and then scaled by the blocks
of its diagonal, which scale it could have had before. Where a squeezed block would give way, H is taken as zero.
"""

import numpy as np

from softseam_services.body.body import Floats

from .kernels.block import new_workspace
from .kernels.block_rows import N_STRESS
from .kernels.damping import damping_share
from .kernels.lanes import LANES, aligned
from .kernels.sweep import block_forces, exact_stress
from .model import PbdModel
from .parameters import PbdParameters
from .spectrum import Spectrum, spectrum_of_blocks

N_MULTIPLIERS = N_STRESS // LANES
"""of a block"""
_STEP = 1e-6
"""of central differences, in shortest edges of blocks"""


def block_spectrum(model: PbdModel, parameters: PbdParameters, x: Floats, dt: float) -> Spectrum:
    """Of the blocks of a region, of its nodes at x (n, 3) [m], in the substeps of a step of dt [s]."""
    substep = dt / parameters.substeps(dt)
    numbers = parameters.arrays
    share = damping_share(numbers.stiffness_time, numbers.lag, substep, parameters.spec.sweeps)
    h = substep * np.sqrt(1.0 + share)  # as of `kernels.relax`
    J, H = block_tangents(model, parameters, x)
    values, vectors = np.linalg.eigh(H)
    root = np.einsum("bij,bj,bkj->bik", vectors, np.sqrt(np.maximum(values, 0.0)), vectors)
    nodes = model.blocks.nodes.transpose(0, 2, 1)[model.blocks.order >= 0]
    weight = np.sqrt(parameters.arrays.inverse_mass[nodes])
    gradient = h * root @ (J.reshape(len(nodes), N_MULTIPLIERS, 8, 3) * weight[:, None, :, None]).reshape(J.shape)
    columns = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 24)
    return spectrum_of_blocks(gradient, columns, 3 * model.n_nodes)


def block_tangents(model: PbdModel, parameters: PbdParameters, x: Floats) -> tuple[Floats, Floats]:
    """J = d(F, q)/dx (b, 21, 24) and H (b, 21, 21) of blocks with nodes at x (n, 3) [m], by central differences of
    the stress: on a copy in which each block has eight nodes of its own."""
    own, numbers = model.blocks, parameters.blocks
    law, constants, volume = numbers.law, numbers.constants, numbers.volume
    places = np.concatenate([x, numbers.padding_x])[own.nodes]
    nodes = np.arange(own.nodes.size, dtype=np.int32).reshape(own.nodes.shape)
    xw, force, stress = aligned(own.nodes.size, 4), aligned(own.nodes.size, 4), aligned(own.n_batches, N_STRESS)
    by_place, ws, n = xw.reshape(*own.nodes.shape, 4), new_workspace(), own.n_batches
    real, step = own.order >= 0, _STEP * float(numbers.edges.min())
    J = np.empty((int(real.sum()), N_MULTIPLIERS, 24))
    for number in range(N_MULTIPLIERS):
        stress[:], force[:] = 0.0, 0.0
        stress[:, LANES * number : LANES * (number + 1)] = 1.0
        block_forces(ws, nodes, stress, constants, force, 0, n)
        J[:, number] = -_of_blocks(force.reshape(by_place.shape)[..., :3])[real].reshape(-1, 24)
    S = np.empty_like(J)
    for node, axis in np.ndindex(8, 3):
        found = []
        for side in (step, -step):
            by_place[..., :3] = places
            by_place[:, node, :, axis] += side
            exact_stress(ws, xw, nodes, volume, stress, constants, law)
            found.append(stress.reshape(n, N_MULTIPLIERS, LANES).transpose(0, 2, 1)[real])
        S[:, :, 3 * node + axis] = (found[0] - found[1]) / (2.0 * step)
    transposed = J.transpose(0, 2, 1)
    H = S @ transposed @ np.linalg.inv(J @ transposed)  # S = H J, and J has full rank
    return J, 0.5 * (H + H.transpose(0, 2, 1))


def _of_blocks(by_place: Floats) -> Floats:
    """From (batch, node, lane, ...) to (batch, lane, node, ...)."""
    return np.ascontiguousarray(np.swapaxes(by_place, 1, 2))
