"""A block in hexahedra that are thinner at its faces, where contact and corners make stress peak."""

from __future__ import annotations

import numpy as np

from softseam_services.body.body import Floats, Ints
from softseam_services.body.hexahedra import CORNERS
from softseam_services.body.lattice import LOCAL, number_nodes
from softseam_services.body.mesh_io import RawHexahedra


def graded_block(size: Floats, counts: Ints, grading: float) -> RawHexahedra:
    """A block of `size` (3,) [m] in `counts` (3,) cells along its axes, graded along each by `graded_line`."""
    lines = [edge * graded_line(int(count), grading) for edge, count in zip(size, counts, strict=True)]
    x, y, z = np.meshgrid(*lines, indexing="ij")
    points = np.stack([place.ravel(order="F") for place in (x, y, z)], axis=1)
    cells = number_nodes(np.ones(counts, dtype=np.bool_))[0].astype(np.int64)
    corners = cells[:, None, :] + LOCAL[CORNERS] // 2
    strides = np.cumprod([1, counts[0] + 1, counts[1] + 1])
    return RawHexahedra(points, (corners @ strides,))


def graded_line(count: int, grading: float) -> Floats:
    """Where `count` cells on [0, 1] end (count + 1,): symmetric, each longer than its outer neighbour by one factor.

    The middle cell is `grading` times as long as those at the ends.
    """
    inward = np.minimum(np.arange(count), np.arange(count)[::-1])
    widths = grading ** (inward / max(1, int(inward.max())))
    return np.concatenate([[0.0], np.cumsum(widths) / widths.sum()])
