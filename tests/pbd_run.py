"""A PBD solver with a clock and tools, for tests: scenes from a few numbers, steps, static solutions by Newton."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Advance, Advanced, BodyState, Fields
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.body.region import build_region
from softseam_services.pbd.kernels.block_rows import N_STRESS
from softseam_services.pbd.kernels.sweep import batch_energies, block_forces, exact_stress, new_workspace, strain_energy
from softseam_services.pbd.records import PbdState
from softseam_services.pbd.solver import PbdSolver
from softseam_services.pbd.step import StepInputs, StepScratch, attempt
from softseam_services.tools.build import build_tools
from softseam_services.tools.motion import tool_motion

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]
CLAMP_LEFT = ({"min": (-1.0, -1.0, -1.0), "max": (0.0, 1.0, 1.0)},)


def block_scene(
    size: Vector = (0.05, 0.05, 0.05),
    cell: float | Vector = 0.025,
    *,
    kind: str = "neo_hookean",
    young: float = 20e3,
    poisson: float = 0.45,
    density: float = 1050.0,
    gravity: Vector = (0.0, 0.0, 0.0),
    step: float = 0.005,
    position: Vector = (0.0, 0.0, 0.0),
    fixed: Sequence[Mapping[str, Any]] = (),
    tools: Mapping[str, Any] | None = None,
    moved: tuple[str, str] | None = None,
    pbd: Mapping[str, Any] | None = None,
    body: Mapping[str, Any] | None = None,
) -> Scene:
    """A block; `moved` names two tools that the scene's motion closes, which makes them near."""
    ratio = 0.3 if kind == "mooney_rivlin" else None
    material = {"kind": kind, "young": young, "poisson": poisson, "density": density, "ratio": ratio}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "pbd",
            "duration": 1.0,
            "step": step,
            "gravity": gravity,
            "body": {
                "shape": {"kind": "block", "size": size},
                "position": position,
                "cell": cell,
                "material": material,
                "fixed": fixed,
                **(body or {}),
            },
            "tools": tools or {},
            "motion": [{"tools": moved, "close": 0.02, "until": {"time": 1.0}}] if moved else [],
            "models": {"pbd": pbd or {}},
        }
    )


def cantilever(size: Vector, cell: float | Vector, young: float, poisson: float, **other: Any) -> Scene:
    """A beam along x from the origin, clamped at x = 0, its axis at z = 0, density 1000, gravity along -z."""
    return block_scene(
        size,
        cell,
        young=young,
        poisson=poisson,
        density=1000.0,
        step=0.01,
        position=(size[0] / 2, 0.0, -size[2] / 2),
        fixed=CLAMP_LEFT,
        **{"gravity": (0.0, 0.0, -9.81), **other},
    )


