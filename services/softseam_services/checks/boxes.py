"""Boxes in which nothing is that they are to choose, or everything."""

from collections.abc import Iterator

import numpy as np

from softseam_protocol.scene.spec import BoxRegion
from softseam_services.to_check import Cells


def look(seen: Cells) -> Iterator[str]:
    scene, body, x = seen.scene, seen.body, seen.body.x_rest
    if body.fixed.all():
        yield "body.fixed: all of the body is clamped, and nothing moves; make the boxes smaller"
    none: tuple[BoxRegion, ...] = ()
    slack = 1e-6 * min(body.edges)
    spans = " .. ".join(str(end(x, axis=0).round(6).tolist()) for end in (np.min, np.max))
    for key, boxes, points, what in (
        ("body.fixed", scene.body.said("fixed", none), x, "no node"),
        ("regions.near.boxes", scene.regions.boxes, x[body.cell_nodes[:, 13]], "no cell's middle"),
    ):
        for number, box in enumerate(boxes):
            inside = (points >= np.array(box.min) - slack) & (points <= np.array(box.max) + slack)
            if not inside.all(axis=1).any():
                yield (
                    f"{key}.{number}: {what} is in this box: the body spans {spans} m at rest; move the box, or leave "
                    "it out"
                )
