"""One step of a PBD region: the plan, and what is tried in its place where the monitor does not believe it."""

from typing import NamedTuple

import numpy as np

from softseam_protocol.messages.outcomes import Detail
from softseam_protocol.messages.participant import BodyState, ToolMotion
from softseam_services.body.body import Body, Floats, Region
from softseam_services.body.internal import internal_of
from softseam_services.body.turning import Turning, with_change
from softseam_services.totals import Totals, fastest

from . import watch
from .blocks import to_blocks
from .kernels import summary as k
from .kernels import trust
from .kernels.begin import find_patches, find_slow, give_shape, split_forces
from .kernels.block import new_workspace
from .kernels.leapfrog import advance_leapfrog
from .kernels.pairs import place_points
from .kernels.renew import begin_bending
from .kernels.substep import advance_step
from .kernels.sweep import batch_energies, block_forces, exact_stress, strain_energy
from .levels import thin_out
from .model import PbdModel
from .parameters import PbdParameters
from .points import hand_on
from .records import (
    Inputs,
    Leap,
    Outputs,
    PbdState,
    Scratch,
    new_inputs,
    new_leap,
    new_outputs,
    new_scratch,
    new_state,
    new_used,
)
from .two_threads import TwoThreads

TOUCH = 1e-3
"""gap below which a handed-over point touches a tool, in block edges"""
NO_FORCES, NO_TURN = np.zeros((0, 3)), np.zeros(0)


class StepInputs(NamedTuple):
    """What moves a region in a step: s nodes of its seam."""

    tools: ToolMotion
    seam_force: Floats
    """at the end of the step (s, 3) [N]"""
    seam_force_start: Floats = NO_FORCES
    """and at its start, between which it is linear in time (s, 3); (0, 3) where it is constant"""
    turn: Floats = NO_TURN
    """of the whole body, where it is in several parts, as of `Advance`"""


class StepResult(NamedTuple):
    """What came of a step beside the state; arrays are those of the scratch, which the next step overwrites."""

    fault: watch.Fault
    to_plan: bool
    """whether the first attempt was good"""
    n_substeps: int
    """of the last attempt"""
    sweeps: int
    """of all attempts"""
    notice: dict[Detail, str]
    """what the monitor has to say"""
    figures: Floats
    """see `kernels.summary` (N_RESULTS,)"""
    wrench: Floats
    """on the body (t, 6) [N, N m]"""
    distance: Floats
    """of each cell from the nearest tool (c,) [m]"""
    dissipated: float = 0.0
    """by a material with internal state [J]"""


class StepScratch:
    """What steps on one structure write to, and two threads; it belongs to one solver."""

    def __init__(self, model: PbdModel, parameters: PbdParameters, dt: float) -> None:
        """dt: of the steps that are expected [s]"""
        self.ws = new_workspace()
        self.pair = TwoThreads(self.ws, model.blocks.colours, model.n_nodes)
        self.inputs = new_inputs(model.n_tools, len(model.seam))
        self.outputs = new_outputs(model.n_tools, len(model.cell_nodes))
        sizes = model.n_nodes, model.blocks.n_batches, model.n_points, model.n_tools
        self.next = new_state(*sizes, parameters.blocks.n_state)
        """the state that a step fills; who keeps it puts another in its place"""
        self.parameters, self.dt = parameters, dt
        self.planned = parameters.substeps(dt)
        """substeps of a step of dt, where nothing goes wrong"""
        self.arrays, self.leap = _room(model, parameters, self.planned)
        self.turning = _free_to_turn(model, parameters)

    def write_to(self, result: Floats, wrench: Floats, xw: Floats) -> None:
        """Have steps leave their figures (N_RESULTS,), wrenches (t, 6) and positions (n + 8, 4) in these arrays."""
        self.outputs = Outputs(wrench, self.outputs.distance, result)
        xw[:] = self.arrays.xw
        self.arrays = self.arrays._replace(xw=xw)

    def fit(self, model: PbdModel, parameters: PbdParameters, dt: float) -> None:
        """Make ready for steps of dt [s] with these parameters."""
        if parameters is not self.parameters or dt != self.dt:
            other, self.parameters, self.dt = parameters is not self.parameters, parameters, dt
            self.planned = parameters.substeps(dt)
            if other:
                self.arrays, self.leap = _room(model, parameters, self.planned)
                self.turning = _free_to_turn(model, parameters)
            else:
                self.arrays = self.arrays._replace(used=new_used(parameters.arrays, _most(self.planned)))


def _free_to_turn(model: PbdModel, parameters: PbdParameters) -> Turning | None:
    """What gives a rotation back; None of a region that is held or tied, whose law knows no turns, and of explicit
    steps, which lose nothing."""
    held = ((parameters.arrays.inverse_mass == 0.0) & (parameters.arrays.mass > 0.0)).any()
    keeps = parameters.explicit or parameters.blocks.small
    return None if held or keeps or len(model.seam) else Turning(parameters.arrays.mass)


