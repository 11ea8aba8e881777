"""The material at points of cells whose octants differ."""

import numpy as np

from softseam_services.body.body import Body, Floats, Ints


def point_parameters(body: Body, cells: Ints, share: Floats) -> Floats:
    """What `materials.point` takes at each point of these cells (c, q, MAX_PARAMETERS).

    share (q, 8) of each point in each octant: between octants it has the mean of their constants, by volume
    """
    return _at_points(np.array([material.parameters for material in body.materials]), body, cells, share)


def point_moduli(body: Body, cells: Ints, share: Floats) -> Floats:
    """mu and lambda at each point of these cells (c, q, 2) [Pa], as `point_parameters`."""
    return _at_points(np.array([(each.mu, each.lambda_) for each in body.materials]), body, cells, share)


def _at_points(of: Floats, body: Body, cells: Ints, share: Floats) -> Floats:
    """Numbers of each material (m, n) at the points (c, q, n)."""
    if len(of) == 1:
        return np.tile(of, (len(cells), len(share), 1))
    octants = of[body.octant_material[cells]]
    weight = np.maximum(body.fill[cells], 1e-9)[:, None, :] * share[None]
    return np.asarray(np.einsum("cqo,cop->cqp", weight, octants) / weight.sum(axis=2)[..., None])