class PbdRun:
    """Steps one solver; `velocity` (t, 3) moves the tools."""

    def __init__(
        self,
        scene: Scene,
        *,
        cells: NDArray[np.int32] | None = None,
        seam: NDArray[np.int32] | None = None,
        x: Floats | None = None,
        v: Floats | None = None,
        state: BodyState | None = None,
        files: Mapping[str, bytes] | None = None,
    ) -> None:
        self.scene = scene
        self.body = build_body(scene, files or {})
        self.tools = build_tools(scene, files=files)
        everything = np.arange(self.body.n_cells, dtype=np.int32)
        none = np.zeros(0, dtype=np.int32)
        self.region = build_region(self.body, everything if cells is None else cells, none if seam is None else seam)
        if x is not None or v is not None:
            p = len(self.body.surface.cell)
            state = BodyState(
                self.body.x_rest.copy() if x is None else x,
                np.zeros_like(self.body.x_rest) if v is None else v,
                np.zeros((p, 3)),
                np.full(p, -1, dtype=np.int32),
            )
        self.solver = PbdSolver(scene, self.body, self.region, self.tools, state)
        self.position = self.tools.position.copy()
        self.velocity = np.zeros_like(self.position)
        self.n_steps = 0

    def request(self, seam_force: Floats | None = None, *, compliance: bool = False, exchange: int = 0) -> Advance:
        force = np.zeros((len(self.region.seam), 3)) if seam_force is None else seam_force
        motion = tool_motion(
            self.position, self.tools.orientation, np.pad(self.velocity, ((0, 0), (0, 3))), self.scene.step
        )
        return Advance(self.header(exchange), self.scene.step, force, motion, compliance)

    def header(self, exchange: int = 0) -> Header:
        time = self.n_steps * self.scene.step
        return Header(SCHEMA_VERSION, "test", "far", 0, self.n_steps, exchange, time)

    def step(self, seam_force: Floats | None = None) -> Advanced:
        """One committed step."""
        request = self.request(seam_force)
        reply = self.solver.advance(request)
        self.solver.commit()
        self.position = request.tools.position_next
        self.n_steps += 1
        return reply

    def run(self, seconds: float) -> list[Advanced]:
        replies = [self.step() for _ in range(round(seconds / self.scene.step))]
        failed = [reply.status for reply in replies if reply.status != "converged"]
        assert not failed, failed[0]
        return replies

    def attempt(self, request: Advance) -> None:
        """The tentative state of one attempt by plan, behind the back of what would refuse or repeat it."""
        solver = self.solver
        inputs = StepInputs(request.tools, request.coupling_force, request.coupling_force_start)
        attempt(solver.model, solver.parameters, self.committed, inputs, request.dt, self.scratch, 0)
        solver._tentative = True

    @property
    def committed(self) -> PbdState:
        """The state that the next step begins with."""
        return self.solver.committed

    @property
    def scratch(self) -> StepScratch:
        """What a step works in."""
        return self.solver._scratch

    @property
    def figures(self) -> Floats:
        """Of the last step, see `pbd.kernels.summary`; those of the next one take their place."""
        return self.scratch.outputs.result

    @property
    def work(self) -> PbdState:
        """The tentative state."""
        return self.scratch.next

    def fields(self) -> Fields:
        return self.solver.fields(self.header())

    @property
    def x(self) -> Floats:
        return self.fields().x

    def handed(self) -> BodyState:
        """The state as the orchestrator hands it to a new region (whole body)."""
        fields = self.fields()
        n_points = len(self.body.surface.cell)
        force = np.zeros((n_points, 3))
        tool = np.full(n_points, -1, dtype=np.int32)
        force[fields.points], tool[fields.points] = fields.contact_force, fields.contact_tool
        return BodyState(fields.x, fields.v, force, tool)


class Energy:
    """Energy and force of a run's blocks at any positions."""

    def __init__(self, run: PbdRun) -> None:
        model = run.solver.model
        self.blocks, self.numbers = model.blocks, run.solver.parameters.blocks
        self._n = model.n_nodes
        self._xw = np.zeros((self._n + 8, 4))
        self._xw[self._n :, :3] = self.numbers.padding_x
        self._ws = new_workspace()
        self._stress = np.zeros((self.blocks.n_batches, N_STRESS))

    def value(self, x: Floats) -> float:
        b, k = self.blocks, self.numbers
        self._xw[: self._n, :3] = x
        energies = np.zeros((b.n_batches, 2))
        batch_energies(self._ws, self._xw, b.nodes, k.volume, k.constants, k.law, 0, b.n_batches, energies)
        return float(strain_energy(energies)[0])

    def force(self, x: Floats) -> Floats:
        b, k = self.blocks, self.numbers
        self._xw[: self._n, :3] = x
        exact_stress(self._ws, self._xw, b.nodes, k.volume, self._stress, k.constants, k.law)
        force = np.zeros((self._n + 8, 4))
        block_forces(self._ws, b.nodes, self._stress, k.constants, force, 0, b.n_batches)
        return force[: self._n, :3].copy()


def static_solution(run: PbdRun, load: Floats) -> Floats:
    """Positions where the blocks' forces balance load (n, 3) [N] on the free nodes: Newton, dense, differences."""
    energy = Energy(run)
    x = run.body.x_rest[run.region.nodes].copy()
    free = np.repeat(~run.region.fixed, 3)
    step = 1e-7 * float(run.body.edges.min())
    for n in range(40):
        residual = (energy.force(x) + min(1.0, 0.25 * (n + 1)) * load).ravel()[free]
        if n > 4 and np.abs(residual).max() < 1e-13 * np.abs(load).max():
            break
        columns = []
        for i in np.flatnonzero(free):
            forward, backward = x.copy(), x.copy()
            forward.reshape(-1)[i] += step
            backward.reshape(-1)[i] -= step
            columns.append((energy.force(forward) - energy.force(backward)).ravel()[free] / (2.0 * step))
        x.reshape(-1)[free] -= np.linalg.solve(np.array(columns).T, residual)
    return x
