"""What contact with tools stores.

Where contact yields it has an energy V of where body and tools are, of which its forces are the slope once a substep is
solved. Its work in a step is what the motions of tools put in, less what V gains, as FEM's is (see contact_work.py in
fem/kernels). So a tool at rest does no net work. What a force along a chord does beyond that implicit Euler takes; what
a substep adds that was not solved well enough is in the balance, and has the step repeated (`trust.feeds`).
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import patch_energy, tool_gap

from . import pairs as col
from .lanes import four, three
from .pairs import EIGHT


@njit(cache=True, error_model="numpy")
def yielded_energy(inside, lag, ease):
    """The integral of F/r of eq. (1) of tools/kernels/patch.py [m^2], of a point inside a tool by d [m]; lag and ease
    as of `patch_yields`.

    By parts, F d - integral of d dF, which d = F/r + (1 - q) s F/(F + q r s) makes one of F.
    """
    if inside <= 0.0:
        return 0.0
    if lag == 0.0:
        return 0.5 * inside * inside
    light = ease * lag
    ahead = inside - lag - light
    force = 0.5 * (ahead + np.sqrt(ahead * ahead + 4.0 * light * inside))
    return force * inside - 0.5 * force * force - lag * (force - light * np.log1p(force / light))


@njit(cache=True, error_model="numpy")
def stored_energy(model, parameters, contacts, xw):
    """V of all that yields to tools, where these are as a substep ends, with points at contacts.point_x and nodes
    at xw (n + 8, 4) [J]."""
    indptr, node, tilt = model.indptr, model.node, parameters.tilt
    start, rows, pairs = contacts.start, contacts.rows, contacts.pairs
    edges = np.empty((2, 3))
    energy = 0.0
    for tool in range(len(start) - 1):
        kind, shape, places = parameters.kind[tool], parameters.shape[tool], parameters.places[tool]
        position, orientation = three(contacts.position[1], tool), four(contacts.orientation[1], tool)
        for group in range(start[tool], start[tool + 1]):
            if rows[group, col.EDGED] == 0 or contacts.clear[group] > -np.inf:
                continue
            row = pairs[group]
            for lane in range(EIGHT):
                point, give = rows[group, col.POINT + lane], row[EIGHT * col.SOFT + lane]
                if point < 0 or give == 0.0:
                    continue
                place = three(contacts.point_x, point)
                if places > 0 and point >= model.n_surface:
                    edges[:] = 0.0
                    for entry in range(indptr[point], indptr[point + 1]):
                        for c in range(3):
                            edges[0, c] += tilt[entry, 0] * xw[node[entry], c]
                            edges[1, c] += tilt[entry, 1] * xw[node[entry], c]
                    stored = patch_energy(
                        *(kind, shape, position, orientation, place, edges[0], edges[1]),
                        *(row[EIGHT * col.SAG + lane], places),
                    )
                else:
                    gap = tool_gap(kind, shape, position, orientation, place)[0]
                    stored = yielded_energy(-gap, row[EIGHT * col.LAG + lane], parameters.ease)
                energy += stored / give
    return energy
