"""The message that opens a recording: where it came from, and the surfaces that viewers draw."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from softseam_protocol.facts import facts
from softseam_protocol.messages import SCHEMA_VERSION, Begin, Bundle, Header, SurfaceMesh, ToolSurface
from softseam_services.body.build import AnyBody
from softseam_services.body.particles import ParticleBody
from softseam_services.tools.tool_set import ToolSet


def begin(bundle: Bundle, body: AnyBody, tools: ToolSet, session: str = "local", seed: int = 0) -> Begin:
    """The message that opens a session's recording."""
    header = Header(SCHEMA_VERSION, session, "", 0, 0, 0, 0.0)
    surface = surface_mesh(header, body, tools.surfaces)
    return Begin(header=header, bundle=bundle, seed=seed, facts=facts(), surface=surface)


def surface_mesh(header: Header, body: AnyBody, tools: Mapping[str, ToolSurface]) -> SurfaceMesh:
    """The body's surface at rest and the cells behind it, for viewers.

    A point's rest position follows from its cell: center + local * edges / 2.
    """
    if isinstance(body, ParticleBody):
        rest, edges = body.skin.points(body.x_rest), np.full(3, body.spacing)
        none = np.zeros((0, 3))
        return SurfaceMesh(header, rest, body.skin.triangles, none, edges, np.zeros((0, 8)), dict(tools))
    center = body.x_rest[body.cell_nodes[:, 13]]  # node (1, 1, 1) of 3 x 3 x 3
    surface = body.surface
    return SurfaceMesh(
        header=header,
        point_rest=center[surface.cell] + surface.local * (0.5 * body.edges),
        triangles=surface.triangles,
        cell_center=center,
        edges=body.edges,
        fill=body.fill,
        tools=dict(tools),
    )
