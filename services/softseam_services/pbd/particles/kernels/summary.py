"""What a step of particles reports: energies, momenta, bounds and contact figures at its end."""

import numpy as np

from softseam_services.jit import njit
from softseam_services.pbd.kernels.lanes import four, three
from softseam_services.tools.kernels import tool_gap

KINETIC, GRAVITY, PENETRATION, N_CONTACTS, HELD, FINITE = range(6)
MOMENTUM, ANGULAR, BOUNDS = 6, 9, 12
SLIP, FASTEST = 18, 19
N_RESULTS = 20


@njit(cache=True, error_model="numpy")
def summarise(parameters, state, inputs, contacts, outputs, count):
    """Fill result (N_RESULTS,): energies [J], momenta, bounds; `count` candidates give the deepest penetration and the
    farthest slip of a solid's particle that touches [m]."""
    x, v, held, mean, result = state.x, state.v, state.held, outputs.mean, outputs.result
    mass, x_rest, gravity = parameters.mass, parameters.x_rest, parameters.gravity
    kind, shape, radius = parameters.kind, parameters.shape, parameters.radius
    position, orientation = inputs.position_next, inputs.orientation_next
    result[:] = 0.0
    result[BOUNDS : BOUNDS + 3] = np.inf
    result[BOUNDS + 3 : BOUNDS + 6] = -np.inf
    for i in range(len(x)):
        px, py, pz = three(x, i)
        ux, uy, uz = three(v, i)
        square = ux * ux + uy * uy + uz * uz
        result[KINETIC] += 0.5 * mass[i] * square
        result[FASTEST] = max(result[FASTEST], np.sqrt(square))
        for axis in range(3):
            result[GRAVITY] -= mass[i] * gravity[axis] * (x[i, axis] - x_rest[i, axis])
            result[BOUNDS + axis] = min(result[BOUNDS + axis], x[i, axis])
            result[BOUNDS + 3 + axis] = max(result[BOUNDS + 3 + axis], x[i, axis])
            result[MOMENTUM + axis] += mass[i] * v[i, axis]
        result[ANGULAR] += mass[i] * (py * uz - pz * uy)
        result[ANGULAR + 1] += mass[i] * (pz * ux - px * uz)
        result[ANGULAR + 2] += mass[i] * (px * uy - py * ux)
        if held[i] >= 0.0:
            result[HELD] += 1.0
        elif mean[i, 0] != 0.0 or mean[i, 1] != 0.0 or mean[i, 2] != 0.0:
            result[N_CONTACTS] += 1.0
    for c in range(count):
        t, i = contacts.tool[c], contacts.particle[c]
        gap = tool_gap(kind[t], shape[t], three(position, t), four(orientation, t), three(x, i))[0]
        result[PENETRATION] = max(result[PENETRATION], radius - gap)
        if len(state.slip) > 0:
            sx, sy, sz = state.slip[i, t, 0], state.slip[i, t, 1], state.slip[i, t, 2]
            result[SLIP] = max(result[SLIP], np.sqrt(sx * sx + sy * sy + sz * sz))
    total = 0.0
    for figure in result:
        total += 0.0 * figure
    result[FINITE] = 1.0 if total == 0.0 else 0.0
