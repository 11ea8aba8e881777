"""FEM's element where it is too stiff for the scene's material."""

from collections.abc import Iterator

from softseam.to_check import Written
from softseam_protocol.scene.consistency import locking


def look(seen: Written) -> Iterator[str]:
    if found := locking(seen.scene):
        yield f"models.fem.element: {found}"
