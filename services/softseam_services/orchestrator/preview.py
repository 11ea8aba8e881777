"""A look ahead: where the scene takes its tools if nothing pushes back, and when each first meets a body at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.recording import SurfaceMesh
from softseam_protocol.scene.motion import ClosePhase
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import AnyBody
from softseam_services.body.interpolate import rest_points
from softseam_services.orchestrator.grips import Grips
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.program import Program, Progress
from softseam_services.recorder.begin import surface_mesh
from softseam_services.tools.kernels import least_gaps
from softseam_services.tools.motion import tool_motion
from softseam_services.tools.tool_set import ToolSet

_MOST_STEPS = 20_000
_TOUCHES = 1e-3
"""of the bodies' extent: a tool that is nearer touches"""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Preview:
    """Poses of tools step by step, from those at time 0 on; steps in which none moves are left out."""

    surfaces: Mapping[str, SurfaceMesh]
    """of the bodies at rest, by name"""
    position: Floats
    """(k, t, 3) [m]"""
    orientation: Floats
    """unit quaternions w, x, y, z (k, t, 4)"""
    touch: NDArray[np.int64]
    """the first of these at which each tool meets a body, -1 for none (t,)"""


def preview(scene: Scene, bodies: Mapping[str, AnyBody], tools: ToolSet) -> Preview:
    """Follow the scene's motion: a closing that a force ends, or holds, is over when its tools touch."""
    header = Header(SCHEMA_VERSION, "local", "", 0, 0, 0, 0.0)
    surfaces = {name: surface_mesh(header, name, body, tools.surfaces) for name, body in bodies.items()}
    points = np.concatenate([rest_points(each) if each.has_cells else each.x_rest for each in bodies.values()])
    near = _TOUCHES * float(np.ptp(points, axis=0).max())
    grips = Grips(scene, tools, list(bodies.values()))
    program = Program(scene.motion, scene.step, tools, grips)
    progress, touch = Progress(), np.full(len(tools.names), -1)
    position, orientation = [tools.position], [tools.orientation]
    gap = np.empty(len(tools.names))
    for _ in range(_MOST_STEPS):
        least_gaps(points, tools.kind, tools.shape, position[-1], orientation[-1], gap)
        touch[(touch < 0) & (gap <= near)] = len(position) - 1
        if program.done(progress):
            break
        phase, there = scene.motion[progress.phase], progress
        if progress.elapsed == 0.0:
            grips.begin(progress.phase, position[-1], orientation[-1])
        try:
            velocities, after = program.step(progress, position[-1], orientation[-1])
            motion = tool_motion(position[-1], orientation[-1], velocities, scene.step)
        except StepFailed:  # tools meet: a run says so
            break
        progress = after or program.after(progress, motion.position_next, motion.orientation_next, 0.0)
        if velocities.any():
            position.append(motion.position_next)
            orientation.append(motion.orientation_next)
        elif not isinstance(phase, ClosePhase) and progress.phase == there.phase:
            progress = Progress(there.phase + 1)
        if isinstance(phase, ClosePhase) and (phase.force is not None or phase.until.force is not None):
            mine = [tools.names.index(name) for name in phase.tools]
            if (touch[mine] >= 0).all():
                progress = Progress(there.phase + 1)
    return Preview(surfaces, np.stack(position), np.stack(orientation), touch)
