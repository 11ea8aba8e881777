"""What was done to the meshes of tools."""

from collections.abc import Iterator

from softseam_services.to_check import Cells


def look(seen: Cells) -> Iterator[str]:
    for name, geometry in zip(seen.tools.names, seen.tools.geometry, strict=True):
        yield from (f"tools.{name}.path: {note}" for note in geometry.notes)
