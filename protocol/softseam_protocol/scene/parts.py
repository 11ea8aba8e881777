"""Shapes of the parts of a body that are of another material; one more shape is one more row of PARTS."""

from typing import Annotated, Literal

from pydantic import Field

from softseam_protocol.scene.spec import Direction, OfKind, Positive, Rotation, Spec, Vector
from softseam_protocol.table import Table


class PartSpec(Spec):
    """What all shapes have alike. Each kind is a subclass with the keys of its own, a row of PARTS."""

    kind: str
    position: Vector = Field(description="centre at rest, in the coordinates of the scene [m]")


class BoxPart(PartSpec):
    """A box; one that reaches beyond the body makes a layer."""

    kind: Literal["box"] = "box"
    size: tuple[Positive, Positive, Positive] = Field(description="edge lengths [m]")
    rotation: Rotation = Field(
        default=(0.0, 0.0, 0.0),
        description="turn",
    )


class SpherePart(PartSpec):
    """A sphere."""

    kind: Literal["sphere"] = "sphere"
    radius: Positive = Field(description="[m]")


class _LongPart(PartSpec):
    """What a capsule and a cylinder have alike."""

    radius: Positive = Field(description="[m]")
    length: Positive = Field(description="[m]")
    axis: Direction = Field(default=(0.0, 0.0, 1.0), description="along its length; any length")


class CapsulePart(_LongPart):
    """A cylinder with round ends."""

    kind: Literal["capsule"] = "capsule"
    length: Positive = Field(description="between the centres of its round ends [m]")


class CylinderPart(_LongPart):
    """A cylinder with flat ends."""

    kind: Literal["cylinder"] = "cylinder"
    length: Positive = Field(description="between its flat ends [m]")


PARTS: Table[type[PartSpec]] = Table(
    "shapes of inclusions",
    {"box": BoxPart, "sphere": SpherePart, "capsule": CapsulePart, "cylinder": CylinderPart},
)
"""the specification of each kind; services have its shape (softseam_services.shapes.SHAPES)"""

AnyPart = Annotated[PartSpec, OfKind(PARTS)]
"""a shape of any kind that PARTS has"""
