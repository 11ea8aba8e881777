"""Settings of the two models in a scene."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    ConfigDict,
    Discriminator,
    Field,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    Tag,
    model_serializer,
    model_validator,
)

from softseam_protocol.models import facts_of, some_read
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.kinds import ELEMENTS, IN_BLOCKS, INTEGRATORS, ElementKind
from softseam_protocol.scene.spec import BoxRegion, NonNegative, Positive, RowOf, Spec, wrong


class FemSpec(Spec):
    """Settings of the finite-element participant."""

    model_config = ConfigDict(serialize_by_alias=True)

    named: Annotated[str, RowOf(ELEMENTS)] | None = Field(
        default=None,
        alias="element",
        description="hex27: quadratic, one a cell; hex27_reduced: softer, mostly nearer to the truth on coarse cells; "
        "hex8 and tet4: linear, in its eight octants; on a file's tetrahedra tet10, tet4_fbar or tet4; default: hex27 "
        "in a block, hex27_reduced in cells that a mesh's surface cuts, tet10 on a file's tetrahedra",
    )
    integrator: Annotated[str, RowOf(INTEGRATORS)] = Field(
        default="implicit_euler",
        description="implicit_euler damps and meets every seam and contact; static: no inertia; others: second order",
    )
    radius: float | None = Field(
        default=None,
        ge=0.0,
        le=1.0,
        description="share that midpoint and generalised_alpha keep of the fastest oscillations each step; default: "
        "1 and 0.8, with tools 0.5 and 0 [1]",
    )
    tolerance: Positive = Field(
        default=3e-5, description="Newton stops when no node moves more, relative to a cell edge [1]"
    )
    iterations: int = Field(default=30, ge=1, description="Newton iterations before the step is cut")
    step_error: Positive | None = Field(
        default=None,
        description="largest error in position that a substep may make in time, relative to a cell edge; substeps are "
        "as long as it allows; default: the step is one [1]",
    )

    @property
    def element(self) -> ElementKind:
        """The one that is named, or else a block's: `of` names the body's own."""
        return self.named or IN_BLOCKS

    def of(self, body: BodySpec) -> FemSpec:
        """The settings as they are for this body, with an element."""
        own = body.element if self.named is None or (body.tetrahedral and self.named == IN_BLOCKS) else self.named
        return self if own == self.named else self.model_copy(update={"named": own})

    @model_validator(mode="before")
    @classmethod
    def _no_old_key(cls, given: Any) -> Any:
        if isinstance(given, dict) and "mirrored" in given:
            raise wrong(
                "fem solves for all of a body, unless the scene says where it is symmetric: leave this key out; to "
                "solve for one side write e.g. `symmetry: [x, y]` at the top of the scene",
                "mirrored",
            )
        return given

    @model_validator(mode="after")
    def _substeps(self) -> FemSpec:
        if self.step_error is not None and (why := INTEGRATORS[self.integrator].no_error):
            raise wrong(f"{self.integrator} {why}: leave out step_error", "step_error")
        return self

    @model_validator(mode="after")
    def _radius(self) -> FemSpec:
        if self.radius is not None and not INTEGRATORS[self.integrator].radius:
            have = " and ".join(name for name, facts in INTEGRATORS.items() if facts.radius)
            raise wrong(f"{self.integrator} has no radius: only {have} do", "radius")
        return self


def _substeps_tag(value: Any) -> str:
    return "automatic" if isinstance(value, str) else "a count"


class ClassicSpec(Spec):
    """Stiffnesses of classic PBD, shares of a violation that one projection removes: they depend on sweeps and step."""

    stretch: float = Field(default=1.0, gt=0.0, le=1.0, description="of distances [1]")
    bending: float = Field(default=0.1, ge=0.0, le=1.0, description="of bending [1]")
    volume: float = Field(default=1.0, ge=0.0, le=1.0, description="of volumes of tetrahedra [1]")
    per_substep: bool = Field(
        default=False, description="n sweeps together remove that share: each takes 1 - (1 - k)^(1/n)"
    )

    @model_serializer(mode="wrap")
    def _dumped(self, handler: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        """In version 1 of the scene format volume is said only where it differs: hashes hold it."""
        said: dict[str, Any] = handler(self)
        if self.volume == 1.0:
            said.pop("volume", None)
        return said


class DampingSpec(Spec):
    """Rayleigh's damping of cells: the ratio of an oscillation of omega is (mass/omega + stiffness omega)/2."""

    mass: NonNegative = Field(default=0.0, description="in place of body.damping, of xpbd alone [1/s]")
    stiffness: NonNegative = Field(
        default=0.0,
        description="stress over its own rate; implicit Euler's own damping, as of a substep's length, counts [s]",
    )


