"""The message that opens a recording: where it came from, and the surfaces that viewers draw."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from softseam_protocol.facts import facts
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Begin, SurfaceMesh, ToolSurface
from softseam_services.body.borders import border_lines
from softseam_services.body.build import AnyBody
from softseam_services.body.interpolate import rest_points
from softseam_services.body.own_shapes import cell_lines, cell_volumes, point_octants
from softseam_services.body.tetrahedron import CORNERS
from softseam_services.tools.tool_set import ToolSet

_MIDDLE = np.array([13])
"""local id of a hexahedron's middle node"""


def begin(
    bundle: Bundle, bodies: Mapping[str, AnyBody], tools: ToolSet, session: str = "local", seed: int = 0
) -> Begin:
    """The message that opens a session's recording."""
    header = Header(SCHEMA_VERSION, session, "", 0, 0, 0, 0.0)
    surfaces = {name: surface_mesh(header, name, body, tools.surfaces) for name, body in bodies.items()}
    return Begin(header=header, bundle=bundle, seed=seed, facts=facts(), surfaces=surfaces)


def surface_mesh(header: Header, name: str, body: AnyBody, tools: Mapping[str, ToolSurface]) -> SurfaceMesh:
    """A body's surface at rest and the cells behind it, for viewers."""
    if not body.has_cells:
        rest, edges = body.skin.points(body.x_rest), np.full(3, body.spacing)
        none = np.zeros((0, 3))
        return SurfaceMesh(header, name, rest, body.skin.triangles, none, edges, np.zeros((0, 8)), dict(tools))
    mesh = SurfaceMesh(
        header=header,
        body=name,
        point_rest=rest_points(body),
        triangles=body.surface.triangles,
        cell_center=body.x_rest[body.cell_nodes[:, CORNERS if body.tetrahedra else _MIDDLE]].mean(axis=1),
        edges=body.edges,
        fill=body.fill,
        tools=dict(tools),
        axes=body.axes,
    )
    if len(body.materials) > 1:
        mesh = replace(mesh, octant_material=body.octant_material, border_lines=border_lines(body))
    if body.boxes:
        return mesh
    return replace(mesh, point_octants=point_octants(body), cell_lines=cell_lines(body), cell_volume=cell_volumes(body))
