"""Materials that meet inside cells, where a block's cells could end there."""

from collections.abc import Iterator

import numpy as np

from softseam_protocol.inner_ball import inner_ball
from softseam_protocol.material_borders import material_borders
from softseam_protocol.scene.bodies import block_of
from softseam_protocol.scene.parts import SpherePart
from softseam_services.to_check import Cells


def look(seen: Cells) -> Iterator[str]:
    found, body = block_of(seen.scene.body), seen.body
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
