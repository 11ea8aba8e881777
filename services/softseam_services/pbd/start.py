"""The state that a PBD region begins with: at rest, or as it was handed over."""

import numpy as np

from softseam_protocol.messages.participant import BodyState
from softseam_services.body.body import Body, Region
from softseam_services.body.internal import internal_of

from .internal import to_blocks
from .kernels.sweep import batch_energies, block_forces, exact_stress, strain_energy
from .levels import thin_out
from .model import PbdModel
from .parameters import PbdParameters
from .points import hand_on
from .state import PbdState
from .step import StepScratch


def start_state(
    model: PbdModel,
    parameters: PbdParameters,
    body: Body,
    region: Region,
    handed: BodyState | None,
    scratch: StepScratch,
    state: PbdState,
) -> None:
    """Fill a state, in place, so that a body at rest in equilibrium stays exactly where it is.

    handed: the body as another participant had it; None: at rest
    """
    ws, xw, figures = scratch.ws, scratch.arrays.xw, scratch.arrays.figures
    if handed is None:
        state.x[:] = parameters.arrays.x_rest
        state.v[:] = body.v_initial[region.nodes]
    else:
        state.x[:] = handed.x[region.nodes]
        state.v[:] = handed.v[region.nodes]
        tool = handed.contact_tool[region.points]
        touching = np.flatnonzero((tool >= 0) & (tool < model.n_tools))
        state.force[touching, tool[touching]] = handed.contact_force[region.points[touching]]
        hand_on(state.force, model.touches, model.n_surface, (model.indptr, model.node, parameters.arrays.weight))
        state.force_mean[:] = state.force
    state.v[region.fixed] = 0.0
    if handed is not None:
        thin_out(model.levels, region, parameters.arrays.mass, state.x, state.v)
    model.levels.follow(state.x, state.v)
    blocks, numbers = model.blocks, parameters.blocks
    to_blocks(blocks, model.levels.coarse, internal_of(body, handed, region.cells), state.memory)
    numbers.hold(state.memory)
    n = model.n_nodes
    xw[:n, :3] = state.x
    exact_stress(ws, xw, blocks.nodes, numbers.volume, state.stress, numbers.constants, numbers.law)
    force = np.zeros((n + 8, 4))
    block_forces(ws, blocks.nodes, state.stress, numbers.constants, force, 0, blocks.n_batches)
    rows = np.repeat(np.arange(model.n_points), np.diff(model.indptr))
    np.add.at(force[:, :3], model.node, parameters.arrays.weight[:, None] * state.force.sum(axis=1)[rows])
    state.a[:] = parameters.arrays.inverse_mass[:, None] * force[:n, :3]
    batch_energies(
        *(ws, xw, blocks.nodes, numbers.volume, numbers.constants, numbers.law, 0, blocks.n_batches),
        figures,
    )
    strain, least_j = strain_energy(figures)
    kinetic = 0.5 * float(parameters.arrays.mass @ np.einsum("nc,nc->n", state.v, state.v))
    gravity = -float(parameters.arrays.mass @ ((state.x - parameters.arrays.x_rest) @ parameters.arrays.gravity))
    stretch = float((np.ptp(state.x, axis=0).max()) / np.ptp(parameters.arrays.x_rest, axis=0).max())
    state.monitor[:] = least_j, kinetic, strain, gravity, float(handed is not None), 0.0, stretch, 0.0, 0.0
