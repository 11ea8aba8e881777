"""The PBD participant's solver for a body of particles: tentative steps, grips, fields, snapshots."""

from __future__ import annotations

import math
import time
from enum import Enum

import numpy as np

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Detail, Status
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    BodyState,
    Capabilities,
    Correct,
    Fields,
    ParticleReport,
    ToolMotion,
)
from softseam_protocol.scene.scene import Scene
from softseam_services.body.particles import ParticleBody
from softseam_services.pbd.kernels.lanes import aligned
from softseam_services.request_check import problem_of
from softseam_services.tools.tool_set import ToolSet

from .constraints import constraints_of
from .kernels import bending, distance, neo_hookean, strain
from .kernels import summary as k
from .kernels.constraint import constraint_energy
from .kernels.contact import N_PUSH
from .kernels.grip import take_hold
from .kernels.substep import CROWDED, N_OUTCOMES, TOOL_WORK, advance_step
from .model import APART, build_model
from .state import decode_state, encode_state, new_state

MARGIN = 0.8
"""spacings that a particle may move before contacts are searched anew"""
PAIRS = 24
"""pairs of touching layers that find room, per particle"""


class Fault(Enum):
    """Outcome of a step; the text names the remedy."""

    NONE = "converged"
    INPUT = "the request cannot be served"
    DIVERGED = "the particles diverged: take a shorter step or more substeps"
    CROWDED = "more layers touch than are followed: some may cross; use fewer divisions or a smaller thickness"

    @property
    def status(self) -> Status:
        """The same in a word."""
        return _STATUS[self]


_STATUS = {
    Fault.NONE: Status.CONVERGED,
    Fault.INPUT: Status.REFUSED,
    Fault.DIVERGED: Status.DIVERGED,
    Fault.CROWDED: Status.DOUBTFUL,
}


