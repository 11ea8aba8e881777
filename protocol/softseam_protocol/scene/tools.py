"""Rigid tools of a scene; a tool of another shape is one more row of TOOLS."""

import math
from typing import Annotated, Literal

from pydantic import Field

from softseam_protocol.scene.mesh_files import MeshPart, MeshScale, MeshUp, usual_scale, usual_up
from softseam_protocol.scene.spec import Direction, NonNegative, OfKind, Positive, Rotation, Spec, Vector
from softseam_protocol.table import Table


class PlaneTool(Spec):
    """A half-space; the body stays on the side of `normal`."""

    kind: Literal["plane"] = "plane"
    point: Vector = Field(default=(0.0, 0.0, 0.0), description="a point of the plane [m]")
    normal: Direction = Field(default=(0.0, 0.0, 1.0), description="points towards the body; any length")
    friction: NonNegative = Field(default=0.0, description="Coulomb coefficient [1]")


class SolidTool(Spec):
    """What all tools but planes have alike. Each kind is a subclass with the keys of its own, a row of TOOLS."""

    kind: str
    position: Vector = Field(description="centre at time 0 (of a mesh, of its bounding box, or what `place` says) [m]")
    friction: NonNegative = Field(default=0.0, description="Coulomb coefficient [1]")
    mass: NonNegative = Field(default=0.0, description="what its drive has to move [kg]")
    force_limit: Positive | None = Field(
        default=None, description="most that its drive presses with, along its closing, else its move [N]"
    )

    def extent(self, direction: Vector) -> float | None:
        """How far it reaches at time 0 from its position along a unit direction [m]; None where only services know."""
        return None


class BoxTool(SolidTool):
    """A rigid box."""

    kind: Literal["box"] = "box"
    size: tuple[Positive, Positive, Positive] = Field(description="edge lengths [m]")
    rotation: Rotation = Field(
        default=(0.0, 0.0, 0.0),
        description="turn at time 0",
    )

    def extent(self, direction: Vector) -> float:
        own = _turned_back(self.rotation, direction)
        return 0.5 * sum(abs(part) * edge for part, edge in zip(own, self.size, strict=True))


class SphereTool(SolidTool):
    """A rigid sphere."""

    kind: Literal["sphere"] = "sphere"
    radius: Positive = Field(description="[m]")

    def extent(self, direction: Vector) -> float:
        return self.radius


class _LongTool(SolidTool):
    """What a capsule and a cylinder have alike."""

    radius: Positive = Field(description="[m]")
    length: Positive = Field(description="[m]")
    axis: Direction = Field(default=(0.0, 0.0, 1.0), description="along its length at time 0; any length")

    def _along(self, direction: Vector) -> float:
        """Cosine of a unit direction and the axis, without its sign."""
        return abs(_dot(direction, self.axis)) / math.hypot(*self.axis)


class CapsuleTool(_LongTool):
    """A rigid cylinder with round ends."""

    kind: Literal["capsule"] = "capsule"
    length: Positive = Field(description="between the centres of its round ends [m]")

    def extent(self, direction: Vector) -> float:
        return 0.5 * self.length * self._along(direction) + self.radius


class CylinderTool(_LongTool):
    """A rigid cylinder with flat ends."""

    kind: Literal["cylinder"] = "cylinder"
    length: Positive = Field(description="between its flat ends [m]")

    def extent(self, direction: Vector) -> float:
        along = self._along(direction)
        return 0.5 * self.length * along + self.radius * math.sqrt(max(0.0, 1.0 - along * along))


class MeshTool(SolidTool):
    """A rigid solid from a file: a closed surface, or the boundary of a tetrahedral mesh."""

    kind: Literal["mesh"] = "mesh"
    path: str = Field(min_length=1, description="mesh file, relative to the scene file")
    part: MeshPart = None
    scale: MeshScale = Field(default_factory=usual_scale)
    up: MeshUp = Field(default_factory=usual_up)
    place: Literal["centre", "origin"] = Field(
        default="centre",
        exclude_if=lambda place: place == "centre",
        description="what of the file is at `position`, and stays there as `rotation` turns it",
    )
    rotation: Rotation = Field(
        default=(0.0, 0.0, 0.0),
        description="turn at time 0",
    )


TOOLS: Table[type[PlaneTool] | type[SolidTool]] = Table(
    "tool specifications",
    {
        "plane": PlaneTool,
        "box": BoxTool,
        "sphere": SphereTool,
        "capsule": CapsuleTool,
        "cylinder": CylinderTool,
        "mesh": MeshTool,
    },
)
"""the specification of each kind; services have its shape (softseam_services.shapes.SHAPES)"""

ToolSpec = Annotated[PlaneTool | SolidTool, OfKind(TOOLS)]
"""a tool of any kind that TOOLS has"""
ToolName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_\-]{0,63}$")]


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _turned_back(rotation: Vector, v: Vector) -> Vector:
    """A vector in the frame that a rotation vector [rad] turned: Rodrigues' formula with the opposite angle."""
    angle = math.hypot(*rotation)
    if angle == 0.0:
        return v
    x, y, z = (part / angle for part in rotation)
    c, s = math.cos(angle), math.sin(angle)
    rest = (x * v[0] + y * v[1] + z * v[2]) * (1.0 - c)
    cross = (y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0])
    return (
        v[0] * c - cross[0] * s + x * rest,
        v[1] * c - cross[1] * s + y * rest,
        v[2] * c - cross[2] * s + z * rest,
    )
