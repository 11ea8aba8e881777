"""What a body in cells is made of: its material, and parts that are of another."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from softseam_protocol.kinds import MaterialKind
from softseam_protocol.spec import Direction, NonNegative, Positive, Spec, Vector, wrong


class MaterialSpec(Spec):
    """Elastic constants of the body; every law meets Hooke's with these at small strains."""

    kind: MaterialKind = "neo_hookean"
    young: Positive = Field(description="Young's modulus [Pa]")
    poisson: float = Field(gt=-1.0, lt=0.5, description="Poisson's ratio, below 0.5: use 0.49 for rubber or gel [1]")
    density: Positive = Field(description="mass density at rest [kg/m^3]")
    ratio: float | None = Field(
        default=None, ge=0.0, le=1.0, description="mooney_rivlin: c01/(c10 + c01), 0 is neo-Hookean [1]"
    )
    retardation_time: NonNegative = Field(
        default=0.0,
        description="Kelvin and Voigt's viscosity over stiffness, of the whole body in both models: an oscillation of "
        "omega has the damping ratio half omega times this, and the loss factor tan delta omega times this; below a "
        "step's (of pbd a substep's) length implicit Euler damps more [s]",
    )

    @model_validator(mode="after")
    def _ratio(self) -> MaterialSpec:
        if self.kind == "mooney_rivlin" and self.ratio is None:
            raise wrong("mooney_rivlin needs the ratio c01/(c10 + c01): give `ratio`, 0.2 for many rubbers", "kind")
        if self.kind != "mooney_rivlin" and self.ratio is not None:
            raise wrong(f"{self.kind} has no ratio: only mooney_rivlin does", "ratio")
        return self


class _Part(Spec):
    """What all shapes have alike."""

    position: Vector = Field(description="centre at rest, in the coordinates of the scene [m]")


class BoxPart(_Part):
    """A box; one that reaches beyond the body makes a layer."""

    kind: Literal["box"] = "box"
    size: tuple[Positive, Positive, Positive] = Field(description="edge lengths [m]")
    rotation: Vector = Field(default=(0.0, 0.0, 0.0), description="turn: axis times angle [rad]")


class SpherePart(_Part):
    """A sphere."""

    kind: Literal["sphere"] = "sphere"
    radius: Positive = Field(description="[m]")


class _LongPart(_Part):
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


class InclusionMaterial(Spec):
    """What differs from the body's own material; the law is the same."""

    young: Positive | None = Field(default=None, description="Young's modulus; default: the body's [Pa]")
    poisson: float | None = Field(
        default=None, gt=-1.0, lt=0.5, description="Poisson's ratio, below 0.5; default: the body's [1]"
    )
    density: Positive | None = Field(default=None, description="mass density at rest; default: the body's [kg/m^3]")
    ratio: float | None = Field(
        default=None, ge=0.0, le=1.0, description="mooney_rivlin: c01/(c10 + c01); default: the body's [1]"
    )

    @model_validator(mode="after")
    def _differs(self) -> InclusionMaterial:
        if not self.model_dump(exclude_none=True):
            raise wrong("an inclusion differs from its body: give young, poisson or density")
        return self


class InclusionSpec(Spec):
    """A part of the body that is of another material and grows together with the rest."""

    shape: Annotated[BoxPart | SpherePart | CapsulePart | CylinderPart, Field(discriminator="kind")]
    material: InclusionMaterial
