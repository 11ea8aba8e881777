"""The linear solve of `softseam_coupling.loops.closure`, its eqs. (1) and (2), on flat arrays.

Nodes of all parts follow one another, and so do their matrices in three buffers; `PARTS` says where whose are. Vectors
are flat, of 3 c rows or of 3 N nodes. The unknown is the pushed part's push times its sign, or the multipliers where no
part is pushed.
"""

import numpy as np

from softseam_coupling.kept_kernels import njit

PARTS = FIRST, N_NODES, SIGN, PUSHED, RANK, ROWS_AT, COMPLIANCE_AT, IMPEDANCE_AT = tuple(range(8))
"""columns of a table of parts: first node and how many, `CoupledPart.sign` and `pushed`, columns of its root, 0 for
none, and where its rows, its root or compliance, and its impedance begin in their buffers"""

_MOST = 30
"""iterations of GMRES"""
_REFINEMENTS, _SHRINKS = 6, 0.3
"""times that what is left of the gaps is closed by W's inverse, as long as that leaves no more than this share [1]"""


@njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract"})
def _dot(one, other):
    """Of two vectors of equal length."""
    found = 0.0
    for i in range(len(one)):
        found += one[i] * other[i]
    return found


@njit(cache=True, error_model="numpy")
def _multiply(matrix, at, vector, n, product):
    """The first n entries of a product with a matrix of as many columns as the product's rows, from `at` on."""
    for i in range(n):
        begin = at + i * len(vector)
        product[i] = _dot(matrix[begin : begin + len(vector)], vector)


@njit(cache=True, error_model="numpy")
def _apply_compliance(part, compliances, push, moved):
    """H push, or Y push by its root; a part that is not pushed at all stays where it is."""
    n, rank, at = 3 * part[N_NODES], part[RANK], part[COMPLIANCE_AT]
    if not push.any():
        moved[:] = 0.0
    elif rank:
        across = np.zeros(rank)
        for i in range(n):
            row = compliances[at + i * rank : at + (i + 1) * rank]
            for k in range(rank):
                across[k] += row[k] * push[i]
        _multiply(compliances, at, across, n, moved)
    else:
        _multiply(compliances, at, push, n, moved)


