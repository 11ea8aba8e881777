"""What a scene file may say: frozen specs, SI units, unknown keys are errors."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
ModelKind = Literal["fem", "pbd"]
Quantity = Literal["grip_force", "lift_height", "slip", "peak_von_mises", "sag", "compression", "tip_deflection"]


class Spec(BaseModel):
    """Base of every spec: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class BlockShape(Spec):
    """A box that cells fill exactly."""

    kind: Literal["block"] = "block"
    size: tuple[Positive, Positive, Positive] = Field(description="edge lengths [m]")


class MeshShape(Spec):
    """A closed surface or tetrahedral mesh, embedded in cells."""

    kind: Literal["mesh"] = "mesh"
    path: str = Field(description="file read through meshio, relative to the scene file")
    scale: Positive = Field(1.0, description="metres per unit of the file")


Shape = Annotated[BlockShape | MeshShape, Field(discriminator="kind")]


class MaterialSpec(Spec):
    """Elastic constants of the body."""

    kind: Literal["neo_hookean", "linear"] = "neo_hookean"
    young: Positive = Field(description="Young's modulus [Pa]")
    poisson: float = Field(gt=-1.0, lt=0.5, description="Poisson's ratio [1]")
    density: Positive = Field(description="mass density at rest [kg/m^3]")


class BoxRegion(Spec):
    """An axis-aligned box in rest coordinates [m]."""

    min: Vector
    max: Vector

    @model_validator(mode="after")
    def _ordered(self) -> BoxRegion:
        if any(a > b for a, b in zip(self.min, self.max, strict=True)):
            raise ValueError("min must not exceed max in any coordinate")
        return self


class BodySpec(Spec):
    """The deformable body; its bounding box stands with the base's centre at `position`."""

    shape: Shape
    position: Vector = Field((0.0, 0.0, 0.0), description="base centre of the bounding box [m]")
    cell: Positive | tuple[Positive, Positive, Positive] | None = Field(
        None, description="cell edge, or edges along x, y, z [m]; default: a third of the least extent"
    )
    material: MaterialSpec
    fixed: tuple[BoxRegion, ...] = Field((), description="nodes at rest inside these boxes are clamped")
    velocity: Vector = Field((0.0, 0.0, 0.0), description="initial velocity [m/s]")
    spin: Vector = Field((0.0, 0.0, 0.0), description="initial angular velocity about the centre of mass [rad/s]")


class PlaneTool(Spec):
    """A half-space; the body stays on the side of `normal`."""

    kind: Literal["plane"] = "plane"
    point: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 0.0, 1.0)
    friction: NonNegative = Field(0.0, description="Coulomb coefficient [1]")

    @model_validator(mode="after")
    def _direction(self) -> PlaneTool:
        if sum(c * c for c in self.normal) == 0.0:
            raise ValueError("normal must not be zero")
        return self


class BoxTool(Spec):
    """A rigid box."""

    kind: Literal["box"] = "box"
    size: tuple[Positive, Positive, Positive] = Field(description="edge lengths [m]")
    position: Vector = Field(description="centre at time 0 [m]")
    friction: NonNegative = 0.0


class SphereTool(Spec):
    """A rigid sphere."""

    kind: Literal["sphere"] = "sphere"
    radius: Positive
    position: Vector = Field(description="centre at time 0 [m]")
    friction: NonNegative = 0.0


ToolSpec = Annotated[PlaneTool | BoxTool | SphereTool, Field(discriminator="kind")]


class Until(Spec):
    """When a closing phase ends; the first condition met ends it."""

    compression: float | None = Field(None, gt=0.0, lt=1.0, description="of the body between the tools [1]")
    force: Positive | None = Field(None, description="mean normal force per tool [N]")
    time: Positive | None = Field(None, description="length of the phase [s]")

    @model_validator(mode="after")
    def _some(self) -> Until:
        if self.compression is None and self.force is None and self.time is None:
            raise ValueError("say when to stop: compression, force or time")
        return self


