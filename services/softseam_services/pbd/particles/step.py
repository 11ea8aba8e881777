"""One step of a body of particles, and how well its constraints are met after it."""

import math
from enum import Enum
from typing import NamedTuple

import numpy as np

from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.participant import ToolMotion
from softseam_services.body.body import Floats
from softseam_services.body.turning import Turning

from .kernels import bending, distance, neo_hookean, strain, volume
from .kernels import summary as k
from .kernels.constraint import constraint_energy
from .kernels.grip import take_hold
from .kernels.substep import CROWDED, TOOL_WORK, advance_step
from .model import ParticleModel
from .parameters import ParticleParameters
from .records import ParticleState, new_inputs, new_outputs, new_scratch, new_state


class Fault(Enum):
    """Outcome of a step, in words that name the remedy, and in one."""

    NONE = "converged", Status.CONVERGED
    INPUT = "the request cannot be served", Status.REFUSED
    DIVERGED = "the particles diverged: take a shorter step or more substeps", Status.DIVERGED
    CROWDED = (
        "more layers touch than are followed: some may cross; use fewer divisions or a smaller thickness",
        Status.DOUBTFUL,
    )

    def __init__(self, text: str, status: Status) -> None:
        self.text, self.status = text, status


class StepResult(NamedTuple):
    """What came of a step beside the state; arrays are those of the scratch, which the next step overwrites."""

    fault: Fault
    sweeps: int
    tool_work: float
    """of the tools on the body [J]"""
    figures: Floats
    """see `kernels.summary` (N_RESULTS,)"""
    wrench: Floats
    """on the body (t, 6) [N, N m]"""
    measure: Floats
    """how springs, bends, strains, pairs, what the scene adds and volumes are met, see `distance.measure_distances`
    (6, 6)"""


class StepScratch:
    """What steps on one structure write to; it belongs to one solver."""

    def __init__(self, model: ParticleModel, parameters: ParticleParameters, dt: float) -> None:
        """dt: of the steps that are expected [s]"""
        n, t = model.n_nodes, len(parameters.tools.names)
        self.inputs, self.outputs = new_inputs(t), new_outputs(n, t)
        self.next = new_state(n, t, parameters.body.solid is not None)
        """the state that a step fills; who keeps it puts another in its place"""
        self.measure = np.zeros((6, 6))
        self.strain = np.zeros(n + 8)
        """largest strain of a constraint at each particle [1]"""
        self.parameters, self.dt = parameters, dt
        self.substeps = parameters.substeps(dt)
        """of a step of dt"""
        self.arrays = new_scratch(model.arrays, parameters.arrays, parameters.joined.most)
        self.turning = _free_to_turn(parameters)

    def fit(self, model: ParticleModel, parameters: ParticleParameters, dt: float) -> None:
        """Make ready for steps of dt [s] with these parameters."""
        if parameters is not self.parameters or dt != self.dt:
            if parameters is not self.parameters:
                self.arrays = new_scratch(model.arrays, parameters.arrays, parameters.joined.most)
                self.turning = _free_to_turn(parameters)
            self.parameters, self.dt = parameters, dt
            self.substeps = parameters.substeps(dt)


def _free_to_turn(parameters: ParticleParameters) -> Turning | None:
    """What gives a rotation back; None of a body that is clamped."""
    return None if (parameters.arrays.weight == 0.0).any() else Turning(parameters.body.mass)


def step(
    model: ParticleModel,
    parameters: ParticleParameters,
    state: ParticleState,
    inputs: ToolMotion,
    dt: float,
    scratch: StepScratch,
) -> tuple[ParticleState, StepResult]:
    """A step of dt [s] from a state; the new state is `scratch.next`, the old one where the particles diverged."""
    scratch.fit(model, parameters, dt)
    work, outputs = scratch.next, scratch.outputs
    np.copyto(work.buffer, state.buffer)
    advance(model, parameters, inputs, dt, scratch.substeps, scratch)
    if outputs.result[k.FINITE] == 0.0 or not math.isfinite(outputs.outcome[TOOL_WORK]):
        return work, stay(state, scratch)._replace(fault=Fault.DIVERGED)
    measure(model, parameters, scratch)
    work.strain[0] = scratch.measure[:, 0].sum()
    fault = Fault.CROWDED if outputs.outcome[CROWDED] else Fault.NONE
    sweeps = scratch.substeps * parameters.spec.sweeps
    figures = outputs.result, outputs.wrench, scratch.measure
    return work, StepResult(fault, sweeps, float(outputs.outcome[TOOL_WORK]), *figures)