def _most(planned: int) -> int:
    """Substeps that the last repetition of a step takes at most."""
    return int(planned * 2 ** (trust.RETRIES + trust.SHORTEST))


def _room(model: PbdModel, parameters: PbdParameters, planned: int) -> tuple[Scratch, Leap | None]:
    """What kernels write to in steps of so many substeps."""
    padding_x = parameters.blocks.padding_x
    arrays = new_scratch(model.arrays, parameters.arrays, padding_x, _most(planned))
    return arrays, new_leap(parameters.arrays, padding_x, arrays.figures) if parameters.explicit else None


def step(
    model: PbdModel,
    parameters: PbdParameters,
    state: PbdState,
    inputs: StepInputs,
    dt: float,
    scratch: StepScratch,
) -> tuple[PbdState, StepResult]:
    """A step of dt [s] from a state, tried until the monitor believes it; the new state is `scratch.next`."""
    scratch.fit(model, parameters, dt)
    if state.monitor[trust.UNSHARED] != 0.0:
        share_out(model, parameters, state, inputs.tools, scratch)
    work, result, floor = scratch.next, scratch.outputs.result, parameters.roundoff
    cause, sweeps, fed = "", 0, False
    for number in range(trust.RETRIES + 1):
        n_substeps, n_sweeps = attempt(model, parameters, state, inputs, dt, scratch, number)
        swept, unfinished = _swept(parameters, scratch, n_substeps, n_sweeps)
        sweeps += swept
        fault = watch.check(result, state.monitor, floor)
        notice = watch.alarm(cause, result, state.monitor, number, n_substeps, n_sweeps, unfinished)
        lagging = number == 0 and trust.grows(result, state.monitor)
        feeds = number == 0 and trust.feeds(result, state.monitor, floor)
        fed = fed or feeds
        if fault is watch.Fault.NONE and not lagging and not feeds:
            break
        doubt = watch.GROWS if lagging else watch.FEEDS
        cause = fault.text.split(":")[0] if fault is not watch.Fault.NONE else doubt
    if fault is watch.Fault.DIVERGED:
        return work, stay(parameters, state, scratch)._replace(
            fault=fault, n_substeps=n_substeps, sweeps=sweeps, notice=notice
        )
    if trust.remember(work.monitor, result, floor, parameters.plans, fed):
        notice[Detail.SHORTER] = watch.GAINS
    to_plan = fault is watch.Fault.NONE and number == 0
    outputs = scratch.outputs
    arrays, lost = (result, outputs.wrench, outputs.distance), parameters.blocks.dissipated
    return work, StepResult(fault, to_plan, n_substeps, sweeps, notice, *arrays, lost)


def stay(parameters: PbdParameters, state: PbdState, scratch: StepScratch) -> StepResult:
    """There is no step: the body is where it was, and `scratch.next` is the state."""
    outputs, monitor = scratch.outputs, state.monitor
    np.copyto(scratch.next.buffer, state.buffer)
    result = outputs.result
    result[:], outputs.wrench[:], outputs.distance[:] = 0.0, 0.0, 0.0
    standing = Totals.of(state.x, state.v, parameters.own_mass)
    result[k.KINETIC], result[k.STRAIN] = standing.kinetic, monitor[trust.STRAIN]
    result[k.GRAVITY] = monitor[trust.GRAVITY]
    result[k.MOMENTUM : k.MOMENTUM + 3], result[k.ANGULAR : k.ANGULAR + 3] = standing.momentum, standing.angular
    result[k.BOUNDS : k.BOUNDS + 6] = standing.bounds.ravel()
    result[k.FASTEST] = fastest(state.v)
    arrays = result, outputs.wrench, outputs.distance
    return StepResult(watch.Fault.INPUT, False, scratch.planned, 0, {}, *arrays)


def share_out(
    model: PbdModel, parameters: PbdParameters, state: PbdState, motion: ToolMotion, scratch: StepScratch
) -> None:
    """A handed-over state names one tool a point; now that the poses are known, all that touch it get a share."""
    tools, xw = parameters.tools, scratch.arrays.xw
    xw[: model.n_nodes, :3] = state.x
    point_x = np.zeros((model.n_points, 3))
    place_points(model.arrays, parameters.arrays, xw, point_x)
    split_forces(
        *(tools.kind, tools.shape, motion.position, motion.orientation, point_x, model.touches),
        *(TOUCH * float(parameters.blocks.edges.min()), state.force),
    )
    state.monitor[trust.UNSHARED] = 0.0


