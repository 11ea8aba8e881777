"""The condition number of XPBD's system for the multipliers of a body, as it stands, and what it means for sweeps.

Of blocks (see `spectrum`) the multipliers are what each applies, Lambda = (P, T), conjugate to (F, q), which are linear
in its nodes (see `kernels.block`): J is constant, and alpha~^-1 = h^2 H with H = V d^2 U/d(F, q)^2 (21, 21). H has no
inverse, as turns cost nothing; so A is taken in the scale of its compliance, 1 + h^2 H^1/2 J W J^T H^1/2, and then
scaled by the blocks of its diagonal, which scale it could have had before. Where a squeezed block would give way, H is
taken as zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import Frame
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Floats
from softseam_services.body.build import AnyBody
from softseam_services.body.region import build_region
from softseam_services.server import build_setup
from softseam_services.tools.tool_set import ToolSet

from .kernels.block import new_workspace
from .kernels.block_rows import N_STRESS
from .kernels.damping import damping_share
from .kernels.lanes import LANES, aligned
from .kernels.sweep import block_forces, exact_stress
from .model import PbdModel, build_model
from .parameters import PbdParameters, build_parameters
from .particles import model as particles_model
from .particles import parameters as particles_parameters
from .particles.condition import particle_spectrum
from .particles.constraints import constraints_of
from .spectrum import LARGEST, Spectrum, spectrum_of_blocks


@dataclass(frozen=True)
class Condition:
    """Of one body as it stands."""

    spectrum: Spectrum
    """of the system, each constraint or block scaled by its own"""
    substeps: int
    """of a step"""
    sweeps: int
    """of a substep"""


def condition_of(
    scene: Scene, body: AnyBody, tools: ToolSet, x: Floats, near: NDArray[np.bool_] | None = None
) -> Condition | None:
    """Of the body of a scene with that body alone, with nodes at x (N, 3) [m]; None where no XPBD moves it, or it has
    more than `LARGEST` unknowns, which would take longer than most runs.

    near  which cells are, of a body in cells that is cut (C,); None: as where it is not
    """
    spec = scene.models.pbd
    if spec.method != "xpbd" or 3 * len(x) > LARGEST:
        return None
    if not body.has_cells:
        numbers = particles_parameters.build_parameters(
            particles_model.build_model(body, spec), body, tools, spec, constraints_of(scene)
        )
        substeps = numbers.substeps(scene.step)
        found = particle_spectrum(body, numbers.joined, x, scene.step / substeps)
        return None if found is None else Condition(found, substeps, spec.sweeps)
    cells = _cells(scene, body, near)
    if not len(cells):
        return None
    region = build_region(body, cells, np.zeros(0, dtype=np.int32))
    model = build_model(body, region, tools, spec)
    parameters = build_parameters(model, body, region, tools, spec)
    spectrum = block_spectrum(model, parameters, x[region.nodes], scene.step)
    return Condition(spectrum, parameters.substeps(scene.step), spec.sweeps)


def _cells(scene: Scene, body: Body, near: NDArray[np.bool_] | None) -> NDArray[np.int32]:
    """Those that XPBD moves."""
    cut = np.zeros(body.n_cells, dtype=np.bool_) if near is None else near
    default, of_near = scene.regions.models
    models = np.where(cut, of_near == "pbd", default == "pbd")
    return np.flatnonzero(models).astype(np.int32)


def conditions(bundle: Bundle, start: Mapping[str, Frame], end: Mapping[str, Frame]) -> dict[str, Any]:
    """Of each body of a scene that XPBD moves, from its fields at the start and at the end: numbers and a sentence."""
    found: dict[str, Any] = {}
    for name in start:
        setup = build_setup(bundle, name)
        begun, ended = (
            condition_of(setup.scene, setup.body, setup.tools, frame.x, np.asarray(frame.cell_near, dtype=np.bool_))
            for frame in (start[name], end[name])
        )
        known = ended or begun
        if known is not None:
            found[name] = {
                "start": None if begun is None else begun.spectrum.condition,
                "end": None if ended is None else ended.spectrum.condition,
                "sweeps_for_a_tenth": known.spectrum.sweeps,
                "sweeps": known.sweeps,
                "substeps": known.substeps,
            }
            found[name]["text"] = sentence(found[name])
    return found


def sentence(condition: Mapping[str, Any]) -> str:
    """What a condition number means for the number of sweeps."""
    numbers = [
        f"{condition[key]:.3g} at the {key}" if condition[key] is not None else f"none at the {key}, which is FEM's"
        for key in ("start", "end")
    ]
    taken, wanted = (_counted(condition[key], "sweep") for key in ("sweeps", "sweeps_for_a_tenth"))
    text = f"condition number of XPBD's system: {', '.join(numbers)}, in {_counted(condition['substeps'], 'substep')} "
    text += f"a step. The slowest part of an error falls to a tenth in some {wanted}; a substep takes {taken}"
    if condition["sweeps_for_a_tenth"] > condition["sweeps"]:
        text += ", and leaves the rest to the next: shorter substeps need fewer"
    return text


def _counted(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


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
