"""Derivatives of what a box covers of a patch and of a face (kernels/cover.py) by the places of the face's nodes.

A share is the product of two overlaps. Along one axis, with least and greatest coordinate l and h of a patch's corners
and the box from -a to a,
  o = (min(h, a) - max(l, -a))/(h - l),   do/dh = ([h < a] - o)/(h - l),   do/dl = (o - [l > -a])/(h - l)         (1)
and l, h are sums N_k(s) N_l(t) x_kl at a corner each, whose weights are their derivatives.
"""

from __future__ import annotations

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import overlap

_ACROSS = (1, 0, 2, 1, 1, 0, 0, 2, 2)
"""of the face's nodes: which of N_-, N_0, N_+ along s, and below along t"""
_ALONG = (1, 1, 1, 0, 2, 0, 2, 0, 2)
_FIRST_CORNER = 5
_ALIKE = 1e-9
"""of the way between two ends: corners that are apart by less are one end, which moves as their mean does"""


@njit(cache=True, error_model="numpy")
def _function(which, s):
    """N_-, N_0 or N_+ at s."""
    if which == 0:
        return 0.5 * s * (s - 1.0)
    return 1.0 - s * s if which == 1 else 0.5 * s * (s + 1.0)


@njit(cache=True, error_model="numpy")
def _corner(k, corner, patch, half):
    """Weight of node k of the face at a corner 0 .. 3 of the patch."""
    s = patch[0] + (half if corner % 2 else -half)
    t = patch[1] + (half if corner >= 2 else -half)
    return _function(_ACROSS[k], s) * _function(_ALONG[k], t)


@njit(cache=True, error_model="numpy")
def _slopes(low, high, half):
    """The overlap, and its derivatives by `high` and `low`; eq. (1)."""
    share = overlap(0.5 * (low + high), 0.5 * (high - low), half)
    if share <= 0.0 or (low > -half and high < half):
        return share, 0.0, 0.0
    length = high - low
    return share, ((1.0 if high < half else 0.0) - share) / length, (share - (1.0 if low > -half else 0.0)) / length


@njit(cache=True, error_model="numpy")
def _ends(at, low, high):
    """Least and greatest of four numbers; low, high (4,) <- which these are, shared out where several are alike."""
    least, greatest = at.min(), at.max()
    near = _ALIKE * (greatest - least)
    n_low = n_high = 0
    for corner in range(4):
        n_low += at[corner] <= least + near
        n_high += at[corner] >= greatest - near
    for corner in range(4):
        low[corner] = 1.0 / n_low if at[corner] <= least + near else 0.0
        high[corner] = 1.0 / n_high if at[corner] >= greatest - near else 0.0
    return least, greatest


@njit(cache=True, error_model="numpy")
def differentiate_cover(face, axis, patches, patch, shape, slope):
    """Share of a patch and of its face that a box covers with the side across `axis`; slope (2, 9, 3) <- derivatives
    of both by the face's nodes (9, 3), seen in the tool's frame [1/m]. patches, patch, shape as of `covered`."""
    slope[:] = 0.0
    half = 1.0 / patches
    at, low, high = np.empty(4), np.empty(4), np.empty(4)
    share = whole = 1.0
    for beside in range(3):
        if beside == axis:
            continue
        for corner in range(4):
            at[corner] = face[_FIRST_CORNER + corner, beside]
        least, greatest = _ends(at, low, high)
        of_face, up, down = _slopes(least, greatest, shape[beside])
        slope[1] *= of_face
        for corner in range(4):
            slope[1, _FIRST_CORNER + corner, beside] += whole * (up * high[corner] + down * low[corner])
        whole *= of_face
        for corner in range(4):
            at[corner] = 0.0
            for k in range(9):
                at[corner] += _corner(k, corner, patch, half) * face[k, beside]
        least, greatest = _ends(at, low, high)
        of_patch, up, down = _slopes(least, greatest, shape[beside])
        slope[0] *= of_patch
        for k in range(9):
            for corner in range(4):
                weight = up * high[corner] + down * low[corner]
                slope[0, k, beside] += share * weight * _corner(k, corner, patch, half)
        share *= of_patch
    return share, whole
