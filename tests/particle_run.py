"""A sheet or rope with a clock and tools, for tests: scenes from a few numbers, steps, a solver without a bus."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Advance, Advanced, Bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.body.particles import ParticleBody
from softseam_services.pbd.particles.solver import ParticleSolver
from softseam_services.server import build_setup
from softseam_services.tools.motion import tool_motion

Floats = NDArray[np.float64]
G = 9.81


def particle_scene(
    body: Mapping[str, Any],
    *,
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    step: float = 0.01,
    tools: Mapping[str, Any] | None = None,
    pbd: Mapping[str, Any] | None = None,
) -> Scene:
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "particles",
            "duration": 1.0,
            "step": step,
            "gravity": gravity,
            "body": body,
            "tools": tools or {},
            "models": {"pbd": pbd or {}},
        }
    )


class ParticleRun:
    """Steps a solver; `velocity` (t, 6) and `gripping` (t,) are the tools' in the coming step."""

    def __init__(self, scene: Scene, files: dict[str, bytes] | None = None) -> None:
        setup = build_setup(Bundle(scene.model_dump_json(), files or {}))
        assert isinstance(setup.body, ParticleBody)
        self.scene, self.body, self.tools = scene, setup.body, setup.tools
        self.solver = ParticleSolver(scene, setup.body, setup.tools)
        self.position, self.orientation = self.tools.position.copy(), self.tools.orientation.copy()
        self.velocity = np.zeros((len(self.tools.names), 6))
        self.gripping = np.zeros(len(self.tools.names), dtype=np.int8)
        self.n = 0

    @property
    def x(self) -> Floats:
        """Positions (n, 3) [m]; writing moves the particles."""
        return self.solver.committed.x

    @property
    def v(self) -> Floats:
        return self.solver.committed.v

    def request(self) -> Advance:
        motion = tool_motion(self.position, self.orientation, self.velocity, self.scene.step)
        motion.gripping.resize(len(self.gripping), refcheck=False)
        motion.gripping[:] = self.gripping
        header = Header(SCHEMA_VERSION, "test", "far", 0, self.n, 0, self.n * self.scene.step)
        return Advance(header, self.scene.step, np.zeros((0, 3)), motion)

    def step(self) -> Advanced:
        request = self.request()
        motion = request.tools
        reply = self.solver.advance(request)
        assert reply.status == "converged", reply.status
        self.solver.commit()
        self.position, self.orientation = motion.position_next, motion.orientation_next
        self.n += 1
        return reply

    def run(self, seconds: float) -> Advanced:
        reply = self.step()
        for _ in range(round(seconds / self.scene.step) - 1):
            reply = self.step()
        return reply
