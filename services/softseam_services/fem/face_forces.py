"""Forces at points inside faces, reported and taken over as forces at the nodes of these faces."""

import numpy as np

from softseam_services.body.body import Floats, Ints

from .kernels.contact_columns import ANCHOR, FORCE, N_STATE
from .model import FemModel
from .parameters import FemParameters


def point_positions(model: FemModel, parameters: FemParameters, x: Floats) -> Floats:
    """Where the points are (p, 3) [m], of nodes at x (n, 3)."""
    if not len(parameters.point_weight):
        return np.zeros((0, 3))
    weighted = parameters.point_weight[:, None] * x[model.point_node]
    return np.asarray(np.add.reduceat(weighted, model.point_ptr[:-1], axis=0))


def taken_over(
    model: FemModel, parameters: FemParameters, x: Floats, force: Floats, tool: Ints, n_tools: int
) -> Floats:
    """Contact state (p, t, 9) of nodes at x (n, 3) that begins with forces on the surface's points.

    force (n_surface, 3) [N], tool (n_surface,) which tool's, -1 for none. Where a point is, there it sticks.
    """
    contact = np.zeros((len(model.point_face), n_tools, N_STATE))
    touching = np.flatnonzero(tool >= 0)
    contact[touching, tool[touching], FORCE : FORCE + 3] = force[touching]
    spread_over_faces(model, parameters, contact)
    contact[:, :, ANCHOR : ANCHOR + 3] = point_positions(model, parameters, x)[:, None]
    return contact


def spread_over_faces(model: FemModel, parameters: FemParameters, contact: Floats) -> None:
    """Give what the surface's nodes carry of tools with edges to the points around them: contact (p, t, 9) in place.

    A node's force is shared among the points that follow it, by their weights and areas, so that sums stay.
    """
    inner = np.flatnonzero(model.point_face >= 0)
    if len(inner) == 0:
        return
    n_surface = int(inner[0])
    inside = model.at_faces[None, :] & (model.point_face[:n_surface, None] == -1)
    moved = np.where(inside[:, :, None], contact[:n_surface, :, :3], 0.0)
    point_of = surface_point_of_node(model, n_surface)
    begin = model.point_ptr[inner[0]]
    rows = np.repeat(inner, np.diff(model.point_ptr)[inner])
    columns = point_of[model.point_node[begin:]]
    # quadratic functions have negative parts, and a share has none
    share = np.maximum(parameters.point_weight[begin:], 0.0) * parameters.point_stiffness[rows]
    total = np.zeros(n_surface)
    np.add.at(total, columns, share)
    np.add.at(contact[:, :, :3], rows, (share / total[columns])[:, None, None] * moved[columns])
    contact[:n_surface, :, :3] -= moved


def surface_point_of_node(model: FemModel, n_surface: int) -> np.ndarray:
    """Surface point at each node (n,), -1 for none; on a block each follows one node.

    Raises ValueError where points inside faces hang on a node without one: their force would be reported nowhere.
    """
    found = np.full(len(model.order), -1, dtype=np.int64)
    points = np.arange(n_surface)
    single = np.diff(model.point_ptr)[:n_surface] == 1
    found[model.point_node[model.point_ptr[points[single]]]] = points[single]
    if (found[model.point_node[model.point_ptr[n_surface] :]] < 0).any():
        raise ValueError("a face that tools touch has a node that is no point of the surface")
    return found
