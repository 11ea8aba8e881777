"""The material at points of cells whose octants differ."""

from __future__ import annotations

import numpy as np

from softseam_services.body.body import Body, Floats, Ints


def point_parameters(body: Body, cells: Ints, share: Floats) -> Floats:
    """What `materials.point` takes at each point of these cells (c, q, 3).

    share (q, 8) of each point in each octant: between octants it has the mean of their constants, by volume
    """
    parameters = np.array([material.parameters for material in body.materials])
    if len(parameters) == 1:
        return np.tile(parameters, (len(cells), len(share), 1))
    octants = parameters[body.octant_material[cells]]
    weight = np.maximum(body.fill[cells], 1e-9)[:, None, :] * share[None]
    return np.asarray(np.einsum("cqo,cop->cqp", weight, octants) / weight.sum(axis=2)[..., None])
