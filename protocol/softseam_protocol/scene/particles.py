"""Bodies of particles in a scene: sheets (cloth), ropes, meshes of tetrahedra, in physical units; PBD moves them."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, SerializationInfo, SerializerFunctionWrapHandler, model_serializer, model_validator

from softseam_protocol.scene.friction_field import FrictionFieldSpec
from softseam_protocol.scene.mesh_files import MeshPart, MeshScale, MeshUp, usual_scale, usual_up
from softseam_protocol.scene.regions import OwnRegions
from softseam_protocol.scene.spec import (
    BoxRegion,
    NonNegative,
    OfKind,
    Positive,
    Rotation,
    Spec,
    Vector,
    check_edge,
    wrong,
)
from softseam_protocol.table import Table

MOST_PARTICLES = 1_000_000
COVERS = math.sqrt(0.5)
"""thickness in spacings from which on balls on a square lattice let nothing of their own size through"""

Divisions = Annotated[int, Field(ge=1)]


class ConstraintSpec(Spec):
    """What every further constraint has. Each kind is a subclass with the keys of its own, a row of CONSTRAINTS."""

    kind: str


class VolumeSpec(ConstraintSpec):
    """Each tetrahedron of a tet_mesh keeps its volume, beside what its material asks for."""

    kind: Literal["volume"] = "volume"
    bulk: Positive = Field(description="bulk modulus that it adds [Pa]")


class HingeSpec(ConstraintSpec):
    """The triangles of a sheet bend at their edges, by their angle: beside what the sheet's own bending keeps flat."""

    kind: Literal["hinge"] = "hinge"
    bending: Positive = Field(description="moment per width and curvature that it adds [N m]")
    curvature: tuple[float, float] = Field(
        default=(0.0, 0.0),
        description="that the sheet has at rest along its own x and y, positive where its ends rise along z [1/m]",
    )


CONSTRAINTS: Table[type[ConstraintSpec]] = Table(
    "constraint specifications", {"volume": VolumeSpec, "hinge": HingeSpec}
)
"""the specification of each kind: springs, bends and tetrahedra of a body need none; services have its constraint
(softseam_services.pbd.particles.constraints.CONSTRAINTS)"""

AnyConstraint = Annotated[ConstraintSpec, OfKind(CONSTRAINTS)]
"""a constraint of any kind that CONSTRAINTS has"""


