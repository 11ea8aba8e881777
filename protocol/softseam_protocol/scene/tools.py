"""Rigid tools of a scene."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from softseam_protocol.scene.spec import Direction, NonNegative, Positive, Spec, Vector


class PlaneTool(Spec):
    """A half-space; the body stays on the side of `normal`."""

    kind: Literal["plane"] = "plane"
    point: Vector = Field(default=(0.0, 0.0, 0.0), description="a point of the plane [m]")
    normal: Direction = Field(default=(0.0, 0.0, 1.0), description="points towards the body; any length")
    friction: NonNegative = Field(default=0.0, description="Coulomb coefficient [1]")


class _Solid(Spec):
    """What all tools but planes have alike."""

    position: Vector = Field(description="centre at time 0 (of a mesh, the centre of its bounding box) [m]")
    friction: NonNegative = Field(default=0.0, description="Coulomb coefficient [1]")
    mass: NonNegative = Field(default=0.0, description="what its drive has to move [kg]")
    force_limit: Positive | None = Field(
        default=None, description="most that its drive presses with, along its closing, else its move [N]"
    )


class BoxTool(_Solid):
    """A rigid box."""

    kind: Literal["box"] = "box"
    size: tuple[Positive, Positive, Positive] = Field(description="edge lengths [m]")
    rotation: Vector = Field(default=(0.0, 0.0, 0.0), description="turn at time 0: axis times angle [rad]")


class SphereTool(_Solid):
    """A rigid sphere."""

    kind: Literal["sphere"] = "sphere"
    radius: Positive = Field(description="[m]")


class _LongTool(_Solid):
    """What a capsule and a cylinder have alike."""

    radius: Positive = Field(description="[m]")
    length: Positive = Field(description="[m]")
    axis: Direction = Field(default=(0.0, 0.0, 1.0), description="along its length at time 0; any length")


class CapsuleTool(_LongTool):
    """A rigid cylinder with round ends."""

    kind: Literal["capsule"] = "capsule"
    length: Positive = Field(description="between the centres of its round ends [m]")


class CylinderTool(_LongTool):
    """A rigid cylinder with flat ends."""

    kind: Literal["cylinder"] = "cylinder"
    length: Positive = Field(description="between its flat ends [m]")


class MeshTool(_Solid):
    """A rigid solid from a file: a closed surface, or the boundary of a tetrahedral mesh."""

    kind: Literal["mesh"] = "mesh"
    path: str = Field(min_length=1, description="file read through meshio, relative to the scene file")
    scale: Positive = Field(default=1.0, description="metres per unit of the file")
    up: Literal["x", "y", "z"] = Field(default="z", description="axis of the file that points up")
    rotation: Vector = Field(default=(0.0, 0.0, 0.0), description="turn at time 0: axis times angle [rad]")


ToolSpec = Annotated[
    PlaneTool | BoxTool | SphereTool | CapsuleTool | CylinderTool | MeshTool, Field(discriminator="kind")
]
ToolName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_\-]{0,63}$")]
