"""A shape: what a file of this package brings, and what an extension adds to the table of them.

softseam's own distances are branches in `distance`, which the compiler puts in line. A shape from outside has its own,
distance(numbers, x, y, z) -> gap, nx, ny, nz: the gap [m], positive outside, and the outward unit normal at the nearest
point of the surface, in the shape's own frame. It is compiled alone, and kernels call it by its address (`jit`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softseam_services.body.errors import ShapeError
from softseam_services.jit import PrototypeError
from softseam_services.shapes.branches import BRANCHES, DISTANCE
from softseam_services.shapes.geometry import Geometry

__all__ = ["Files", "Shape", "ShapeError"]

Files = Mapping[str, bytes]


@dataclass(frozen=True)
class Shape:
    """geometry  of a tool's specification, or an inclusion's, and the files that the scene names
    distance  of what numba can compile; None of a shape in `distance`
    inline    number of its branch there; 0 where kernels call `distance` through its address
    """

    geometry: Callable[[Any, Files], Geometry]
    distance: Callable[..., tuple[float, float, float, float]] | None = None
    inline: int = 0

    def __post_init__(self) -> None:
        if self.inline and self.inline not in BRANCHES:
            raise ShapeError(f"a shape says that it is branch {self.inline} of shapes.distance, which has no such")
        if bool(self.inline) == (self.distance is not None):
            raise ShapeError("a shape needs a distance(numbers, x, y, z) or a branch in shapes.distance, and not both")

    @cached_property
    def number(self) -> int:
        """By which kernels know the shape: its branch, or the address of its compiled distance.

        Raises ShapeError where that does not compile.
        """
        if self.distance is None:
            return self.inline
        try:
            return DISTANCE.compile(self.distance)
        except PrototypeError as error:
            raise ShapeError(str(error)) from error

    def build(self, spec: Any, files: Files) -> Geometry:
        """The geometry of a specification. Raises ShapeError where it is not fit for kernels and viewers."""
        found = self.geometry(spec, files)
        if found.numbers.ndim != 1 or not np.isfinite(found.numbers).all():
            raise ShapeError(f"{spec.kind} has the numbers {found.numbers}: finite ones in a row are taken")
        if not found.reach > 0.0:
            raise ShapeError(f"{spec.kind} reaches {found.reach} m from its position: more than 0 is meant")
        if found.surface is None and not self.inline:
            raise ShapeError(f"{spec.kind} has no surface, and viewers could not draw it: give its geometry one")
        return found
