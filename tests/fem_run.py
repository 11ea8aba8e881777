"""Drives one FEM region step by step, as the orchestrator would, without one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import Advance, Advanced, BodyState, ToolMotion
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Ints
from softseam_services.body.build import build_body
from softseam_services.body.region import build_region
from softseam_services.fem.model import FemModel
from softseam_services.fem.parameters import FemParameters
from softseam_services.fem.solver import FemSolver
from softseam_services.fem.state import FemState
from softseam_services.fem.step import Stepper
from softseam_services.fem.work import Work
from softseam_services.tools.build import build_tools

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]


def block(
    size: Vector = (0.05, 0.05, 0.05),
    cell: float | Vector = 0.025,
    young: float = 20e3,
    poisson: float = 0.45,
    density: float = 1050.0,
    kind: str = "neo_hookean",
    ratio: float | None = None,
    body: Mapping[str, Any] | None = None,
    **scene: Any,
) -> Scene:
    """A scene with a block and the keys given; solved tightly, since tolerances are not what most tests are about."""
    material = {"kind": kind, "young": young, "poisson": poisson, "density": density, "ratio": ratio}
    spec = {"shape": {"kind": "block", "size": size}, "cell": cell, "material": material, **(body or {})}
    models = {"fem": {"tolerance": 1e-7}}
    return Scene.model_validate(
        {"softseam": 1, "name": "case", "duration": 1.0, "body": spec, "models": models, **scene}
    )


def tofu(
    cell: float | Vector = 0.025,
    friction: float = 0.6,
    ground: float | None = None,
    gravity: float = -9.81,
    step: float = 0.005,
    **scene: Any,
) -> Scene:
    """A cube of tofu on the ground between two plates that stand clear of it by 0.5 mm (scene B of the docs)."""
    plate = {"kind": "box", "size": (0.01, 0.08, 0.08), "friction": friction}
    tools = {
        "ground": {"kind": "plane", "friction": friction if ground is None else ground},
        "left": {**plate, "position": (-0.0305, 0.0, 0.03)},
        "right": {**plate, "position": (0.0305, 0.0, 0.03)},
    }
    motion = [{"tools": ("left", "right"), "close": 0.02, "until": {"compression": 0.15}}]
    return block(cell=cell, tools=tools, gravity=(0.0, 0.0, gravity), motion=motion, step=step, **scene)


CLOSE: dict[str, Vector] = {"left": (0.02, 0.0, 0.0), "right": (-0.02, 0.0, 0.0)}


class FemRun:
    """A region of a scene's body, its tools, and the number of steps taken."""

    def __init__(
        self,
        scene: Scene,
        cells: Callable[[Body], Ints] | None = None,
        seam: Callable[[Body, Ints], Ints] | None = None,
        state: BodyState | None = None,
        body: Body | None = None,
        files: Mapping[str, bytes] | None = None,
    ) -> None:
        self.scene = scene
        self.body = build_body(scene, files or {}) if body is None else body
        self.tools = build_tools(scene, files=files)
        own = np.arange(self.body.n_cells, dtype=np.int32) if cells is None else cells(self.body)
        nodes = np.zeros(0, dtype=np.int32) if seam is None else seam(self.body, own)
        self.region = build_region(self.body, own, nodes)
        self.solver = FemSolver(scene, self.body, self.region, self.tools, state)
        self.position, self.orientation = self.tools.position.copy(), self.tools.orientation.copy()
        self.n_steps = 0

    @property
    def x(self) -> Floats:
        return self.solver.state.x

    @property
    def model(self) -> FemModel:
        """The structure that the solver steps."""
        return self.solver.model

    @property
    def parameters(self) -> FemParameters:
        """Its numbers."""
        return self.solver.parameters

    @property
    def committed(self) -> FemState:
        """The state that the next step begins with."""
        return self.solver.committed

    @property
    def stepper(self) -> Stepper:
        return self.solver.stepper

    @property
    def work(self) -> Work:
        """What a step works in."""
        return self.stepper.work

    def request(
        self,
        velocities: Mapping[str, Vector] | None = None,
        force: Floats | None = None,
        dt: float | None = None,
        exchange: int = 0,
        compliance: bool = False,
        turned: Floats | None = None,
    ) -> Advance:
        """turned: the tools' orientations when the step ends (t, 4)"""
        dt = self.scene.step if dt is None else dt
        velocity = np.zeros_like(self.position)
        for name, value in (velocities or {}).items():
            velocity[self.tools.names.index(name)] = value
        motion = ToolMotion(
            self.position,
            self.orientation,
            self.position + dt * velocity,
            self.orientation if turned is None else turned,
        )
        header = Header(1, "test", "near", 0, self.n_steps, exchange, 0.0)
        seam_force = np.zeros((len(self.region.seam), 3)) if force is None else force
        return Advance(header, dt, seam_force, motion, compliance)

    def step(self, velocities: Mapping[str, Vector] | None = None, **rest: Any) -> Advanced:
        """One converged step, committed by the next."""
        request = self.request(velocities, **rest)
        reply = self.solver.advance(request)
        assert reply.status == "converged", reply.status
        self.position, self.orientation = request.tools.position_next, request.tools.orientation_next
        self.n_steps += 1
        return reply

    def run(self, time: float, velocities: Mapping[str, Vector] | None = None, **rest: Any) -> list[Advanced]:
        """Steps until `time` [s] has passed, the last one shorter where that is needed."""
        dt = rest.pop("dt", self.scene.step)
        n_steps = int(np.ceil(time / dt - 1e-9))
        parts = [dt] * (n_steps - 1) + [time - dt * (n_steps - 1)]
        return [self.step(velocities, dt=part, **rest) for part in parts]
