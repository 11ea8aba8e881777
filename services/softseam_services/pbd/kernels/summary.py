"""What a step reports: energies, momenta, bounds and contact figures at its end."""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import tool_gap

from .lanes import four, three
from .pairs import DEPTH, EIGHT, MEAN, POINT, SLIP_SINCE, SOFT

(KINETIC, STRAIN, GRAVITY, TOOL_WORK, SEAM_WORK, PENETRATION, SLIP, N_CONTACTS, LEAST_J, PUSHED) = range(10)
MOMENTUM, ANGULAR, BOUNDS, RESIDUAL, STRETCH, APPARENT, HASTE = 10, 13, 16, 22, 23, 24, 25
FASTEST, STORED = 26, 27
N_RESULTS = 28
"""of a step; FASTEST [m/s] is of its nodes; APPARENT [J] is what energy seems to rise by without doing so, and HASTE
[J] h^2/8 f^T M^-1 f of the blocks at its end: the explicit step's, see `leapfrog`, else 0; STORED [J] is what contact
with tools stores as it ends, see `stored`"""


@njit(cache=True, error_model="numpy", forceinline=True)
def _size(pairs, group, column, lane):
    """Length of the vector in three columns."""
    x = pairs[group, EIGHT * column + lane]
    y, z = pairs[group, EIGHT * (column + 1) + lane], pairs[group, EIGHT * (column + 2) + lane]
    return np.sqrt(x * x + y * y + z * z)


@njit(cache=True, error_model="numpy")
def summarise_motion(parameters, x, v, result):
    """Energies, momenta and bounds at the end of the step into result (N_RESULTS,); the rest of it is not touched."""
    mass, x_rest, gravity = parameters.mass, parameters.x_rest, parameters.gravity
    kinetic, gravity_energy, fastest = 0.0, 0.0, 0.0
    mx, my, mz, ax, ay, az = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    low_x, low_y, low_z, high_x, high_y, high_z = np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf
    for i in range(len(x)):
        px, py, pz = three(x, i)
        ux, uy, uz = three(v, i)
        square = ux * ux + uy * uy + uz * uz
        kinetic += mass[i] * square
        fastest = max(fastest, square)
        lift = gravity[0] * (px - x_rest[i, 0]) + gravity[1] * (py - x_rest[i, 1]) + gravity[2] * (pz - x_rest[i, 2])
        gravity_energy -= mass[i] * lift
        ux, uy, uz = mass[i] * ux, mass[i] * uy, mass[i] * uz
        mx, my, mz = mx + ux, my + uy, mz + uz
        ax, ay, az = ax + (py * uz - pz * uy), ay + (pz * ux - px * uz), az + (px * uy - py * ux)
        low_x, low_y, low_z = min(low_x, px), min(low_y, py), min(low_z, pz)
        high_x, high_y, high_z = max(high_x, px), max(high_y, py), max(high_z, pz)
    result[KINETIC], result[GRAVITY], result[FASTEST] = 0.5 * kinetic, gravity_energy, np.sqrt(fastest)
    result[MOMENTUM], result[MOMENTUM + 1], result[MOMENTUM + 2] = mx, my, mz
    result[ANGULAR], result[ANGULAR + 1], result[ANGULAR + 2] = ax, ay, az
    result[BOUNDS], result[BOUNDS + 1], result[BOUNDS + 2] = low_x, low_y, low_z
    result[BOUNDS + 3], result[BOUNDS + 4], result[BOUNDS + 5] = high_x, high_y, high_z


@njit(cache=True, error_model="numpy")
def summarise(parameters, state, contacts, n_substeps, result):
    """Energies, momenta, bounds and contact figures at the end of the step into result (N_RESULTS,)."""
    kind, shape, followed = parameters.kind, parameters.shape, parameters.followed
    point_x = contacts.point_x
    position, orientation, force = contacts.position[1], contacts.orientation[1], state.force
    pair_start, rows, pairs = contacts.start, contacts.rows, contacts.pairs
    result[:] = 0.0
    summarise_motion(parameters, state.x, state.v, result)
    for tool in range(len(kind)):
        tool_kind, tool_shape = kind[tool], shape[tool]
        place, turn = three(position, tool), four(orientation, tool)
        for group in range(pair_start[tool], pair_start[tool + 1]):
            for lane in range(EIGHT):
                point = rows[group, POINT + lane]
                if point < 0:
                    continue
                gap = tool_gap(tool_kind, tool_shape, place, turn, three(point_x, point))[0]
                result[PENETRATION] = max(result[PENETRATION], -gap)
                touches = False
                for c in range(3):
                    touches = touches or force[point, tool, c] != 0.0
                if touches:
                    # A point that touches two tools counts for the first.
                    first = True
                    for other in range(tool):
                        for c in range(3):
                            first = first and force[point, other, c] == 0.0
                    result[N_CONTACTS] += 1.0 if first else 0.0
                    if followed[tool]:
                        result[SLIP] = max(result[SLIP], _size(pairs, group, SLIP_SINCE, lane))
                depth = pairs[group, EIGHT * DEPTH + lane]
                if depth > 0.0 and pairs[group, EIGHT * SOFT + lane] == 0.0:
                    # A bound of the work that it took to push out a point that was inside a tool at the start; where
                    # contact yields that is in what it stored.
                    result[PUSHED] += n_substeps * depth * _size(pairs, group, MEAN, lane)
