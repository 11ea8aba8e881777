"""Cells of a shape that bends, or is simulated, badly; a body of a size that no hand grips."""

from collections.abc import Iterator

import numpy as np

from softseam_services.body.interpolate import rest_points
from softseam_services.to_check import Cells


def look(seen: Cells) -> Iterator[str]:
    body, points = seen.body, rest_points(seen.body)
    yield from body.notes
    stretch, longest = body.edges.max() / body.edges.min(), np.ptp(points, axis=0).max()
    if stretch > 3.0:
        yield (
            f"body.cell: they are stretched {stretch:.1f} to 1: substeps follow the shortest edge; "
            "choose more even ones"
        )
    # What rounding a wanted cell edge to a divisor of the body leaves open is worth knowing when it is one cell.
    if body.boxes and (np.ptp(body.along_axes(points), axis=0) < 1.5 * body.edges).any():
        yield "body.cell: one cell through the thickness: bending is coarse; make it half as large"
    if not 1e-3 <= longest <= 5.0:
        yield f"body.shape: {longest:.3g} m from end to end is unlike what a hand grips; is the unit m?"
