"""What of a mesh file is taken, alike for bodies and tools."""

from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from softseam_protocol.scene.spec import Positive

TELLS_UNIT = (".dae", ".gltf", ".glb", ".usd", ".usda", ".usdc", ".usdz")
"""suffixes of formats that state their unit and the axis that points up"""

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


def tells_unit(path: str | None) -> bool:
    """Whether a file's format states its unit, as its name says."""
    return PurePosixPath((path or "").replace("\\", "/")).suffix.lower() in TELLS_UNIT


def usual_scale(keys: dict[str, Any]) -> float | None:
    """The scale of a file that the keys before it name, where the scene gives none; None where it states it."""
    return None if tells_unit(keys.get("path")) else 1.0


def usual_up(keys: dict[str, Any]) -> Literal["z"] | None:
    """The upward axis of a file that the keys before it name, where the scene gives none; None where it states it."""
    return None if tells_unit(keys.get("path")) else "z"


MeshScale = Annotated[
    Positive | None,
    Field(
        exclude_if=lambda scale: scale is None,
        description="metres per unit of the file; default: what the file states (COLLADA, glTF, USD), else 1",
    ),
]
MeshUp = Annotated[
    Literal["x", "y", "z"] | None,
    Field(
        exclude_if=lambda up: up is None,
        description="axis of the file that points up; default: what the file states (COLLADA, glTF, USD), else z",
    ),
]
