"""Copies of a body on a grid, tidy or not: what a scene says of them, and how they are called."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from softseam_protocol.scene.spec import NonNegative, Spec, Vector, wrong

MOST_COPIES = 1000

Several = Annotated[int, Field(ge=1)]
Share = Annotated[float, Field(ge=0.0, lt=1.0, allow_inf_nan=False)]
_COPY = re.compile(r"(.+)_\d+_\d+_\d+")


class RepeatSpec(Spec):
    """A grid of copies, which stands where the body would: with the middle of its base there."""

    grid: tuple[Several, Several, Several] = Field(description="how many copies along x, y and z")
    spacing: Vector = Field(description="from each to the next along x, y and z [m]")
    shake: NonNegative = Field(default=0.0, description="most that each is off its place along x, y and z [m]")
    size: Share = Field(default=0.0, description="most by which a block is larger or smaller, with its cells [1]")
    stiffness: Share = Field(default=0.0, description="most by which Young's modulus is more or less [1]")
    seed: int = Field(default=0, ge=0, description="of what is drawn; another seed is another pile")

    @model_validator(mode="after")
    def _few_enough(self) -> RepeatSpec:
        x, y, z = self.grid
        if x * y * z > MOST_COPIES:
            raise wrong(f"{x * y * z:,} copies, more than {MOST_COPIES:,}: give a smaller grid", "grid")
        for i, (count, apart) in enumerate(zip(self.grid, self.spacing, strict=True)):
            if count > 1 and apart == 0.0:
                raise wrong(f"{count} copies in one place along {'xyz'[i]}: give them room", "spacing", i)
        return self


class Copy(NamedTuple):
    """One of a grid."""

    name: str
    by: Vector
    """how far it is from where the body itself would be [m]"""
    size: float
    """its edges, in those of the body [1]"""
    stiffness: float
    """its modulus, in that of the body [1]"""


def copies_of(name: str, spec: RepeatSpec) -> Iterator[Copy]:
    """The copies of a body of this name, along z last; what is drawn for one depends on its name and the seed alone."""
    along = [range(count) for count in spec.grid]
    for i, j, k in ((i, j, k) for k in along[2] for j in along[1] for i in along[0]):
        own = f"{name}_{i}_{j}_{k}"
        drawn = random.Random(f"{spec.seed} {own}")  # `random()` of a text is the same in every Python and machine

        def off(most: float, drawn: random.Random = drawn) -> float:
            return most * (2.0 * drawn.random() - 1.0)

        (nx, ny, _), (dx, dy, dz) = spec.grid, spec.spacing
        x, y, z = (i - 0.5 * (nx - 1)) * dx, (j - 0.5 * (ny - 1)) * dy, k * dz
        by = (x + off(spec.shake), y + off(spec.shake), z + off(spec.shake))
        yield Copy(own, by, 1.0 + off(spec.size), 1.0 + off(spec.stiffness))


def repeated(name: str) -> str:
    """Name of the body of which one of this name is a copy; '' where its name is not a copy's.

    >>> repeated("cube_0_1_2"), repeated("cube")
    ('cube', '')
    """
    found = _COPY.fullmatch(name)
    return "" if found is None else found[1]
