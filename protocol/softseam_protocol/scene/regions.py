"""Which cells of a body get which model, and how the two are held together at the seam."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import Field, ValidationInfo, field_validator, model_validator

from softseam_protocol.models import FAR_DEFAULT, MODELS, NEAR_DEFAULT, ModelKind, that
from softseam_protocol.scene.friction_field import FrictionFieldSpec
from softseam_protocol.scene.kinds import SCHEMES
from softseam_protocol.scene.materials import MaterialSpec
from softseam_protocol.scene.repeat import RepeatSpec
from softseam_protocol.scene.spec import BoxRegion, Positive, RowOf, Spec, wrong

if TYPE_CHECKING:  # which stands on this
    from softseam_protocol.scene.bodies import BodySpec

Said = TypeVar("Said")


class NearSpec(Spec):
    """The near region: cells close to tools, under stress, in error or in boxes get a participant of their own."""

    model: Annotated[str, RowOf(MODELS)] = NEAR_DEFAULT
    within: Positive | None = Field(default=None, description="distance to a tool that makes a cell near [m]")
    tools: tuple[str, ...] | None = Field(default=None, description="default: the tools that move")
    boxes: tuple[BoxRegion, ...] = Field(default=(), description="cells with their centre in a box are always near")
    ahead: float | None = Field(
        default=None,
        ge=0.0,
        le=10.0,
        description="a tool counts as closer by its approach in this time [s]; default: two steps",
    )
    stress: Positive | None = Field(
        default=None, description="von Mises stress that makes a cell near; it stays so above 0.3 of that [Pa]"
    )
    error: Positive | None = Field(
        default=None,
        description="largest model error of pbd, in the energy norm or of regions.goal: cells with more than their "
        "share are near [1]",
    )
    release: float = Field(default=1.5, ge=1.0, description="a near cell is released beyond release * within [1]")
    patience: int = Field(default=20, ge=1, description="steps a cell stays near after its last reason to be [1]")
    split: Literal["when_cheaper", "always"] = Field(
        default="when_cheaper",
        description="when_cheaper: where fem on the whole body costs no more than the cut that `within` asks for, all "
        "cells are near while any is, and always where that costs no more than the default model either; "
        "always: cut as asked",
    )

    @model_validator(mode="after")
    def _some(self) -> NearSpec:
        if self.within is None and self.stress is None and self.error is None and not self.boxes:
            raise wrong("say which cells are near: within (a distance to tools), stress, error or boxes")
        return self


class RegionsSpec(Spec):
    """Which cells get which model."""

    near: NearSpec | None = None
    default: Annotated[str, RowOf(MODELS)] | None = Field(
        default=None,
        validate_default=True,
        description="model of every cell that is not near; default: beside `near` it is pbd; without, fem where the "
        "body is small, else fem near the tools that move and pbd elsewhere",
    )
    goal: str | None = Field(
        default=None,
        description="grip_force, or the name of a probe, for its von Mises stress: the run says at its end how far "
        "that is off, and near.error is a bound of its relative error in the place of the body's in the energy norm",
    )

    @property
    def cut(self) -> bool:
        """Whether some cells may have another model than the rest."""
        return self.near is not None

    @property
    def models(self) -> tuple[ModelKind | None, ModelKind | None]:
        """Of the cells that are not near, and of those that are or would be; None: not chosen yet."""
        return self.default, self.default if self.near is None else self.near.model

    @property
    def hybrid(self) -> bool:
        """Whether near cells have another model than the rest."""
        return self.near is not None and self.near.model != self.default

    @property
    def always_cut(self) -> RegionsSpec:
        """The same, cut whatever that costs."""
        near = None if self.near is None else self.near.model_copy(update={"split": "always"})
        return self.model_copy(update={"near": near})

    @property
    def within(self) -> float | None:
        """Distance to a tool that makes a cell near [m]; None: none does."""
        return None if self.near is None else self.near.within

    @property
    def boxes(self) -> tuple[BoxRegion, ...]:
        """In which cells are always near."""
        return () if self.near is None else self.near.boxes

    @property
    def tools(self) -> tuple[str, ...] | None:
        """That make cells near; None: those that move."""
        return None if self.near is None else self.near.tools

    @property
    def far(self) -> ModelKind:
        """Model of the cells that are not near. Raises ValueError where none is named."""
        if self.default is None:
            raise ValueError("the regions name no model")
        return self.default

    @field_validator("default")
    @classmethod
    def _beside_near(cls, default: ModelKind | None, info: ValidationInfo) -> ModelKind | None:
        """Who says which cells are near, and not what the others are, means the usual model."""
        return FAR_DEFAULT if default is None and info.data.get("near") is not None else default

    @model_validator(mode="after")
    def _errs(self) -> RegionsSpec:
        if self.near is None or self.near.error is None:
            return self
        exact, errs = that(lambda facts: facts.errs_by == "mesh"), that(lambda facts: facts.errs_by == "model")
        if self.near.model not in exact or self.default not in errs:
            near, far = " or ".join(exact), " or ".join(errs)
            said = f"an error of {far} makes cells near: it needs near cells of {near} in a body of {far}"
            raise wrong(said, "near", "error")
        return self


class OwnRegions(Spec):
    """What every body has: regions of its own, where a scene has several, and facts that hold for its kind. Each kind
    is a subclass with the keys of its own, a row of `softseam_protocol.scene.bodies.BODIES`."""

    made_of: ClassVar[Literal["cells", "particles", "points"]] = "points"
    """particles: points that XPBD's constraints join, whose quantities it alone reports"""
    usual_model: ClassVar[ModelKind] = FAR_DEFAULT
    """where the scene names none"""
    held_by_friction: ClassVar[bool] = False
    """whether nothing can grip its points, but tools that close on it hold it"""
    if TYPE_CHECKING:  # the name of its row; as a field of this class it would come first in texts
        kind: str
    regions: RegionsSpec | None = Field(
        default=None,
        exclude_if=lambda regions: regions is None,
        description="which of its cells get which model; default: the scene's `regions`",
    )
    repeat: RepeatSpec | None = Field(
        default=None,
        exclude_if=lambda repeat: repeat is None,
        description="copies of it on a grid, of one of several bodies; default: it is there once",
    )

    @property
    def has_cells(self) -> bool:
        return self.made_of == "cells"

    @property
    def in_cells(self) -> BodySpec | None:
        """The same as one in cells; None where it is none."""
        return None

    @property
    def no_cells(self) -> str:
        """Why what needs cells does not go with it."""
        particles = f"a {self.kind} is made of particles, not cells"
        return particles if self.made_of == "particles" else f"a body of {self.kind} has no cells"

    def said(self, key: str, default: Said) -> Said:
        """What it says by a key that many kinds have (position, fixed, velocity, damping); else the default."""
        found: Said = getattr(self, key, default)
        return found

    @property
    def tetrahedral(self) -> bool:
        """Whether it is in cells that are tetrahedra of a file."""
        return False

    @property
    def cell_materials(self) -> tuple[MaterialSpec, ...]:
        """Its own, then those of its inclusions; none of what is not in cells."""
        return ()

    @property
    def wanted_edges(self) -> tuple[float, ...]:
        """Edges along x, y and z that its cells are to have [m]; none where it leaves them open, or has no cells."""
        return ()

    @property
    def named_files(self) -> tuple[tuple[tuple[str, ...], str], ...]:
        """Files that it needs: the key of each in its specification, and its path relative to the scene file."""
        return ()

    @property
    def own_lengths(self) -> tuple[float, ...]:
        """Its edge lengths [m]; none where its keys alone do not say them."""
        return ()

    def strain_force(self, length: float) -> float:
        """About the force that would strain a body of this length [m] by 1 [N]; 0 where nothing is known of it."""
        return 0.0

    @property
    def uneven_friction(self) -> FrictionFieldSpec | None:
        """How friction on tools varies over it."""
        even: FrictionFieldSpec | None = None
        return self.said("friction_field", even)


