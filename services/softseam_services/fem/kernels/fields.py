"""Fields of a state, as a region reports them: stress of its cells, and forces on its surface's points."""

import numpy as np

from softseam_services.jit import njit

from . import elements
from .contact import point_position


@njit(cache=True, error_model="numpy")
def gather_forces(contact, model, parameters, point_of_node, gathered):
    """gathered (n_surface, t, 3) [N] <- forces of all points on the surface's, with the same sums.

    contact (p, t, 9) contact state; what acts on a point inside a face is shared among the face's nodes by its
    weights; point_of_node (n,) surface point at each node, -1 for none
    """
    n_surface, n_tools = gathered.shape[0], gathered.shape[1]
    for point in range(n_surface):
        for tool in range(n_tools):
            for i in range(3):
                gathered[point, tool, i] = contact[point, tool, i]
    for point in range(n_surface, len(model.point_face)):
        if model.point_face[point] < 0:
            continue
        for entry in range(model.point_ptr[point], model.point_ptr[point + 1]):
            to, weight = point_of_node[model.point_node[entry]], parameters.point_weight[entry]
            for tool in range(n_tools):
                for i in range(3):
                    gathered[to, tool, i] += weight * contact[point, tool, i]


@njit(cache=True, error_model="numpy")
def read_fields(x, contact, model, parameters, point_of_node, work, cauchy, place, force, touched):
    """Cauchy stress of the octants, cauchy (c, 8, 6) [Pa], and of the surface's points their place (n_surface, 3) [m],
    the force of all tools, force (n_surface, 3) [N], and which tool's is the largest, touched (n_surface,), -1 for
    none; all four are overwritten.

    x (n, 3); contact and point_of_node as above
    """
    elements.cauchy_stress(x, model, parameters, work, cauchy)
    gathered = np.empty((len(force), contact.shape[1], 3))
    gather_forces(contact, model, parameters, point_of_node, gathered)
    for point in range(len(force)):
        largest, which = 0.0, -1
        sx = sy = sz = 0.0
        for tool in range(gathered.shape[1]):
            fx, fy, fz = gathered[point, tool, 0], gathered[point, tool, 1], gathered[point, tool, 2]
            square = fx * fx + fy * fy + fz * fz
            if square > largest:
                largest, which = square, tool
            sx, sy, sz = sx + fx, sy + fy, sz + fz
        force[point, 0], force[point, 1], force[point, 2] = sx, sy, sz
        touched[point] = which
        point_position(x, model, parameters, point, place[point])
