"""What a scene file may say: frozen specs, SI units, unknown keys are errors."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from softseam_protocol.inner_ball import inner_ball
from softseam_protocol.quantities import QUANTITIES, QuantityName
from softseam_protocol.scene.kinds import integrator_problem
from softseam_protocol.scene.materials import AnyMaterial, InclusionSpec, MaterialSpec
from softseam_protocol.scene.models import DampingSpec, ModelsSpec
from softseam_protocol.scene.motion import (
    LARGEST_TURN,
    ClosePhase,
    GripPhase,
    HoldPhase,
    Phase,
    ReleasePhase,
    TurnPhase,
)
from softseam_protocol.scene.particles import ParticleBodySpec, RopeBody, SheetBody, TetMeshBody
from softseam_protocol.scene.regions import RegionsSpec, SeamSpec
from softseam_protocol.scene.spec import BoxRegion, Positive, Spec, Vector, check_edge, wrong
from softseam_protocol.scene.tools import PlaneTool, ToolName, ToolSpec
from softseam_protocol.tool_borders import tool_borders

ProbeName = ToolName

MOST_CELLS = 200_000
MOST_STEPS = 10_000_000


Grading = Annotated[float, Field(ge=1.0, le=20.0)]


def _grading_tag(value: Any) -> str:
    return "three numbers" if isinstance(value, list | tuple) else "one number"


class BlockShape(Spec):
    """A box that cells fill exactly."""

    kind: Literal["block"] = "block"
    size: tuple[Positive, Positive, Positive] = Field(description="edge lengths [m]")
    grading: Annotated[
        Annotated[Grading, Tag("one number")] | Annotated[tuple[Grading, Grading, Grading], Tag("three numbers")],
        Discriminator(_grading_tag),
    ] = Field(
        default=1.0,
        description="how many times thinner cells are at the faces, or where `towards` says, than in the middle "
        "between, since stress peaks at edges, along all axes or along x, y, z; "
        "more than 1 in pbd for tools that cover whole faces",
    )
    towards: tuple[str, ...] = Field(
        default=(),
        description="boxes among the tools: cells end where the edges of these come to lie on the block, and are "
        "thinner towards them and towards the faces that they press, instead of towards all faces",
    )
    borders: Literal["even", "materials"] = Field(
        default="even",
        description="even: wherever materials meet; materials: cells end in the planes of inclusions that are boxes, "
        "continued through the block, and are equal between them; around one inclusion that is a sphere, inside the "
        "block and clear of these planes, they are curved and follow it, for fem or pbd alone",
    )

    @property
    def gradings(self) -> Vector:
        """Along x, y and z."""
        return self.grading if isinstance(self.grading, tuple) else (self.grading,) * 3

    @property
    def graded(self) -> bool:
        """Whether cells may be of more than one size."""
        return self.gradings != (1.0, 1.0, 1.0) or bool(self.towards) or self.borders != "even"

    @model_validator(mode="after")
    def _plausible(self) -> BlockShape:
        for i, edge in enumerate(self.size):
            check_edge(edge, "size", i)
        return self


class MeshShape(Spec):
    """A closed surface or solid mesh, embedded in cells of one size, or hexahedra that are the cells."""

    kind: Literal["mesh"] = "mesh"
    path: str = Field(min_length=1, description="file read through meshio, relative to the scene file")
    scale: Positive = Field(default=1.0, description="metres per unit of the file")
    up: Literal["x", "y", "z"] = Field(default="z", description="axis of the file that points up")
    cells: Literal["boxes", "own"] = Field(
        default="boxes", description="boxes: cells of one size that the solid fills partly; own: the file's hexahedra"
    )


Shape = Annotated[BlockShape | MeshShape, Field(discriminator="kind")]


def _cell_tag(value: Any) -> str:
    return "three edges" if isinstance(value, list | tuple) else "one edge"


class BodySpec(Spec):
    """A deformable body in cells; its bounding box stands with the base's centre at `position`."""

    kind: Literal["cells"] = "cells"
    shape: Shape
    position: Vector = Field(default=(0.0, 0.0, 0.0), description="base centre of the bounding box [m]")
    cell: (
        Annotated[
            Annotated[Positive, Tag("one edge")] | Annotated[tuple[Positive, Positive, Positive], Tag("three edges")],
            Discriminator(_cell_tag),
        ]
        | None
    ) = Field(default=None, description="cell edge, or edges along x, y, z [m]; default: a third of the least extent")
    material: AnyMaterial
    inclusions: tuple[InclusionSpec, ...] = Field(
        default=(), description="parts of another material; an octant of a cell is of the last that holds its centre"
    )
    fixed: tuple[BoxRegion, ...] = Field(default=(), description="nodes at rest inside these boxes are clamped")
    velocity: Vector = Field(default=(0.0, 0.0, 0.0), description="initial velocity [m/s]")
    spin: Vector = Field(
        default=(0.0, 0.0, 0.0), description="initial angular velocity about the centre of mass [rad/s]"
    )

    @model_validator(mode="after")
    def _sized_once(self) -> BodySpec:
        if isinstance(self.shape, MeshShape) and self.shape.cells == "own" and self.cell is not None:
            raise wrong("the file's hexahedra are the cells: leave out `cell`, or `cells: own`", "cell")
        return self

    @model_validator(mode="after")
    def _one_law(self) -> BodySpec:
        for i, inclusion in enumerate(self.inclusions):
            inclusion.material.within(self.material, "inclusions", i, "material")
        return self

    @property
    def materials(self) -> tuple[MaterialSpec, ...]:
        """The body's own, then one for each inclusion."""
        return (self.material, *(inclusion.material.within(self.material) for inclusion in self.inclusions))

    @model_validator(mode="after")
    def _countable(self) -> BodySpec:
        if isinstance(self.shape, BlockShape):
            cell = min(self.shape.size) / 3.0 if self.cell is None else self.cell
            edges = cell if isinstance(cell, tuple) else (cell,) * 3
            n_cells = math.prod(max(1, round(size / edge)) for size, edge in zip(self.shape.size, edges, strict=True))
            if n_cells > MOST_CELLS:
                at = "cell" if self.cell is not None else "shape"
                size = " x ".join(f"{edge:g}" for edge in self.shape.size)
                what = f"{size} m in {n_cells:,} cells, more than {MOST_CELLS:,}"
                raise wrong(f"{what}: give a longer cell edge, and all lengths in metres", at)
        return self