_REFUSED_SCHEMES = {
    "ph": "velocities tied by a multiplier that is linear in time (Prakash-Hjelmstad) let the gap drift: use position",
    "gc": "a multiplier in every substep (Gravouil-Combescure) takes energy at the seam and lets the gap drift: use "
    "position",
    "velocity": "velocities tied by a constant multiplier gain energy with every integrator: use position",
    "arlequin": "overlapping regions that share their energy are a study of linear bars so far: use position",
}
"""known, and not there unless a row from outside brings it"""


class SeamSpec(Spec):
    """How the two sides of the seam are held together, and when they agree well enough."""

    scheme: Annotated[str, RowOf(SCHEMES)] = Field(
        default="position",
        description="position: no gap at the end of a step, one multiplier over it; staggered: one side after the "
        "other, the control that fails where the near side is heavy or stiff",
    )
    tolerance: Positive = Field(
        default=3e-4,
        description="largest position gap at commit, in cell edges [1]; a step is redone up to four times, too, where "
        "more than ten times that share of the seam's forces is in doubt",
    )
    exchanges: int = Field(default=16, ge=1, description="most exchanges a step, or a part of one")

    @field_validator("scheme", mode="before")
    @classmethod
    def _known_scheme(cls, name: Any) -> Any:
        why = _REFUSED_SCHEMES.get(name) if isinstance(name, str) and name not in SCHEMES else None
        if why:
            raise wrong(f"{name} is not among the schemes, {why}")
        return name

    @model_validator(mode="after")
    def _scheme_solves(self) -> SeamSpec:
        facts = SCHEMES[self.scheme]
        if self.exchanges < facts.least_exchanges:
            raise wrong(
                f"{self.scheme} {facts.why_exchanges}: use {facts.least_exchanges} exchanges or more, or "
                "scheme: position",
                "exchanges",
            )
        return self