@njit(cache=True, error_model="numpy")
def _add_to_rows(part, rows, own, of_rows):
    """Add B_p x of vectors on a part's nodes (3n,) to what all rows have (3c,)."""
    sign, n, at = part[SIGN], part[N_NODES], part[ROWS_AT]
    if sign:
        for i in range(3 * n):
            of_rows[i] += sign * own[i]
        return
    for row in range(len(of_rows) // 3):
        weights = rows[at + row * n : at + (row + 1) * n]
        for node in range(n):
            weight = weights[node]
            for k in range(3):
                of_rows[3 * row + k] += weight * own[3 * node + k]


@njit(cache=True, error_model="numpy")
def gap_at(table, rows, x, offset):
    """Of all rows (3c,) [m], where the parts' nodes are at x (3N,) [m]."""
    gap = -offset
    for p in range(len(table)):
        first = 3 * table[p, FIRST]
        _add_to_rows(table[p], rows, x[first : first + 3 * table[p, N_NODES]], gap)
    return gap


@njit(cache=True, error_model="numpy")
def _apply(table, rows, compliances, impedances, own, unknown, acted, multipliers, push, move, left):
    """What the parts do under the unknown, where these forces acted on their nodes.

    Fills multipliers, push and move, and left, the change of the gaps, with the rows' own under the multipliers.
    """
    n_rows = len(unknown)
    multipliers[:] = unknown
    left[:] = 0.0
    for pushed in (True, False):
        for p in range(len(table)):
            part = table[p]
            first, n, sign, at = 3 * part[FIRST], 3 * part[N_NODES], part[SIGN], part[ROWS_AT]
            if (part[PUSHED] != 0) != pushed:
                continue
            own_push, own_move = push[first : first + n], move[first : first + n]
            if pushed:
                for i in range(n):
                    own_push[i] = sign * unknown[i]
            elif sign:
                for i in range(n):
                    own_push[i] = sign * multipliers[i] - acted[first + i]
            else:
                for i in range(n):
                    own_push[i] = -acted[first + i]
                for row in range(n_rows // 3):
                    for node in range(n // 3):
                        weight = rows[at + row * (n // 3) + node]
                        for k in range(3):
                            own_push[3 * node + k] += weight * multipliers[3 * row + k]
            _apply_compliance(part, compliances, own_push, own_move)
            if pushed:
                for i in range(n):
                    begin = part[IMPEDANCE_AT] + i * n
                    back = _dot(impedances[begin : begin + n], own_move)
                    multipliers[i] = sign * (own_push[i] - back + acted[first + i])
            _add_to_rows(part, rows, own_move, left)
    for i in range(n_rows):
        left[i] += own[i] * multipliers[i]


@njit(cache=True, error_model="numpy")
def _norm(vector):
    return np.sqrt(_dot(vector, vector))


@njit(cache=True, error_model="numpy")
def close_gaps(table, rows, compliances, impedances, own, inverse, gap, first, acted, tolerance):
    """Multipliers (3c,) [N], pushes [N] and moves [m] of the parts' nodes (3N,), to gaps of `tolerance` [m].

    own      compliance of all rows themselves (3c,) [m/N]
    inverse  of W (3c * 3c) [N/m]
    gap      of all rows, where the parts went (3c,) [m]
    first    multipliers from which the solve begins (3c,) [N]
    acted    force that acted on the parts' nodes (3N,) [N]
    """
    n_rows, n = len(gap), len(acted)
    multipliers, change, step = np.empty(n_rows), np.empty(n_rows), np.empty(n_rows)
    push, move, nothing, left = np.empty(n), np.empty(n), np.zeros(n), gap.copy()
    unknown = first.copy()
    for p in range(len(table)):
        if table[p, PUSHED]:
            unknown[:] = 0.0
    _apply(table, rows, compliances, impedances, own, unknown, acted, multipliers, push, move, change)
    for i in range(n_rows):
        left[i] += change[i]
    goes_on = False
    for _ in range(_REFINEMENTS):
        size = _norm(left)
        if not size > tolerance:
            break
        _multiply(inverse, 0, left, n_rows, step)
        for i in range(n_rows):
            step[i] = -step[i]
        _apply(table, rows, compliances, impedances, own, step, nothing, multipliers, push, move, change)
        after = 0.0
        for i in range(n_rows):
            after += (left[i] + change[i]) ** 2
        if not np.sqrt(after) < _SHRINKS * size:  # the inverse is not near enough
            _gmres(
                table,
                rows,
                compliances,
                impedances,
                own,
                inverse,
                left,
                tolerance,
                step,
                change,
                multipliers,
                push,
                move,
            )
        goes_on = True
        for i in range(n_rows):
            unknown[i] += step[i]
            left[i] += change[i]
    if goes_on:
        _apply(table, rows, compliances, impedances, own, unknown, acted, multipliers, push, move, change)
    return multipliers, push, move


@njit(cache=True, error_model="numpy")
def _gmres(table, rows, compliances, impedances, own, inverse, left, tolerance, step, change, multipliers, push, move):
    """The change of the unknown that closes the gaps left, and what it changes them by, into step and change.

    Preconditioned from the right by `inverse` (Saad and Schultz 1986, SIAM J. Sci. Stat. Comput. 7, 856-869), whose own
    step, and what that changes, are in there before. Overwrites multipliers, push and move.
    """
    n_rows, size, nothing = len(left), _norm(left), np.zeros(len(push))
    basis, images, answers = np.empty((_MOST + 1, n_rows)), np.empty((_MOST, n_rows)), np.empty((_MOST, n_rows))
    h, wanted, turns = np.zeros((_MOST + 1, _MOST)), np.zeros(_MOST + 1), np.zeros((_MOST, 2))
    wanted[0] = size
    for i in range(n_rows):
        basis[0, i], images[0, i], answers[0, i] = -left[i] / size, step[i] / size, change[i] / size
    n_taken = 0
    for k in range(_MOST):
        if k > 0:
            _multiply(inverse, 0, basis[k], n_rows, images[k])
            _apply(table, rows, compliances, impedances, own, images[k], nothing, multipliers, push, move, answers[k])
        v = basis[k + 1]
        v[:] = answers[k]
        for j in range(k + 1):
            h[j, k] = _dot(basis[j], v)
            for i in range(n_rows):
                v[i] -= h[j, k] * basis[j, i]
        length = _norm(v)
        for j in range(k):
            above, below = h[j, k], h[j + 1, k]
            h[j, k] = turns[j, 0] * above + turns[j, 1] * below
            h[j + 1, k] = turns[j, 0] * below - turns[j, 1] * above
        whole = np.hypot(h[k, k], length)
        if not whole > 0.0:  # nothing compliances that way
            break
        n_taken = k + 1
        turns[k, 0], turns[k, 1] = h[k, k] / whole, length / whole
        h[k, k] = whole
        wanted[k + 1] = -turns[k, 1] * wanted[k]
        wanted[k] *= turns[k, 0]
        rest = abs(wanted[k + 1])
        if rest <= tolerance or not length > 0.0 or not np.isfinite(rest):
            break
        for i in range(n_rows):
            v[i] /= length
    step[:] = 0.0
    change[:] = 0.0
    for k in range(n_taken - 1, -1, -1):
        for j in range(k + 1, n_taken):
            wanted[k] -= h[k, j] * wanted[j]
        wanted[k] /= h[k, k]
        for i in range(n_rows):
            step[i] += wanted[k] * images[k, i]
            change[i] += wanted[k] * answers[k, i]
