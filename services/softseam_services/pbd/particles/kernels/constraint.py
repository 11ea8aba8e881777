"""Constraints C(x) of a few particles each, whose C and gradient kernels call by address: one kernel for all of them.

With energy 1/2 C^2/alpha (Macklin et al. 2016, "XPBD", eq. 18):
    d lambda = -(C + alpha~ lambda)/(sum w_i |grad_i C|^2 + alpha~),  x_i += w_i d lambda grad_i C,  alpha~ = alpha/h^2
One that holds on one side only, C <= 0, keeps lambda <= 0: it pulls C down and pushes never.
"""

import numpy as np

from softseam_services.jit import Prototype, njit

VALUE = Prototype(
    "value of a particle constraint",
    {"k": int, "x": ("k", 3), "n": int, "parameters": ("n",), "gradient": ("k", 3)},
    lengths=("k", "n"),
)
ADDRESS, PARTICLES, PARAMETERS, ONE_SIDED, FIRST, LAST, PARTICLE, PARAMETER = range(8)
"""columns of a family: address of its function; particles and parameters of each of its constraints; whether it holds
on one side; its first constraint and the first behind it; where its lists of particles and of parameters begin"""
N_COLUMNS = 8

_call_value = VALUE.call


@njit(cache=True, error_model="numpy")
def _value(row, number, xw, particle, parameter, x, p, g):
    """C of a constraint of the family `row`; gradient g (k, 3) in place. x, p: workspaces."""
    k, n = row[PARTICLES], row[PARAMETERS]
    first = row[PARTICLE] + k * (number - row[FIRST])
    for i in range(k):
        for axis in range(3):
            x[i, axis] = xw[particle[first + i], axis]
            g[i, axis] = 0.0
    at = row[PARAMETER] + n * (number - row[FIRST])
    for i in range(n):
        p[i] = parameter[at + i]
    return first, _call_value(row[ADDRESS], k, x[:k], n, p[:n], g[:k])


@njit(cache=True, error_model="numpy")
def project_constraints(xw, families, particle, parameter, soft, lam, x, p, g):
    """Project every constraint once, family after family; xw (n + 8, 4) and lam (m,) updated in place.

    families (f, N_COLUMNS); particle, parameter: one list after another; soft (m,) alpha~; x, p, g: workspaces
    """
    for family in range(len(families)):
        row = families[family]
        for number in range(row[FIRST], row[LAST]):
            first, value = _value(row, number, xw, particle, parameter, x, p, g)
            weight = 0.0
            for i in range(row[PARTICLES]):
                square = g[i, 0] ** 2 + g[i, 1] ** 2 + g[i, 2] ** 2
                weight += xw[particle[first + i], 3] * square
            if weight == 0.0:
                continue
            before = lam[number]
            after = before - (value + soft[number] * before) / (weight + soft[number])
            if row[ONE_SIDED] != 0:
                after = min(0.0, after)
            lam[number] = after
            for i in range(row[PARTICLES]):
                node = particle[first + i]
                for axis in range(3):
                    xw[node, axis] += xw[node, 3] * (after - before) * g[i, axis]


@njit(cache=True, error_model="numpy")
def constraint_energy(xw, families, particle, parameter, soft, lam, x, p, g, h):
    """Work of what was applied, -1/2 C lambda/h^2: 1/2 C^2/alpha where constraints are met [J]."""
    energy = 0.0
    for family in range(len(families)):
        row = families[family]
        for number in range(row[FIRST], row[LAST]):
            if lam[number] != 0.0:
                _, value = _value(row, number, xw, particle, parameter, x, p, g)
                energy -= 0.5 * value * lam[number] / (h * h)
    return energy


@njit(cache=True, error_model="numpy")
def add_constraint_forces(xw, families, particle, parameter, soft, lam, x, p, g, h, force):
    """Add lambda grad C/h^2 [N] to force (n + 8, 3) in place."""
    for family in range(len(families)):
        row = families[family]
        for number in range(row[FIRST], row[LAST]):
            if lam[number] != 0.0:
                first, _ = _value(row, number, xw, particle, parameter, x, p, g)
                for i in range(row[PARTICLES]):
                    for axis in range(3):
                        force[particle[first + i], axis] += lam[number] * g[i, axis] / (h * h)


@njit(cache=True, error_model="numpy")
def constraint_gradients(xyz, row, particle, parameter):
    """Particles (m, k) and gradients (m, k, 3) of the constraints of a family, of particles at xyz (n, 3) [m]."""
    k, m = row[PARTICLES], row[LAST] - row[FIRST]
    particles, gradients = np.empty((m, k), dtype=np.int64), np.empty((m, k, 3))
    x, p = np.empty((k, 3)), np.empty(row[PARAMETERS])
    for number in range(row[FIRST], row[LAST]):
        place = number - row[FIRST]
        first, _ = _value(row, number, xyz, particle, parameter, x, p, gradients[place])
        particles[place] = particle[first : first + k]
    return particles, gradients