class CoarseSpec(Spec):
    """Which cells of PBD are one block in place of eight, on the cell's corners; FEM's cells stay as they are."""

    beyond: NonNegative | None = Field(
        default=None,
        description="cells further than this from where the tools that move are at the start; without such tools all "
        "cells are [m]",
    )
    boxes: tuple[BoxRegion, ...] = Field(default=(), description="and cells with their centre in a box")

    @model_validator(mode="after")
    def _some(self) -> CoarseSpec:
        if self.beyond is None and not self.boxes:
            raise wrong("say which cells are coarse: beyond (a distance to tools) or boxes")
        return self


Method = Literal["xpbd", "pbd", "leapfrog"]
CLASSIC_PBD: Method = "pbd"
"""the method without compliance, of particles alone"""
_LABELS: dict[Method, str] = {"xpbd": "XPBD", CLASSIC_PBD: "classic PBD", "leapfrog": "leapfrog"}


class PbdSpec(Spec):
    """Settings of the PBD participant."""

    method: Method = Field(
        default="xpbd",
        description="xpbd: stiffnesses in physical units; pbd: the classic one, of particles (sheet, rope, tet_mesh); "
        "leapfrog: explicit and without dissipation, for bodies in cells that no tool and no other region touches",
    )
    classic: ClassicSpec = Field(default=ClassicSpec(), description="stiffnesses of method: pbd")
    substeps: Annotated[
        Annotated[int, Field(ge=1), Tag("a count")] | Annotated[Literal["auto"], Tag("automatic")],
        Discriminator(_substeps_tag),
    ] = Field(default="auto", description="substeps a step; auto: as many as its stiffest block needs")
    sweeps: int = Field(default=1, ge=1, description="Gauss-Seidel sweeps a substep; with residual the most of them")
    residual: Positive | None = Field(
        default=None,
        lt=1.0,
        description="sweeps end where the stress that blocks apply is so close to what their shapes ask for; default: "
        "when all are done [1]",
    )
    damping: DampingSpec = Field(default=DampingSpec(), description="of bodies in cells")
    hourglass: Literal["physical", "fitted"] = "physical"
    coarse: CoarseSpec | None = Field(
        default=None, description="cells that are one block in place of eight; default: none is"
    )

    @model_validator(mode="after")
    def _sweeps(self) -> PbdSpec:
        if self.method == "leapfrog" and self.sweeps > 1:
            raise wrong("leapfrog solves no equations and sweeps nothing: leave out sweeps", "sweeps")
        if self.method == "leapfrog" and self.damping.stiffness > 0.0:
            raise wrong("leapfrog's substep would shrink with it: leave it out, or use xpbd", "damping", "stiffness")
        if self.residual is not None and (self.method == "leapfrog" or self.sweeps == 1):
            raise wrong("a residual ends sweeps: allow several of xpbd's, e.g. sweeps: 8", "residual")
        return self


class ModelsSpec(Spec):
    """Settings of each model."""

    fem: FemSpec = FemSpec()
    pbd: PbdSpec = PbdSpec()

    def label(self, model: str) -> str:
        """A model's name in a sentence, which is that of its method where the scene may choose one."""
        return _LABELS[self.pbd.method] if some_read([model], "pbd.method") else facts_of(model).label

    def having(self, settings: FemSpec | PbdSpec) -> ModelsSpec:
        """The same with these settings in the place of those of the same model; not validated."""
        (name,) = (name for name in type(self).model_fields if type(getattr(self, name)) is type(settings))
        return self.model_copy(update={name: settings})

    def changed(self, body: BodySpec) -> dict[str, list[str]]:
        """By model's settings their keys that are not what they are for this body in a scene without them."""
        said, usual = self.having(self.fem.of(body)), ModelsSpec(fem=FemSpec().of(body))
        return {name: _set(getattr(said, name), getattr(usual, name)) for name in type(self).model_fields}


def _set(spec: FemSpec | PbdSpec, default: FemSpec | PbdSpec) -> list[str]:
    """Keys that are not what they are in a scene without them."""
    fields = type(spec).model_fields
    return [field.alias or name for name, field in fields.items() if getattr(spec, name) != getattr(default, name)]