class ClosePhase(Spec):
    """Two tools approach each other at `close` [m/s] each."""

    tools: tuple[str, str]
    close: Positive = Field(description="speed of each tool [m/s]")
    until: Until


class MovePhase(Spec):
    """Tools move together by `move` [m] at `speed` [m/s]."""

    tools: tuple[str, ...] = Field(min_length=1)
    move: Vector
    speed: Positive


class HoldPhase(Spec):
    """All tools stand still for `hold` [s]."""

    hold: NonNegative


Phase = ClosePhase | MovePhase | HoldPhase


class NearSpec(Spec):
    """The near region: cells close to tools, or inside boxes, get a model (and participant) of their own."""

    model: ModelKind = "fem"
    within: Positive | None = Field(None, description="distance to a tool that makes a cell near [m]")
    tools: tuple[str, ...] | None = Field(None, description="default: the tools that move")
    boxes: tuple[BoxRegion, ...] = Field((), description="cells with their centre in a box are always near")
    release: float = Field(1.5, ge=1.0, description="a near cell is released beyond release * within [1]")
    patience: int = Field(20, ge=1, description="steps a cell stays near after its last reason to be [1]")


class RegionsSpec(Spec):
    """Which cells get which model."""

    default: ModelKind = "pbd"
    near: NearSpec | None = None


class FemSpec(Spec):
    """Settings of the implicit finite-element participant."""

    element: Literal["hex27"] = "hex27"
    integrator: Literal["implicit_euler"] = "implicit_euler"
    tolerance: Positive = Field(1e-7, description="Newton stops when no node moves more, relative to a cell edge [1]")
    iterations: int = Field(30, ge=1, description="Newton iterations before the step is cut")


class PbdSpec(Spec):
    """Settings of the XPBD participant."""

    method: Literal["xpbd"] = "xpbd"
    substeps: int | Literal["auto"] = Field("auto", description="substeps a step; auto: wave-speed rule")
    sweeps: int = Field(1, ge=1, description="Gauss-Seidel sweeps a substep")
    hourglass: Literal["physical", "fitted"] = "physical"


class ModelsSpec(Spec):
    """Settings of each model."""

    fem: FemSpec = FemSpec()
    pbd: PbdSpec = PbdSpec()


class SeamSpec(Spec):
    """When the two sides of the seam agree well enough."""

    tolerance: Positive = Field(1e-4, description="largest position gap at commit, in cell edges [1]")
    exchanges: int = Field(8, ge=1, description="most exchanges a step")


class Scene(Spec):
    """One scene: a body, tools, their motion, and how to simulate them."""

    softseam: Literal[1] = Field(description="version of the scene format")
    name: str = Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9_\-]+$")
    gravity: Vector = (0.0, 0.0, -9.81)
    step: Positive = Field(0.01, le=1.0, description="macro step [s]")
    duration: Positive | None = Field(None, description="simulated time [s]; default: the end of the motion")
    seed: int = 0
    body: BodySpec
    tools: dict[str, ToolSpec] = {}
    motion: tuple[Phase, ...] = ()
    regions: RegionsSpec = RegionsSpec()
    models: ModelsSpec = ModelsSpec()
    seam: SeamSpec = SeamSpec()
    quantities: tuple[Quantity, ...] = ()

    @model_validator(mode="after")
    def _names(self) -> Scene:
        def known(names: tuple[str, ...] | None, where: str) -> None:
            for name in names or ():
                if name not in self.tools:
                    have = ", ".join(self.tools) or "none"
                    raise ValueError(f"{where} names the tool {name!r}, but the scene has: {have}")

        for i, phase in enumerate(self.motion):
            if isinstance(phase, ClosePhase | MovePhase):
                known(phase.tools, f"motion.{i}.tools")
        if self.regions.near is not None:
            known(self.regions.near.tools, "regions.near.tools")
        if self.duration is None and not self.motion:
            raise ValueError("give a duration, or a motion whose end is the end of the run")
        return self
