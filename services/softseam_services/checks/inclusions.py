"""Inclusions of a few octants, or of none."""

from collections.abc import Iterator

from softseam_services.body.check import parts_of
from softseam_services.to_check import Cells

_COARSE = 8
"""octants: those of one cell"""


def look(seen: Cells) -> Iterator[str]:
    for number, part in enumerate(parts_of(seen.body)):
        if part.octants == 0:
            yield f"body.inclusions.{number}: it is hidden by later ones, or where the body is empty: leave it out"
        elif part.octants < _COARSE:
            yield f"body.inclusions.{number}: it is {part.octants} octants of cells, a coarse picture: shorten `cell`"
