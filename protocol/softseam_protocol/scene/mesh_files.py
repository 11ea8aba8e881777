"""What of a mesh file is taken, alike for bodies and tools."""

from __future__ import annotations

from typing import Annotated

from pydantic import Discriminator, Field, Tag

_PART = (
    "what is taken of a file with several solids: the object, group, solid or physical group of this name, or the "
    "closed body of this number, counted from 1 by size; default: all, which must be one body"
)


def _part_tag(value: object) -> str:
    return "a number" if isinstance(value, int) and not isinstance(value, bool) else "a name"


MeshPart = Annotated[
    Annotated[
        Annotated[str, Field(min_length=1), Tag("a name")] | Annotated[int, Field(ge=1), Tag("a number")],
        Discriminator(_part_tag),
    ]
    | None,
    Field(default=None, exclude_if=lambda part: part is None, description=_PART),
]