def attempt(
    model: PbdModel,
    parameters: PbdParameters,
    state: PbdState,
    inputs: StepInputs,
    dt: float,
    scratch: StepScratch,
    number: int,
) -> tuple[int, int]:
    """One attempt at the step from a state into `scratch.next`; returns substeps and sweeps.

    Attempt 0 is the plan. Later ones halve the substep each time and sweep once more; from the second on the
    carried forces start from zero, because those of a torn shape throw the nodes apart. Leapfrog sweeps nothing.
    """
    work = scratch.next
    np.copyto(work.buffer, state.buffer)
    if work.monitor[trust.STRETCH] < trust.COLLAPSED:
        give_shape(work.x, parameters.arrays.x_rest)
    if len(inputs.turn):
        work.v[:] = with_change(inputs.turn, state.x, state.v)
    n_substeps = scratch.planned * 2 ** (number + int(work.monitor[trust.HALVINGS]))
    if parameters.explicit:
        leap_ahead(model, parameters, dt, n_substeps, scratch)
        return n_substeps, 0
    if number >= trust.COLD:
        work.stress[:] = 0.0
        work.a[:] = 0.0
        work.force[:] = 0.0
        work.steady[:] = 0.0
    n_sweeps = parameters.spec.sweeps + number
    if trust.needs_two_sweeps(work.monitor):
        n_sweeps = max(n_sweeps, 2)
    arrays = model.arrays, parameters.arrays
    scratch.arrays.used[:] = 0
    _tell(model, inputs, n_substeps, scratch)
    find_slow(
        *(parameters.own_mass, work.v, inputs.tools.position, inputs.tools.position_next),
        *(dt, parameters.slowly, scratch.arrays.contacts.slow),
    )
    find_patches(*arrays, work.x, scratch.arrays.contacts.patch)
    if not parameters.blocks.branches:  # whose kernels bring up to date what they need
        parameters.blocks.hold(work.memory, dt)
    scratch.pair.run(
        *(n_substeps * n_sweeps, advance_step, *arrays, work, scratch.inputs, scratch.arrays, scratch.outputs),
        *(dt, n_substeps, n_sweeps),
    )
    parameters.blocks.memory(work.memory)
    turning, result = scratch.turning, scratch.outputs.result
    alone = parameters.arrays.mass_rate == 0.0 and not scratch.outputs.wrench.any()
    if (
        number == 0
        and turning is not None
        and turning.end_of_substeps((state.x, state.v), work.x, work.v, dt, n_substeps, alone)
    ):
        k.summarise_motion(parameters.arrays, work.x, work.v, result)
    return n_substeps, n_sweeps


def place_tools(inputs: Inputs, tools: ToolMotion) -> None:
    """Poses to where kernels find them."""
    inputs.position[:], inputs.orientation[:] = tools.position, tools.orientation
    inputs.position_next[:], inputs.orientation_next[:] = tools.position_next, tools.orientation_next


def _tell(model: PbdModel, inputs: StepInputs, n_substeps: int, scratch: StepScratch) -> None:
    """Poses and forces to where kernels find them."""
    given = scratch.inputs
    place_tools(given, inputs.tools)
    force = model.seam_force(inputs.seam_force)
    given.seam_force[:], given.seam_growth[:] = force, 0.0
    if len(inputs.seam_force_start):
        start = model.seam_force(inputs.seam_force_start)
        given.seam_growth[:] = (force - start) / n_substeps
        given.seam_force[:] = start + given.seam_growth


def leap_ahead(model: PbdModel, parameters: PbdParameters, dt: float, n_substeps: int, scratch: StepScratch) -> None:
    """The explicit step, of `scratch.next` in place."""
    scratch.pair.run(
        *(n_substeps, advance_leapfrog, model.arrays, parameters.arrays, scratch.next, scratch.leap, scratch.outputs),
        *(dt, n_substeps),
    )


def _swept(parameters: PbdParameters, scratch: StepScratch, n_substeps: int, n_sweeps: int) -> tuple[int, int]:
    """Sweeps of the last try, and its substeps in which they did not bring the residual down far enough."""
    if parameters.arrays.tolerance == 0.0:
        return n_substeps * max(n_sweeps, 1), 0
    used = scratch.arrays.used[:n_substeps]
    unfinished = int((used == 0).sum())
    return int(used.sum()) + unfinished * n_sweeps, unfinished


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
    n = model.n_nodes
    xw[:n, :3] = state.x
    if numbers.branches and handed is not None:
        begin_bending(ws, xw, blocks.nodes, numbers.constants, state.memory)
    numbers.hold(state.memory)
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
    state.monitor[:] = 0.0
    state.monitor[: trust.CREATED] = least_j, kinetic, strain, gravity, float(handed is not None), 0.0, stretch
    state.monitor[trust.STORED] = -1.0
