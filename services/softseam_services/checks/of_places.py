"""What is where in a body: boxes, inclusions, borders, cells of a poor shape."""

from collections.abc import Iterator

import numpy as np

from softseam_protocol.inner_ball import inner_ball
from softseam_protocol.material_borders import material_borders
from softseam_protocol.scene.bodies import block_of
from softseam_protocol.scene.parts import SpherePart
from softseam_protocol.scene.spec import BoxRegion
from softseam_services.body.check import parts_of
from softseam_services.body.interpolate import rest_points
from softseam_services.checks.seen import Cells

_COARSE = 8
"""octants: those of one cell"""


def boxes(seen: Cells) -> Iterator[str]:
    """Boxes in which nothing is that they are to choose, or everything."""
    scene, body, x = seen.scene, seen.body, seen.body.x_rest
    if body.fixed.all():
        yield "body.fixed: all of the body is clamped, and nothing moves; make the boxes smaller"
    none: tuple[BoxRegion, ...] = ()
    slack = 1e-6 * min(body.edges)
    spans = " .. ".join(str(end(x, axis=0).round(6).tolist()) for end in (np.min, np.max))
    for key, boxes, points, what in (
        ("body.fixed", seen.spec.said("fixed", none), x, "no node"),
        ("regions.near.boxes", scene.regions.boxes, x[body.cell_nodes[:, 13]], "no cell's middle"),
    ):
        for number, box in enumerate(boxes):
            inside = (points >= np.array(box.min) - slack) & (points <= np.array(box.max) + slack)
            if not inside.all(axis=1).any():
                yield (
                    f"{key}.{number}: {what} is in this box: the body spans {spans} m at rest; move the box, or leave "
                    "it out"
                )


def inclusions(seen: Cells) -> Iterator[str]:
    """Inclusions of a few octants, or of none."""
    for number, part in enumerate(parts_of(seen.body)):
        if part.octants == 0:
            yield f"body.inclusions.{number}: it is hidden by later ones, or where the body is empty: leave it out"
        elif part.octants < _COARSE:
            yield f"body.inclusions.{number}: it is {part.octants} octants of cells, a coarse picture: shorten `cell`"


def borders(seen: Cells) -> Iterator[str]:
    """Materials that meet inside cells, where a block's cells could end there."""
    found, body = block_of(seen.spec), seen.body
    if found is None:
        return
    spec, shape = found.body, found.shape
    block, follows = (shape.size, spec.position, spec.inclusions), shape.borders == "materials"
    ball = inner_ball(*block)
    if ball and not follows:
        alone = ", which takes one model: leave out regions.near" if seen.scene.regions.cut else ""
        yield (
            "a sphere inside the block is made up of octants of cells, as a staircase: say body.shape.borders: "
            f"materials, and they follow it{alone}"
        )
        return
    if follows and ball is None and any(isinstance(part.shape, SpherePart) for part in spec.inclusions):
        yield (
            "no cells follow the spheres in spite of body.shape.borders: materials; what is seen of them is made up of "
            "octants, as a staircase: cells follow one sphere alone, a tenth of its radius or more from the block's "
            "faces, with nothing but boxes along the axes beside it, and no later one over it"
        )
        return
    lower = np.array(spec.position) - np.array([0.5, 0.5, 0.0]) * shape.size
    ends = (body.x_rest[body.cell_nodes[:, [0, 26]]].reshape(-1, 3) - lower).T
    inside = [
        f"{axis} {1e3 * (plane + start):.4g}"
        for axis, planes, start, at in zip("xyz", material_borders(*block), lower, ends, strict=True)
        for plane in planes
        if np.abs(at - plane).min() > 1e-6 * np.ptp(at)
    ]
    if inside:
        remedy = "choose `cell` so that cells end there, or say body.shape.borders: materials"
        if follows:
            remedy = "shorten `cell`, for within a tenth of it from a face or another border no cell ends"
        yield (
            f"materials meet inside cells, at {', '.join(inside)} mm, where stress is smeared and the border moves by "
            f"up to a quarter of a cell: {remedy}"
        )


def cells(seen: Cells) -> Iterator[str]:
    """Cells of a shape that bends, or is simulated, badly; a body of a size that no hand grips."""
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
