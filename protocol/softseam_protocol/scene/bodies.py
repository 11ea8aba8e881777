"""Bodies of a scene: of cells, which blocks and meshes fill, of particles, or of what extensions bring."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import (
    Discriminator,
    Field,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    Tag,
    model_serializer,
    model_validator,
)

from softseam_protocol.scene.friction_field import FrictionFieldSpec
from softseam_protocol.scene.kinds import IN_BLOCKS, IN_MESHES, ON_TETRAHEDRA, ElementKind
from softseam_protocol.scene.ladder import AnyRung
from softseam_protocol.scene.materials import AnyMaterial, InclusionSpec, MaterialSpec
from softseam_protocol.scene.mesh_files import MeshPart, MeshScale, MeshUp, usual_scale, usual_up
from softseam_protocol.scene.particles import RopeBody, SheetBody, TetMeshBody
from softseam_protocol.scene.regions import OwnRegions
from softseam_protocol.scene.spec import BoxRegion, NonNegative, OfKind, Positive, Spec, Vector, check_edge, wrong
from softseam_protocol.scene.tools import ToolName
from softseam_protocol.table import Table

BodyName = ToolName

MOST_CELLS = 200_000

Grading = Annotated[float, Field(ge=1.0, le=20.0)]


def _grading_tag(value: Any) -> str:
    return "three numbers" if isinstance(value, list | tuple) else "one number"


def cells_along(size: tuple[float, float, float], edges: tuple[float, float, float]) -> tuple[int, int, int]:
    """How many cells of about these edges [m] fill a block of this size [m] along x, y, z."""
    x, y, z = (max(1, round(length / edge)) for length, edge in zip(size, edges, strict=True))
    return x, y, z


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
    """A closed surface or solid mesh, embedded in cells of one size, or hexahedra or tetrahedra that are the cells."""

    kind: Literal["mesh"] = "mesh"
    path: str = Field(min_length=1, description="mesh file, relative to the scene file")
    part: MeshPart = None
    scale: MeshScale = Field(default_factory=usual_scale)
    up: MeshUp = Field(default_factory=usual_up)
    cells: Literal["boxes", "own", "tetrahedra"] = Field(
        default="boxes",
        description="boxes: cells of one size that the solid fills partly; own: the file's hexahedra; tetrahedra: the "
        "file's, of 4 or 10 nodes, for fem",
    )


Shape = Annotated[BlockShape | MeshShape, Field(discriminator="kind")]


def _cell_tag(value: Any) -> str:
    return "three edges" if isinstance(value, list | tuple) else "one edge"


class BodySpec(OwnRegions):
    """A deformable body in cells; its bounding box stands with the base's centre at `position`."""

    made_of = "cells"
    kind: Literal["cells"] = "cells"
    shape: Shape
    position: Vector = Field(default=(0.0, 0.0, 0.0), description="base centre of the bounding box [m]")
    cell: (
        Annotated[
            Annotated[Positive, Tag("one edge")] | Annotated[tuple[Positive, Positive, Positive], Tag("three edges")],
            Discriminator(_cell_tag),
        ]
        | None
    ) = Field(
        default=None,
        description="cell edge, or edges along x, y, z [m], of a mesh that its file has turned along its own axes "
        "next to these; default: a third of a block's least extent, longer where that were thousands of cells, of a "
        "mesh by its walls; less where round tools, or tools from files, are narrow; of blocks among three or more "
        "that touch, in a scene that names no model, a quarter of the one's that tools take, half of the others'",
    )
    material: AnyMaterial
    inclusions: tuple[InclusionSpec, ...] = Field(
        default=(), description="parts of another material; an octant of a cell is of the last that holds its centre"
    )
    fixed: tuple[BoxRegion, ...] = Field(default=(), description="nodes at rest inside these boxes are clamped")
    velocity: Vector = Field(default=(0.0, 0.0, 0.0), description="initial velocity [m/s]")
    spin: Vector = Field(
        default=(0.0, 0.0, 0.0), description="initial angular velocity about the centre of mass [rad/s]"
    )
    damping: NonNegative = Field(
        default=0.0,
        description="drag of still air, in every model: force over mass and velocity, so that an oscillation decays "
        "with half of it [1/s]",
    )
    ladder: tuple[AnyRung, ...] = Field(
        default=(),
        exclude_if=lambda rungs: not rungs,
        description="what it may be simulated as while it runs, chosen before each step: of the rungs that hold, the "
        "last; default: as it is",
    )
    friction_field: FrictionFieldSpec | None = Field(
        default=None, description="how friction on tools varies over its surface; default: not at all"
    )

    @model_serializer(mode="wrap")
    def _dumped(self, handler: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        """In version 1 of the scene format bodies in cells say damping, and how friction varies, only where they have
        some: hashes hold it."""
        said: dict[str, Any] = handler(self)
        if self.damping == 0.0:
            said.pop("damping", None)
        if self.friction_field is None:
            said.pop("friction_field", None)
        return said

    @model_validator(mode="after")
    def _sized_once(self) -> BodySpec:
        if isinstance(self.shape, MeshShape) and self.shape.cells != "boxes" and self.cell is not None:
            what = "hexahedra" if self.shape.cells == "own" else "tetrahedra"
            raise wrong(f"the file's {what} are the cells: leave out `cell`, or `cells: {self.shape.cells}`", "cell")
        return self

    @model_validator(mode="after")
    def _one_law(self) -> BodySpec:
        for i, inclusion in enumerate(self.inclusions):
            inclusion.material.within(self.material, "inclusions", i, "material")
        return self

    @property
    def in_cells(self) -> BodySpec:
        """It is."""
        return self

    @property
    def tetrahedral(self) -> bool:
        """Whether the cells are tetrahedra of a file."""
        return isinstance(self.shape, MeshShape) and self.shape.cells == "tetrahedra"

    @property
    def cell_materials(self) -> tuple[MaterialSpec, ...]:
        return self.materials

    @property
    def wanted_edges(self) -> tuple[float, ...]:
        if self.cell is None:
            return ()
        return self.cell if isinstance(self.cell, tuple) else (self.cell,) * 3

    @property
    def named_files(self) -> tuple[tuple[tuple[str, ...], str], ...]:
        return ((("shape", "path"), self.shape.path),) if isinstance(self.shape, MeshShape) else ()

    @property
    def own_lengths(self) -> tuple[float, ...]:
        return self.shape.size if isinstance(self.shape, BlockShape) else ()

    def strain_force(self, length: float) -> float:
        return min(material.young for material in self.materials) * length**2

    @property
    def element(self) -> ElementKind:
        """FEM's, where the scene names none."""
        if self.tetrahedral:
            return ON_TETRAHEDRA
        return IN_MESHES if isinstance(self.shape, MeshShape) and self.shape.cells == "boxes" else IN_BLOCKS

    @property
    def materials(self) -> tuple[MaterialSpec, ...]:
        """The body's own, then one for each inclusion."""
        return (self.material, *(inclusion.material.within(self.material) for inclusion in self.inclusions))

    @property
    def says_strength(self) -> bool:
        """Whether some of its materials do."""
        return any(material.strength is not None for material in self.materials)

    @model_validator(mode="after")
    def _countable(self) -> BodySpec:
        if isinstance(self.shape, BlockShape) and self.cell is not None:
            edges = self.cell if isinstance(self.cell, tuple) else (self.cell, self.cell, self.cell)
            n_cells = math.prod(cells_along(self.shape.size, edges))
            if n_cells > MOST_CELLS:
                size = " x ".join(f"{edge:g}" for edge in self.shape.size)
                what = f"{size} m in {n_cells:,} cells, more than {MOST_CELLS:,}"
                raise wrong(f"{what}: give a longer cell edge, and all lengths in metres", "cell")
        return self


BODIES: Table[type[OwnRegions]] = Table(
    "kinds of body", {"cells": BodySpec, "sheet": SheetBody, "rope": RopeBody, "tet_mesh": TetMeshBody}
)
"""the specification of each kind; services have what builds it (softseam_services.bodies.DISCRETISATIONS)"""
AnyBody = Annotated[OwnRegions, OfKind(BODIES, default="cells")]
"""a body of any kind that BODIES has"""


class Block(NamedTuple):
    """A body in cells that fill a box exactly."""

    body: BodySpec
    shape: BlockShape


def block_of(body: AnyBody) -> Block | None:
    """The body as a block of cells; None where it is another."""
    cells = body.in_cells
    return Block(cells, cells.shape) if cells is not None and isinstance(cells.shape, BlockShape) else None