class _Particles(OwnRegions):
    """What all have alike."""

    made_of = "particles"
    position: Vector = Field(default=(0.0, 0.0, 0.0), description="its middle [m]")
    rotation: Rotation = Field(
        default=(0.0, 0.0, 0.0),
        description="turn about its middle",
    )
    fixed: tuple[BoxRegion, ...] = Field(default=(), description="particles at rest inside these boxes are clamped")
    velocity: Vector = Field(default=(0.0, 0.0, 0.0), description="initial velocity [m/s]")
    damping: NonNegative = Field(default=0.0, description="drag of still air: force over mass and velocity [1/s]")
    restitution: float = Field(
        default=0.0, ge=0.0, le=1.0, description="share of its speed that a particle keeps when it meets a tool [1]"
    )
    constraints: tuple[AnyConstraint, ...] = Field(
        default=(), description="what holds its particles beside its own stiffness; further kinds come with extensions"
    )
    friction_field: FrictionFieldSpec | None = Field(
        default=None, description="how friction on tools varies over it; default: not at all"
    )

    @model_serializer(mode="wrap")
    def _dumped(self, handler: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        """In version 1 of the scene format bodies say what came later only where they have some: hashes hold it."""
        said: dict[str, Any] = handler(self)
        for key in ("constraints", "friction_field", "size", "divisions"):
            if not getattr(self, key, None):
                said.pop(key, None)
        return said


class SheetBody(_Particles):
    """A thin sheet, flat at rest: particles on a lattice along x and y, as stiff as a sheet of one material."""

    kind: Literal["sheet"]
    size: tuple[Positive, Positive] = Field(description="edge lengths along x and y [m]")
    divisions: tuple[Divisions, Divisions] = Field(description="spacings of the lattice along x and y")
    density: Positive = Field(description="mass per area [kg/m^2]")
    stretch: Positive = Field(description="Young's modulus times thickness: force per width and strain [N/m]")
    shear: Positive | None = Field(
        default=None, description="shear modulus times thickness [N/m]; default: 3/8 of stretch, as if isotropic"
    )
    bending: NonNegative = Field(default=0.0, description="moment per width and curvature [N m]")
    thickness: Positive | None = Field(
        default=None, description="distance that layers, and twice that tools, keep [m]; default: 3/4 of a spacing"
    )
    friction: NonNegative = Field(default=0.3, description="Coulomb coefficient of the sheet on itself [1]")
    self_contact: bool = Field(default=True, description="whether layers of the sheet keep apart")

    @model_validator(mode="after")
    def _plausible(self) -> SheetBody:
        for i, edge in enumerate(self.size):
            check_edge(edge, "size", i)
        n = math.prod(count + 1 for count in self.divisions)
        if n > MOST_PARTICLES:
            raise wrong(f"{n:,} particles, more than {MOST_PARTICLES:,}: give fewer divisions", "divisions")
        spacing = [edge / count for edge, count in zip(self.size, self.divisions, strict=True)]
        if max(spacing) > 1.5 * min(spacing):
            sides = " x ".join(f"{1e3 * side:.3g}" for side in spacing)
            raise wrong(f"spacings of {sides} mm are too unlike: choose more even divisions", "divisions")
        shear = 0.375 * self.stretch if self.shear is None else self.shear
        if self.axial(shear) <= shear * (max(spacing) / min(spacing)) ** 2:
            raise wrong(
                f"{shear:g} N/m in shear beside {self.stretch:g} N/m in stretch is more than a lattice of springs can "
                "show: lower shear, or choose more even divisions",
                "shear" if self.shear is not None else "divisions",
            )
        self._check_hinges(spacing)
        if self.self_contact and self.thickness is not None and self.thickness < COVERS * max(spacing):
            least = COVERS * max(spacing)
            raise wrong(
                f"layers {1e3 * self.thickness:.3g} mm thick would slip through each other between particles: at least "
                f"{1e3 * least:.3g} mm, more divisions, or self_contact: false",
                "thickness",
            )
        return self

    def _check_hinges(self, spacing: list[float]) -> None:
        """Raise where a hinge's cylinder at rest is tighter than the lattice (spacings along x and y) shows."""
        for i, spec in enumerate(self.constraints):
            curvature = spec.curvature if isinstance(spec, HingeSpec) else (0.0, 0.0)
            tightest = max(abs(k) * side for k, side in zip(curvature, spacing, strict=True))
            if tightest > 1.0:
                raise wrong(
                    f"a radius at rest of {1.0 / tightest:.2g} spacings is less than one: choose more divisions, or a "
                    "smaller curvature",
                    *("constraints", i, "curvature"),
                )

    @property
    def own_lengths(self) -> tuple[float, ...]:
        return self.size

    def strain_force(self, length: float) -> float:
        return self.stretch * length

    def axial(self, shear: float) -> float:
        """C11 of a lattice, whose C12 is its shear stiffness: Y = C11 - C12^2/C11 is the stretch [N/m]."""
        return 0.5 * (self.stretch + math.hypot(self.stretch, 2.0 * shear))


class RopeBody(_Particles):
    """A rope or rod, straight along x at rest."""

    kind: Literal["rope"]
    length: Positive = Field(description="[m]")
    divisions: Divisions = Field(description="spacings along it")
    density: Positive = Field(description="mass per length [kg/m]")
    stretch: Positive = Field(description="E A: force over strain [N]")
    bending: NonNegative = Field(default=0.0, description="E I: moment over curvature [N m^2]")
    radius: Positive | None = Field(default=None, description="distance that tools keep [m]; default: 1/4 of a spacing")

    @model_validator(mode="after")
    def _plausible(self) -> RopeBody:
        check_edge(self.length, "length")
        if self.divisions + 1 > MOST_PARTICLES:
            raise wrong(f"more than {MOST_PARTICLES:,} particles: give fewer divisions", "divisions")
        return self

    @property
    def own_lengths(self) -> tuple[float, ...]:
        return (self.length,)

    def strain_force(self, length: float) -> float:
        return self.stretch


class TetMeshBody(_Particles):
    """A solid of tetrahedra from a file, or a block in cubes of five each: a particle at each corner."""

    held_by_friction = True
    kind: Literal["tet_mesh"]
    path: Annotated[str, Field(min_length=1)] | None = Field(
        default=None, description="mesh file of tetrahedra, relative to the scene file; default: a block of `size`"
    )
    size: tuple[Positive, Positive, Positive] | None = Field(default=None, description="edge lengths of a block [m]")
    divisions: tuple[Divisions, Divisions, Divisions] | None = Field(
        default=None, description="cubes of a block along x, y and z"
    )
    part: MeshPart = None
    scale: MeshScale = Field(default_factory=usual_scale)
    up: MeshUp = Field(default_factory=usual_up)
    density: Positive = Field(description="[kg/m^3]")
    young: Positive = Field(description="Young's modulus [Pa]")
    poisson: float = Field(gt=0.0, lt=0.5, description="Poisson's ratio [1]")
    law: Literal["st_venant_kirchhoff", "neo_hookean"] = Field(
        default="st_venant_kirchhoff",
        description="material: st_venant_kirchhoff, by seven strains a tetrahedron, for small strains; neo_hookean, "
        "by a pair of constraints, for large ones and what may turn inside out; classic pbd has none",
    )

    @model_validator(mode="after")
    def _one_shape(self) -> TetMeshBody:
        if self.path is not None:
            for key in ("size", "divisions"):
                if getattr(self, key) is not None:
                    raise wrong(f"the file at `path` says it: leave out {key}, or path", key)
            return self
        if self.size is None or self.divisions is None:
            raise wrong("say of what: `path`, a file of tetrahedra, or `size` and `divisions` of a block", "kind")
        for key, default in (("part", None), ("scale", 1.0), ("up", "z")):
            if getattr(self, key) != default:
                raise wrong(f"a block has no {key}, which is of files: leave it out", key)
        for i, edge in enumerate(self.size):
            check_edge(edge, "size", i)
        n = math.prod(count + 1 for count in self.divisions)
        if n > MOST_PARTICLES:
            raise wrong(f"{n:,} particles, more than {MOST_PARTICLES:,}: give fewer divisions", "divisions")
        return self

    @property
    def named_files(self) -> tuple[tuple[tuple[str, ...], str], ...]:
        return () if self.path is None else ((("path",), self.path),)

    def strain_force(self, length: float) -> float:
        return self.young * length**2


ParticleBodySpec = SheetBody | RopeBody | TetMeshBody
