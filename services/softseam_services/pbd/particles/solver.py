"""The PBD participant's solver for a body of particles: tentative steps, grips, fields, snapshots."""

import time

import numpy as np

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Detail, Figure
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    BodyState,
    Capabilities,
    Correct,
    Coupled,
    Fields,
    ToolMotion,
)
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Floats
from softseam_services.body.particles import ParticleBody
from softseam_services.request_check import problem_of
from softseam_services.tools.tool_set import ToolSet

from .constraints import constraints_of
from .kernels import summary as k
from .model import ParticleModel, build_model
from .parameters import build_parameters
from .records import decode_state, encode_state, new_state
from .step import Fault, StepScratch, advance, measure, stay, step


class ParticleSolver:
    """PBD or XPBD on one sheet, rope or mesh of tetrahedra. Implements `Solver`."""

    def __init__(
        self,
        scene: Scene,
        body: ParticleBody,
        tools: ToolSet,
        state: BodyState | None = None,
        model: ParticleModel | None = None,
    ) -> None:
        """model: the body's structure, where it is known"""
        spec = scene.models.pbd
        self.model = model = build_model(body, spec) if model is None else model
        self.parameters = parameters = build_parameters(model, body, tools, spec, constraints_of(scene))
        self._scratch = StepScratch(model, parameters, scene.step)
        self.committed = start = new_state(body.n_nodes, len(tools.names), body.solid is not None)
        """that steps begin with"""
        self._tentative = False
        start.x[:] = body.x_rest if state is None else state.x
        start.v[:] = body.v_initial if state is None else state.v
        start.v[body.fixed] = 0.0
        start.held[:] = -1.0
        self._load_kernels()
        self._measure(start.x)
        start.strain[0] = self._scratch.measure[:, 0].sum()

    def _load_kernels(self) -> None:
        """Compile or load all kernels before anybody waits for a step: one of a single substep that leaves no trace.

        So services that never meet a sheet or rope do not compile what only these need.
        """
        tools, scratch = self.parameters.tools, self._scratch
        motion = ToolMotion(tools.position, tools.orientation, tools.position, tools.orientation)
        np.copyto(scratch.next.buffer, self.committed.buffer)
        advance(self.model, self.parameters, motion, 1e-6, 1, scratch)
        of, outputs = scratch.arrays.multipliers, scratch.outputs
        multipliers = of.spring, of.bend, of.strain, of.pair, of.volume, of.joined
        for array in (outputs.mean, outputs.felt, outputs.wrench, outputs.result, *multipliers):
            array[:] = 0.0

    @property
    def substeps(self) -> int:
        """Of the last step, or of one as the scene has it."""
        return self._scratch.substeps

    @property
    def strain(self) -> float:
        """Strain energy of the last committed step [J]."""
        return float(self.committed.strain[0])

    @property
    def moving(self) -> tuple[float, float]:
        """Kinetic energy, and that in gravity, of the last committed step [J]."""
        body, state = self.parameters.body, self.committed
        sunk = (state.x - body.x_rest) @ body.gravity
        return 0.5 * float(body.mass @ (state.v * state.v).sum(axis=1)), -float(body.mass @ sunk)

    def advance(self, request: Advance) -> Advanced:
        began = time.perf_counter()
        wrong = problem_of(request, len(self.parameters.tools.names), 0)
        if wrong:
            taken = stay(self.committed, self._scratch)
        else:
            _, taken = step(self.model, self.parameters, self.committed, request.tools, request.dt, self._scratch)
        self._tentative = True
        result, alarm, fault, work = taken.figures, self._alarm(), taken.fault, self._scratch.next
        return Advanced(
            header=request.header,
            status=fault.status,
            wrench=taken.wrench.copy(),
            kinetic=float(result[k.KINETIC]),
            strain=float(work.strain[0]),
            gravity=float(result[k.GRAVITY]),
            tool_work=taken.tool_work,
            momentum=result[k.MOMENTUM : k.MOMENTUM + 3].copy(),
            angular_momentum=result[k.ANGULAR : k.ANGULAR + 3].copy(),
            bounds=result[k.BOUNDS : k.BOUNDS + 6].copy().reshape(2, 3),
            seconds=time.perf_counter() - began,
            cell_distance=np.zeros(0),
            coupling=Coupled(),
            extras={
                Figure.CONTACTS: float(result[k.N_CONTACTS]),
                Figure.PENETRATION: float(result[k.PENETRATION]),
                Figure.SLIP: float(result[k.SLIP]),
                Figure.ITERATIONS: float(taken.sweeps),
                Figure.FASTEST: float(result[k.FASTEST]),
                **self._measures(),
            },
            why="" if fault is Fault.NONE else wrong or fault.text,
            alarms={Detail.INSIDE_OUT: alarm} if alarm else {},
        )

    def _alarm(self) -> str:
        """Where tetrahedra have lost their shape: constraints may be met then, and yet nothing is as it should be."""
        strains, pairs, _, volumes = self._scratch.measure[2:6, 5].tolist()
        if pairs > 0.0:
            return f"{pairs:.0f} tetrahedra are crushed to nothing or inside out; most put themselves right"
        if volumes > 0.0:
            return f"{volumes:.0f} tetrahedra are crushed to nothing or inside out: take a shorter step, or more sweeps"
        if strains > 0.0:
            return f"{strains:.0f} tetrahedra are crushed to nothing or inside out, and stay so: take law: neo_hookean"
        return ""

    def _measures(self) -> dict[str, float]:
        springs, (bend, off, off_total, _, n_bends), strains, pairs = self._scratch.measure[:4, :5].tolist()
        solid = self.parameters.body.solid
        of_solid = pairs if solid is not None and solid.law == "neo_hookean" else strains
        stretch, worst, total, most, count = springs if solid is None or self.parameters.classic else of_solid
        return {
            Figure.WORST_STRETCH: most,
            Figure.STRETCH_VIOLATION: worst,
            Figure.STRETCH_VIOLATION_MEAN: total / max(count, 1.0),
            Figure.BENDING_VIOLATION: off,
            Figure.BENDING_VIOLATION_MEAN: off_total / max(n_bends, 1.0),
            Figure.STRETCH_ENERGY: stretch,
            Figure.BENDING_ENERGY: bend,
            Figure.HELD: float(self._scratch.outputs.result[k.HELD]),
        }

    def _measure(self, x: Floats) -> None:
        """How well constraints are met with particles at x (n, 3) [m]."""
        xw, n = self._scratch.arrays.xw, len(x)
        xw[:n, :3], xw[:n, 3] = x, self.parameters.arrays.weight
        measure(self.model, self.parameters, self._scratch)

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
            self.committed, self._scratch.next = self._scratch.next, self.committed
            self._tentative = False

    def discard(self) -> None:
        """Take the tentative step back; does nothing if there is none."""
        self._tentative = False

    def fields(self, request_header: Header, indicators: bool = False, own: bool = False) -> Fields:
        """Fields of the last advanced step."""
        state = self._scratch.next if self._tentative else self.committed
        body, outputs = self.parameters.body, self._scratch.outputs
        owner = body.skin.owner
        self._measure(state.x)
        tool = np.full(body.n_nodes, -1, dtype=np.int32)
        if outputs.felt.shape[1]:
            touching = outputs.felt.max(axis=1) > 0.0
            tool[touching] = outputs.felt[touching].argmax(axis=1)
        return Fields(
            header=request_header,
            nodes=np.arange(body.n_nodes, dtype=np.int32),
            x=state.x.copy(),
            v=state.v.copy(),
            cauchy=np.zeros((0, 8, 6)),
            points=np.arange(body.n_points, dtype=np.int32),
            point_x=body.skin.points(state.x),
            contact_force=outputs.mean[owner] * body.skin.share[:, None],
            contact_tool=tool[owner],
            point_strain=self._scratch.strain[owner],
        )

    def snapshot(self) -> bytes:
        """Commit, then everything that the future depends on; lists of contacts are made anew in every step."""
        self.commit()
        return encode_state(self.committed)

    def restore(self, state: bytes) -> None:
        """Take over a snapshot of the same body; a tentative step is dropped."""
        decode_state(state, self.committed)
        self._tentative = False