def _body_tag(value: Any) -> str:
    kind = value.get("kind", "cells") if isinstance(value, dict) else getattr(value, "kind", "cells")
    return str(kind)


AnyBody = Annotated[
    Annotated[BodySpec, Tag("cells")]
    | Annotated[SheetBody, Tag("sheet")]
    | Annotated[RopeBody, Tag("rope")]
    | Annotated[TetMeshBody, Tag("tet_mesh")],
    Discriminator(_body_tag),
]


class BudgetSpec(Spec):
    """What simulating may cost."""

    rtf: Positive = Field(description="least real-time factor: simulated over wall seconds, in one process [1]")


class Scene(Spec):
    """One scene: a body, tools, their motion, and how to simulate them."""

    softseam: Literal[1] = Field(description="version of the scene format")
    name: str = Field(
        min_length=1,
        max_length=64,
        pattern=r"^[A-Za-z0-9_\-]+$",
        description="names recordings: letters, digits, _ and -",
    )
    gravity: Vector = Field(default=(0.0, 0.0, -9.81), description="[m/s^2]")
    step: Positive = Field(default=0.01, le=1.0, description="macro step [s]")
    duration: Positive | None = Field(default=None, description="simulated time [s]; default: the end of the motion")
    seed: int = Field(default=0, ge=0)
    body: AnyBody
    tools: dict[ToolName, ToolSpec] = Field(default={}, description="rigid tools by name")
    motion: tuple[Phase, ...] = Field(default=(), description="phases, one after another")
    regions: RegionsSpec = RegionsSpec()
    models: ModelsSpec = ModelsSpec()
    seam: SeamSpec = SeamSpec()
    symmetry: tuple[Literal["x", "y", "z"], ...] = Field(
        default=(),
        description="axes across which the scene is symmetric, about planes through the middle of the body: where fem "
        "has all cells it solves for a half, a quarter or an eighth; refused where the scene is not symmetric",
    )
    quantities: tuple[QuantityName, ...] = Field(default=(), description="reported for every step")
    probes: dict[ProbeName, Vector] = Field(
        default={}, description="points of the body at rest [m]; von Mises stress and displacement are reported there"
    )

    tolerance: Positive | None = Field(
        default=None,
        lt=1.0,
        description="largest error of any quantity, L2 over time: cells, step and models are then chosen for it [1]",
    )
    budget: BudgetSpec | None = Field(default=None, description="what they may cost; goes with a tolerance")

    @model_validator(mode="after")
    def _consistent(self) -> Scene:
        if self.budget is not None and self.tolerance is None:
            raise wrong("a budget goes with a tolerance: add one, e.g. tolerance: 0.05", "budget")
        for i, phase in enumerate(self.motion):
            if isinstance(phase, TurnPhase) and phase.speed * self.step > LARGEST_TURN:
                angle = phase.speed * self.step
                raise wrong(f"{angle:.3g} rad a step, more than {LARGEST_TURN:g}", "motion", i, "speed")
            if not isinstance(phase, HoldPhase):
                self._known(phase.tools, "motion", i, "tools")
        if self.regions.near is not None:
            self._known(self.regions.near.tools or (), "regions", "near", "tools")
        self._symmetry_is_used()
        if isinstance(self.body, BodySpec):
            self._kinds_meet(self.body)
        else:
            self._particles_alone(self.body)
        if self.duration is None and not self.motion:
            raise wrong("give a duration, or a motion whose end is the end of the run")
        if self.duration is not None and self.duration / self.step > MOST_STEPS:
            raise wrong(f"{self.duration / self.step:.3g} steps, more than {MOST_STEPS:,}", "duration")
        return self

    def _symmetry_is_used(self) -> None:
        """Raise if `symmetry` names an axis twice, or asks what no solver of this scene can do."""
        if not self.symmetry:
            return
        if len({*self.symmetry}) < len(self.symmetry):
            raise wrong("an axis is named twice: name each once", "symmetry")
        near, fem = self.regions.near, self.models.fem
        if "fem" not in (self.regions.default, near.model if near else ""):
            raise wrong("only fem solves for one side, and no region is fem's: leave it out", "symmetry")
        if fem.element.startswith("tet"):
            raise wrong(f"{fem.element} divides cells otherwise on either side: leave it out, or use hex27", "symmetry")
        if fem.integrator == "symplectic_euler":
            raise wrong("symplectic_euler solves no equations: leave it out", "symmetry")

    def _particles_alone(self, body: ParticleBodySpec) -> None:
        """Raise if the scene asks something of a body of particles that only one in cells can do."""
        have = f"a {body.kind} is made of particles, not cells"
        if isinstance(body, TetMeshBody):
            if self.models.pbd.method == "pbd":
                raise wrong("classic pbd has no Young's modulus: a tet_mesh needs xpbd", "models", "pbd", "method")
            for i, phase in enumerate(self.motion):
                if isinstance(phase, GripPhase | ReleasePhase):
                    key = "grip" if isinstance(phase, GripPhase) else "release"
                    raise wrong("a tet_mesh is held by friction: close two tools on it", "motion", i, key)
        if body.constraints and self.models.pbd.method == "pbd":
            raise wrong("classic pbd has no compliance: constraints need xpbd", "models", "pbd", "method")
        if self.models.pbd.method == "leapfrog":
            raise wrong(f"{have}: leapfrog moves cells, use xpbd", "models", "pbd", "method")
        if self.models.pbd.residual is not None:
            raise wrong(f"{have}: only blocks have a residual, leave it out", "models", "pbd", "residual")
        if self.models.pbd.coarse is not None:
            raise wrong(f"{have}: leave it out", "models", "pbd", "coarse")
        if self.models.pbd.damping != DampingSpec():
            raise wrong(f"{have}: say body.damping", "models", "pbd", "damping")
        if self.regions.default != "pbd":
            raise wrong(f"{have}: only pbd can simulate it", "regions", "default")
        if self.regions.near is not None:
            raise wrong(f"{have}, and is not cut into regions: leave `near` out", "regions", "near")
        if self.regions.goal is not None:
            raise wrong(f"{have}, and has no goal: leave it out", "regions", "goal")
        if self.probes:
            raise wrong(f"{have}, and has no stress to probe", "probes")
        for i, quantity in enumerate(self.quantities):
            if QUANTITIES[quantity].of == "cells":
                raise wrong(f"{have}, and has no {quantity}", "quantities", i)
        for i, phase in enumerate(self.motion):
            if isinstance(phase, ClosePhase) and phase.force is not None:
                raise wrong(f"{have}: close on it by time, or grip it", "motion", i, "force")
        for name, tool in self.tools.items():
            if not isinstance(tool, PlaneTool) and tool.force_limit is not None:
                raise wrong(f"{have}: drives with a force_limit need cells", "tools", name, "force_limit")

    def _kinds_meet(self, body: BodySpec) -> None:
        """Raise if integrator, models, seam and tools do not go together."""
        near = self.regions.near
        problem = integrator_problem(
            self.models.fem.integrator, self.seam.scheme if near else None, bool(self.tools), bool(body.fixed)
        )
        models = {self.regions.default, near.model if near else self.regions.default}
        if problem and "fem" in models:
            raise wrong(problem, "models", "fem", "integrator")
        if body.material.retardation_time > 0.0:
            self.models.check_viscous(models)
        own = isinstance(body.shape, MeshShape) and body.shape.cells == "own"
        if own and near:
            raise wrong(
                "hexahedra of a file have one model, for a seam runs along faces that are rectangles: leave out "
                "regions.near, or `cells: own`", "body", "shape", "cells",
            )  # fmt: skip
        round_cells = (
            isinstance(body.shape, BlockShape)
            and body.shape.borders == "materials"
            and inner_ball(body.shape.size, body.position, body.inclusions) is not None
        )
        if round_cells and near:
            raise wrong(
                "cells that follow a sphere have one model, for a seam runs along faces that are rectangles: leave out "
                "regions.near, or `borders`", "body", "shape", "borders",
            )  # fmt: skip
        if (own or (isinstance(body.shape, BlockShape) and body.shape.graded)) and "pbd" in models:
            said = "the model error of pbd is measured on boxes of one size"
            if near and near.error is not None:
                raise wrong(
                    f"{said}: leave out regions.near.error, or body.shape.grading, towards and borders",
                    "regions",
                    "near",
                    "error",
                )
            if "model_error" in self.quantities:
                place = ("quantities", self.quantities.index("model_error"))
                raise wrong(f"{said}: leave out this quantity, or cells of other shapes", *place)
        self._has_goal(own or (isinstance(body.shape, BlockShape) and body.shape.graded))
        if self.models.pbd.coarse is not None and "pbd" in models:
            if self.regions.goal is not None:
                said = "errors of a goal are told of cells of eight blocks"
                raise wrong(f"{said}: leave out models.pbd.coarse, or goal", "regions", "goal")
            said = "the model error of pbd is measured on cells of eight blocks"
            if near and near.error is not None:
                raise wrong(f"{said}: leave out regions.near.error, or models.pbd.coarse", "regions", "near", "error")
            if "model_error" in self.quantities:
                place = ("quantities", self.quantities.index("model_error"))
                raise wrong(f"{said}: leave out this quantity, or models.pbd.coarse", *place)
        if isinstance(body.shape, BlockShape):
            self._known(body.shape.towards, "body", "shape", "towards")
            tool_borders(body.shape.size, body.position, self.tools, body.shape.towards)
        for i, name in enumerate(self.quantities):
            if QUANTITIES[name].of == "particles":
                raise wrong(f"only sheets and ropes have {name}", "quantities", i)
        if self.models.pbd.method == "leapfrog" and "pbd" in models:
            meets = "a seam" if near is not None else "tools" if self.tools else ""
            cure = ", or leave out regions.near" if near is not None else ""
            if meets:
                raise wrong(
                    f"leapfrog solves no equations and cannot meet {meets}: use xpbd{cure}", "models", "pbd", "method"
                )
        if self.models.pbd.method == "pbd":
            raise wrong("classic pbd moves sheets and ropes: a body in cells needs xpbd", "models", "pbd", "method")
        for i, phase in enumerate(self.motion):
            if isinstance(phase, GripPhase | ReleasePhase):
                key = "grip" if isinstance(phase, GripPhase) else "release"
                raise wrong("a body in cells is held by friction: close two tools on it", "motion", i, key)
        if self.models.fem.step_error is not None and near is not None and "fem" in models:
            raise wrong(
                "substeps by error cannot meet a seam, whose compliance is that of one step: leave out step_error and "
                "shorten `step`, or give all cells to fem without regions.near",
                "models",
                "fem",
                "step_error",
            )

    def _has_goal(self, uneven: bool) -> None:
        """Raise if the goal is nothing that this scene has, or one of cells that are no boxes of one size."""
        goal, at = self.regions.goal, ("regions", "goal")
        if goal is None:
            return
        if uneven:
            raise wrong("errors of a goal are told of boxes of one size: leave out body.shape.grading, or goal", *at)
        if goal == "grip_force":
            if not any(isinstance(phase, ClosePhase) for phase in self.motion):
                raise wrong("no phase closes two tools: name a probe instead, or add a phase with `close`", *at)
        elif goal not in self.probes:
            have = ", ".join(["grip_force", *self.probes])
            raise wrong(f"{goal!r} is not among the goals: {have}", *at)

    def _known(self, names: tuple[str, ...], *at: str | int) -> None:
        """Raise if one of the names is not a tool."""
        for i, name in enumerate(names):
            if name not in self.tools:
                message = f"no tool is called {name!r}"
                raise PydanticCustomError(
                    "scene", "{message}", {"message": message, "at": (*at, i), "have": list(self.tools)}
                )