class ParticleSolver:
    """PBD or XPBD on one sheet, rope or mesh of tetrahedra. Implements `Solver`."""

    def __init__(self, scene: Scene, body: ParticleBody, tools: ToolSet, state: BodyState | None = None) -> None:
        self.model = model = build_model(body, tools, scene.models.pbd, constraints_of(scene))
        self._dt = scene.step
        self.substeps = model.substeps(scene.step)
        n, t = body.n_nodes, len(tools.names)
        self._committed, self._work = new_state(n, t), new_state(n, t)
        self._tentative = False
        start = self._committed
        start.x[:] = body.x_rest if state is None else state.x
        start.v[:] = body.v_initial if state is None else state.v
        start.v[body.fixed] = 0.0
        start.held[:] = -1.0
        springs, bends = model.springs, model.bends
        self._springs = (
            springs.nodes,
            springs.row,
            model.spring_rest,
            model.spring_compliance,
            np.zeros(springs.row.shape),
            np.zeros(springs.row.shape),
            np.zeros(springs.row.shape),
            np.zeros(len(springs.row), dtype=np.int64),
        )
        self._bends = (
            bends.nodes,
            bends.row,
            model.bend_coefficient,
            model.bend_compliance,
            np.zeros(bends.row.shape),
            np.zeros(bends.row.shape),
            np.zeros((len(bends.row), 3, 8)),
            np.zeros(len(bends.row), dtype=np.int64),
        )
        tets = model.tetrahedra
        self._solid = (
            tets.batches.nodes,
            tets.batches.row,
            tets.inverse,
            model.strain_compliance,
            np.zeros_like(model.strain_compliance),
            np.zeros((len(tets.batches.row), strain.N_STRAINS, 8)),
        )
        tets = model.paired
        self._hyper = (
            tets.batches.nodes,
            tets.inverse,
            model.pair_compliance,
            np.zeros_like(model.pair_compliance),
            np.zeros_like(model.pair_compliance),
            model.pair_gamma,
            aligned(n + 8, 4),
            aligned(neo_hookean.N_WORK),
        )
        self._joined = model.joined.arrays()
        self._no_grip = np.zeros(t, dtype=np.int8)
        self._xw = aligned(n + 8, 4)
        self._work_arrays = (
            self._xw,
            np.zeros((n, 3)),
            np.zeros((2, n, 3)),
            np.zeros(n, dtype=np.int64),
            np.zeros((n, 3)),
            np.zeros((n + 8, 3)),
            aligned(distance.N_WORK),
            aligned(bending.N_WORK),
        )
        self._contacts = (np.zeros(n * t, dtype=np.int32), np.zeros(n * t, dtype=np.int32), np.zeros((n * t, N_PUSH)))
        self._pairs = _pair_room(n if body.self_contact else 0)
        self._poses = np.zeros((2, t, 3)), np.zeros((2, t, 4)), np.zeros((2, t, 12))
        self._mean, self._felt, self._wrench = np.zeros((n, 3)), np.zeros((n, t)), np.zeros((t, 6))
        self._outcome, self._result = np.zeros(N_OUTCOMES), np.zeros(k.N_RESULTS)
        self._measure, self._strain = np.zeros((5, 6)), np.zeros(n + 8)
        self._layers = (APART * float(body.spacing) if body.self_contact else 0.0, float(body.self_friction))
        self._load_kernels()
        self._fill(start.x)
        self._measure_all()
        start.strain[0] = self._measure[:, 0].sum()

    def _load_kernels(self) -> None:
        """Compile or load all kernels before anybody waits for a step: one of a single substep that leaves no trace.

        So services that never meet a sheet or rope do not compile what only these need.
        """
        tools, substeps = self.model.tools, self.substeps
        motion = ToolMotion(tools.position, tools.orientation, tools.position, tools.orientation)
        np.copyto(self._work.buffer, self._committed.buffer)
        self.substeps = 1
        self._advance(motion, 1e-6)
        self.substeps = substeps
        multipliers = self._springs[6], self._bends[6], self._solid[5], self._hyper[4], self._joined[4]
        for array in (self._mean, self._felt, self._wrench, self._result, *multipliers):
            array[:] = 0.0

    @property
    def strain(self) -> float:
        """Strain energy of the last committed step [J]."""
        return float(self._committed.strain[0])

    @property
    def moving(self) -> tuple[float, float]:
        """Kinetic energy, and that in gravity, of the last committed step [J]."""
        body, state = self.model.body, self._committed
        sunk = (state.x - body.x_rest) @ body.gravity
        return 0.5 * float(body.mass @ (state.v * state.v).sum(axis=1)), -float(body.mass @ sunk)

    def advance(self, request: Advance) -> Advanced:
        began = time.perf_counter()
        model, work = self.model, self._work
        np.copyto(work.buffer, self._committed.buffer)
        wrong = problem_of(request, len(model.tools.names), 0)
        if request.dt != self._dt and not wrong:
            self._dt, self.substeps = request.dt, model.substeps(request.dt)
        fault, sweeps = Fault.INPUT, self.substeps * model.spec.sweeps
        if not wrong:
            fault = self._advance(request.tools, request.dt)
        if fault in (Fault.INPUT, Fault.DIVERGED):
            np.copyto(work.buffer, self._committed.buffer)
            self._result[:] = 0.0
            self._outcome[:] = 0.0
            self._measure[:] = 0.0
            self._wrench[:] = 0.0
            sweeps = 0
        work.strain[0] = self._measure[:, 0].sum()
        self._tentative = True
        result, alarm = self._result, self._alarm()
        return Advanced(
            header=request.header,
            status=fault.status,
            seam_x=np.zeros((0, 3)),
            compliance=np.zeros((0, 0)),
            wrench=self._wrench.copy(),
            kinetic=float(result[k.KINETIC]),
            strain=float(work.strain[0]),
            gravity=float(result[k.GRAVITY]),
            tool_work=float(self._outcome[TOOL_WORK]),
            seam_work=0.0,
            momentum=result[k.MOMENTUM : k.MOMENTUM + 3].copy(),
            angular_momentum=result[k.ANGULAR : k.ANGULAR + 3].copy(),
            penetration=float(result[k.PENETRATION]),
            slip=0.0,
            n_contacts=int(result[k.N_CONTACTS]),
            iterations=sweeps,
            seconds=time.perf_counter() - began,
            cell_distance=np.zeros(0),
            bounds=result[k.BOUNDS : k.BOUNDS + 6].copy().reshape(2, 3),
            alarm=alarm,
            particles=self._measures(),
            why="" if fault is Fault.NONE else wrong or fault.value,
            alarm_details=[Detail.INSIDE_OUT] if alarm else [],
        )

    def _advance(self, motion: ToolMotion, dt: float) -> Fault:
        """Take the step from the committed state into the tentative one."""
        model, body, tools, work = self.model, self.model.body, self.model.tools, self._work
        take_hold(
            *(work.x, work.v, body.mass, body.fixed, tools.kind, tools.shape, motion.position, motion.orientation),
            *(
                motion.gripping if body.solid is None else self._no_grip,
                body.radius + body.spacing,
                work.held,
                work.local,
                work.grips,
            ),
        )
        stretch, bending_share = model.shares()
        count = advance_step(
            work.x,
            work.v,
            work.held,
            work.local,
            body.mass,
            model.weight,
            body.x_rest,
            body.gravity,
            body.damping,
            self._springs,
            self._bends,
            self._solid,
            self._hyper,
            self._joined,
            model.joined.compliance,
            tools.kind,
            tools.shape,
            tools.reach,
            tools.friction,
            motion.position,
            motion.orientation,
            motion.position_next,
            motion.orientation_next,
            body.radius,
            body.restitution,
            self._layers,
            dt,
            self.substeps,
            model.spec.sweeps,
            stretch,
            bending_share,
            MARGIN * body.spacing,
            self._work_arrays,
            self._contacts,
            self._pairs,
            self._poses,
            self._mean,
            self._felt,
            self._wrench,
            self._outcome,
        )
        k.summarise(
            *(work.x, work.v, body.mass, body.x_rest, body.gravity, work.held, self._mean, count, *self._contacts[:2]),
            *(tools.kind, tools.shape, motion.position_next, motion.orientation_next, body.radius, self._result),
        )
        if self._result[k.FINITE] == 0.0 or not math.isfinite(self._outcome[TOOL_WORK]):
            return Fault.DIVERGED
        self._measure_all()
        return Fault.CROWDED if self._outcome[CROWDED] else Fault.NONE

    def _measure_all(self) -> None:
        """Energies and violations of all families as particles and multipliers stand."""
        nodes, row, rest, _, _, soft, lam, _ = self._springs
        h = self._dt / self.substeps
        self._strain[:] = 0.0
        distance.measure_distances(self._xw, nodes, row, rest, soft, lam, h, self._strain, self._measure[0])
        nodes, row, coefficient, _, _, soft, lam_bends, _ = self._bends
        spacing = self.model.body.spacing
        bending.measure_bends(self._xw, nodes, row, coefficient, soft, lam_bends, h, spacing, self._measure[1])
        nodes, row, inverse, _, soft, lam_strains = self._solid
        strain.measure_strains(self._xw, nodes, row, inverse, soft, lam_strains, h, self._strain, self._measure[2])
        nodes, inverse, compliance, soft, lam_pairs, _, _, _ = self._hyper
        row = self.model.paired.batches.row
        neo_hookean.measure_pairs(
            self._xw, nodes, row, inverse, compliance, soft, lam_pairs, self._strain, self._measure[3]
        )
        self._measure[4, 0] = constraint_energy(self._xw, *self._joined, h)

    def _alarm(self) -> str:
        """Where tetrahedra have lost their shape: constraints may be met then, and yet nothing is as it should be."""
        strains, pairs = self._measure[2:4, 5].tolist()
        if pairs > 0.0:
            return f"{pairs:.0f} tetrahedra are crushed to nothing or inside out; most put themselves right"
        if strains > 0.0:
            return f"{strains:.0f} tetrahedra are crushed to nothing or inside out, and stay so: take law: neo_hookean"
        return ""

    def _measures(self) -> ParticleReport:
        springs, (bend, off, off_total, _, n_bends), strains, pairs = self._measure[:4, :5].tolist()
        solid = self.model.body.solid
        of_solid = pairs if solid is not None and solid.law == "neo_hookean" else strains
        stretch, worst, total, most, count = springs if solid is None else of_solid
        return ParticleReport(
            worst_stretch=most,
            stretch_violation=worst,
            stretch_violation_mean=total / max(count, 1.0),
            bending_violation=off,
            bending_violation_mean=off_total / max(n_bends, 1.0),
            stretch_energy=stretch,
            bending_energy=bend,
            held=int(self._result[k.HELD]),
        )

    def _fill(self, x: np.ndarray) -> None:
        n = len(x)
        self._xw[:n, :3], self._xw[:n, 3] = x, self.model.weight

    def correct(self, request: Correct) -> Advanced:
        """Particles have no seam."""
        raise ValueError("a body of particles has no seam whose force could correct a step")

    @property
    def capabilities(self) -> Capabilities:
        """What it can do for its body."""
        return Capabilities(False, False, False, self.substeps, False, False, 0.0)

    def commit(self) -> None:
        """Accept the tentative step; does nothing if there is none."""
        if self._tentative:
            self._committed, self._work = self._work, self._committed
            self._tentative = False

    def discard(self) -> None:
        """Take the tentative step back; does nothing if there is none."""
        self._tentative = False

    def fields(self, request_header: Header, indicators: bool = False, own: bool = False) -> Fields:
        """Fields of the last advanced step."""
        state = self._work if self._tentative else self._committed
        body = self.model.body
        owner = body.skin.owner
        self._fill(state.x)
        self._measure_all()
        tool = np.full(body.n_nodes, -1, dtype=np.int32)
        if self._felt.shape[1]:
            touching = self._felt.max(axis=1) > 0.0
            tool[touching] = self._felt[touching].argmax(axis=1)
        return Fields(
            header=request_header,
            nodes=np.arange(body.n_nodes, dtype=np.int32),
            x=state.x.copy(),
            v=state.v.copy(),
            cauchy=np.zeros((0, 8, 6)),
            points=np.arange(body.n_points, dtype=np.int32),
            point_x=body.skin.points(state.x),
            contact_force=self._mean[owner] * body.skin.share[:, None],
            contact_tool=tool[owner],
            point_strain=self._strain[owner],
        )

    def snapshot(self) -> bytes:
        """Commit, then everything that the future depends on; lists of contacts are made anew in every step."""
        self.commit()
        return encode_state(self._committed)

    def restore(self, state: bytes) -> None:
        """Take over a snapshot of the same body; a tentative step is dropped."""
        decode_state(state, self._committed)
        self._tentative = False


def _pair_room(n: int) -> tuple[np.ndarray, ...]:
    """Workspace of the spatial hash for n particles: cubes, buckets, order, pairs."""
    buckets = 1 << max(1, (2 * n - 1).bit_length()) if n else 2
    return (
        np.zeros((n, 3), dtype=np.int64),
        np.zeros(buckets + 1, dtype=np.int32),
        np.zeros(n, dtype=np.int32),
        np.zeros(PAIRS * n, dtype=np.int32),
        np.zeros(PAIRS * n, dtype=np.int32),
    )
