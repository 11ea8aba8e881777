"""Particles of one sheet against each other: balls that keep a distance, found by a spatial hash.

Space is divided into cubes as wide as the search reaches; the particles of a cube are found by a counting sort of the
cubes' hash (Teschner et al. 2003, "Optimized spatial hashing"), so that the order of pairs depends on positions alone.
Neighbours on the sheet are left out: springs hold them apart.
"""

import numpy as np

from softseam_services.jit import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def _bucket(i, j, k, mask):
    return ((i * 73856093) ^ (j * 19349663) ^ (k * 83492791)) & mask


@njit(cache=True, error_model="numpy")
def list_pairs(parameters, contacts, x, within):
    """Pairs of particles closer than `within` [m] that are at least parameters.apart from each other at rest [m].

    Of the contacts cube (n, 3), start (2^p + 1,) and order (n,) are workspace; pairs go into first and second
    (capacity,). Returns their number; more than the capacity where not all found room.
    """
    n, x_rest, apart = len(parameters.mass), parameters.x_rest, parameters.apart
    cube, start, order, first, second = contacts.cube, contacts.start, contacts.order, contacts.first, contacts.second
    mask, per = len(start) - 2, 1.0 / within
    start[:] = 0
    for i in range(n):
        for axis in range(3):
            cube[i, axis] = np.int64(np.floor(x[i, axis] * per))
        start[_bucket(cube[i, 0], cube[i, 1], cube[i, 2], mask) + 1] += 1
    for b in range(len(start) - 1):
        start[b + 1] += start[b]
    for k in range(n):
        i = n - 1 - k
        b = _bucket(cube[i, 0], cube[i, 1], cube[i, 2], mask) + 1
        start[b] -= 1
        order[start[b]] = i
    # start[b + 1] is now where bucket b begins
    count, square, square_rest = 0, within * within, apart * apart
    for i in range(n):
        px, py, pz = x[i, 0], x[i, 1], x[i, 2]
        for a in range(13, 27):  # its own cube and the half of those around that no other particle looks at from there
            ci, cj, ck = cube[i, 0] + a % 3 - 1, cube[i, 1] + a // 3 % 3 - 1, cube[i, 2] + a // 9 - 1
            b = _bucket(ci, cj, ck, mask)
            stop = start[b + 2] if b < mask else n
            for at in range(start[b + 1], stop):
                j = order[at]
                dx, dy, dz = px - x[j, 0], py - x[j, 1], pz - x[j, 2]
                if dx * dx + dy * dy + dz * dz >= square or (a == 13 and j <= i):
                    continue
                if cube[j, 0] != ci or cube[j, 1] != cj or cube[j, 2] != ck:
                    continue
                dx, dy, dz = x_rest[i, 0] - x_rest[j, 0], x_rest[i, 1] - x_rest[j, 1], x_rest[i, 2] - x_rest[j, 2]
                if dx * dx + dy * dy + dz * dz < square_rest:
                    continue
                if count < len(first):
                    first[count], second[count] = i, j
                count += 1
    return count


@njit(cache=True, error_model="numpy")
def project_pairs(xw, x_prev, count, first, second, distance, friction):
    """Push pairs that are closer than `distance` [m] apart along their line, and brake their sliding; xw in place.

    C = |x_i - x_j| - distance <= 0 with eq. (1) and no compliance; friction takes from the relative way of the substep
    across that line at most mu times the push. Returns how many touched.
    """
    touching = 0
    square = distance * distance
    for c in range(count):
        i, j = first[c], second[c]
        dx, dy, dz = xw[i, 0] - xw[j, 0], xw[i, 1] - xw[j, 1], xw[i, 2] - xw[j, 2]
        near = dx * dx + dy * dy + dz * dz
        if near >= square:
            continue
        wi, wj = xw[i, 3], xw[j, 3]
        if wi + wj == 0.0 or near == 0.0:
            continue
        touching += 1
        length = np.sqrt(near)
        nx, ny, nz = dx / length, dy / length, dz / length
        push = distance - length
        rx = (xw[i, 0] - x_prev[i, 0]) - (xw[j, 0] - x_prev[j, 0])
        ry = (xw[i, 1] - x_prev[i, 1]) - (xw[j, 1] - x_prev[j, 1])
        rz = (xw[i, 2] - x_prev[i, 2]) - (xw[j, 2] - x_prev[j, 2])
        along = rx * nx + ry * ny + rz * nz
        rx, ry, rz = rx - along * nx, ry - along * ny, rz - along * nz
        size = np.sqrt(rx * rx + ry * ry + rz * rz)
        brake = min(1.0, friction * push / size) if size > 0.0 else 0.0
        mx, my, mz = push * nx - brake * rx, push * ny - brake * ry, push * nz - brake * rz
        a, b = wi / (wi + wj), wj / (wi + wj)
        xw[i, 0] += a * mx
        xw[i, 1] += a * my
        xw[i, 2] += a * mz
        xw[j, 0] -= b * mx
        xw[j, 1] -= b * my
        xw[j, 2] -= b * mz
    return touching