def stay(state: ParticleState, scratch: StepScratch) -> StepResult:
    """There is no step: the body is where it was, and `scratch.next` is the state."""
    np.copyto(scratch.next.buffer, state.buffer)
    outputs = scratch.outputs
    for array in (outputs.result, outputs.outcome, scratch.measure, outputs.wrench):
        array[:] = 0.0
    scratch.next.strain[0] = 0.0
    return StepResult(Fault.INPUT, 0, 0.0, outputs.result, outputs.wrench, scratch.measure)


def advance(
    model: ParticleModel,
    parameters: ParticleParameters,
    inputs: ToolMotion,
    dt: float,
    n_substeps: int,
    scratch: StepScratch,
) -> None:
    """Take the step, of `scratch.next` in place."""
    given, outputs, work, numbers = scratch.inputs, scratch.outputs, scratch.next, parameters.arrays
    given.position[:], given.orientation[:] = inputs.position, inputs.orientation
    given.position_next[:], given.orientation_next[:] = inputs.position_next, inputs.orientation_next
    given.gripping[:] = 0
    if parameters.body.solid is None:
        given.gripping[: len(inputs.gripping)] = inputs.gripping
    take_hold(numbers, work, given)
    arrays, turning = scratch.arrays, scratch.turning
    begun = (work.x.copy(), work.v.copy()) if turning is not None and (work.held < 0.0).all() else None
    count = advance_step(model.arrays, numbers, work, given, arrays, outputs, dt, n_substeps, parameters.spec.sweeps)
    if turning is not None and begun is not None:
        alone = numbers.drag == 0.0 and not outputs.wrench.any()
        turning.end_of_substeps(begun, work.x, work.v, dt, n_substeps, alone)
    k.summarise(numbers, work, given, arrays.contacts, outputs, count)


def measure(model: ParticleModel, parameters: ParticleParameters, scratch: StepScratch) -> None:
    """Energies and violations of all families as particles and multipliers stand, into scratch.measure and strain."""
    arrays, numbers, found, strains = model.arrays, parameters.arrays, scratch.measure, scratch.strain
    of, xw, h = scratch.arrays.multipliers, scratch.arrays.xw, scratch.dt / scratch.substeps
    strains[:] = 0.0
    distance.measure_distances(
        *(xw, arrays.springs, arrays.spring_row, numbers.spring_rest, of.spring_soft, of.spring, h, strains, found[0])
    )
    bending.measure_bends(
        *(xw, arrays.bends, arrays.bend_row, numbers.bend_coefficient, of.bend_soft, of.bend, h),
        *(parameters.body.spacing, found[1]),
    )
    strain.measure_strains(
        *(xw, arrays.tetrahedra, arrays.tetrahedron_row, numbers.strain_inverse, of.strain_soft, of.strain, h),
        *(strains, found[2]),
    )
    neo_hookean.measure_pairs(
        *(xw, arrays.paired, model.paired.row, numbers.pair_inverse, numbers.pair_compliance, of.pair_soft, of.pair),
        *(strains, found[3]),
    )
    volume.measure_volumes(xw, arrays.volumes, arrays.volume_row, numbers.volume_rest, of.volume, h, found[5])
    found[4, 0] = constraint_energy(
        *(xw, numbers.families, numbers.particle, numbers.parameter, of.joined_soft, of.joined),
        *(scratch.arrays.x, scratch.arrays.p, scratch.arrays.g, h),
    )
