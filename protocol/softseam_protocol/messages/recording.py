"""To recorders and viewers, once a session; and back."""

from dataclasses import field

from softseam_protocol.messages.arrays import (
    AS_THE_SCENE,
    NO_SCALARS,
    Count,
    Lines,
    NameText,
    OctantIds,
    Octants,
    Scalars,
    Triangles,
    Vector3,
    Vectors,
    no_lines,
    no_octants,
)
from softseam_protocol.messages.header import Header, message
from softseam_protocol.messages.outcomes import RecordingState
from softseam_protocol.messages.participant import Bundle


@message
class ToolSurface:
    """A tool that is a triangle mesh, in its own frame."""

    vertices: Vectors
    """(n, 3) [m]"""
    triangles: Triangles
    """counter-clockwise from outside (T, 3)"""


@message
class SurfaceMesh:
    """What a viewer needs to draw a body's frames (C cells, P surface points, T triangles)."""

    header: Header
    body: NameText
    point_rest: Vectors
    """surface points at rest (P, 3) [m]"""
    triangles: Triangles
    """counter-clockwise from outside (T, 3)"""
    cell_center: Vectors
    """centres of the cells at rest (C, 3) [m]"""
    edges: Vector3
    """edge lengths of a cell [m]"""
    fill: Octants
    """filled fraction of each octant (C, 8)"""
    tools: dict[str, ToolSurface] = field(default_factory=dict)
    """the tools that are meshes, by name"""
    point_octants: OctantIds = field(default_factory=no_octants)
    """octants 8 cell + octant that meet at each surface point, -1 for none (P, 8); empty where cells are boxes"""
    cell_lines: Lines = field(default_factory=no_lines)
    """ends of the lines along cells' edges on the surface, as surface points (L, 2); empty where cells are boxes"""
    cell_volume: Scalars = field(default_factory=NO_SCALARS)
    """(C,) [m^3]; empty where cells are boxes"""
    octant_material: OctantIds = field(default_factory=no_octants)
    """number of each octant's material, 0 the body's own (C, 8); empty where there is but one"""
    border_lines: Lines = field(default_factory=no_lines)
    """ends of the lines along borders of materials, as nodes (L, 2)"""
    axes: Vectors = field(default_factory=AS_THE_SCENE)
    """unit vectors along which boxes have these edges, as columns (3, 3)"""


@message
class Begin:
    """A session begins: what its recording must hold to be drawn and simulated again."""

    header: Header
    bundle: Bundle
    seed: int
    facts: dict[str, str]
    """versions and machine of the process that simulates"""
    surfaces: dict[str, SurfaceMesh]
    """by body"""


FINISH = 20.0
"""longest time from an End to its answer [s]: half of it for messages that are still on their way, half for the disk"""


@message
class End:
    """A session has ended: its recording can be closed."""

    header: Header
    reason: str


@message
class Recorded:
    """Progress of a recorder: everything up to here is in the file, but for `lost` messages."""

    header: Header
    path: str
    messages: Count
    lost: Count
    bytes: Count
    state: RecordingState
    note: str = ""
    """why messages are lost"""
