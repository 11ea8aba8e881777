"""How the octants of a region's boxes count in hex27 and its kin, where slivers are joined to roots (`body.slivers`).

A root and the slivers that are joined to it have one deformation gradient, the mean over all that they fill,
  F = sum_a x_a (x) g_a,  g = sum_k int_k grad N dV / sum_k V_k,  U = sum_k V_k psi(F)                            (1)
k over the root and its slivers. The sum of gradients times volumes stays what it is, so that the patch test holds as it
does without (`elements.cut`), and empty octants need no floor. What a mean leaves out, the shear's rest S of
`elements.cut`, eq. (1), is the root's with the volume of all; slivers have a little of it, `SLIVER_SHEAR`: it vanishes
on linear fields, and holds nodes that the body hardly reaches. Roots with slivers in other cells have eq. (1) in
`joints`, and count with nothing in their own cell.
"""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Body, Floats, Ints
from softseam_services.body.filled import FILL_FLOOR, filled_moments, gradient_integrals, mean_gradients
from softseam_services.body.slivers import true_fill

SLIVER_SHEAR = 0.02
"""fill that slivers have S with [1]: less lets stress beside them waver, more makes thin parts stiff (decision 17)"""


class Octants(NamedTuple):
    """Of c cells, u of which have gradients of their own."""

    cut: Ints
    """these cells: filled in part, or with an octant that is joined to another cell's (u,)"""
    gradient: Floats
    """that their octants count with (u, 8, 3, 27) [1/m]"""
    own: Floats
    """over the filled part of each octant alone: what its stress is reported of (u, 8, 3, 27) [1/m]"""
    fill: Floats
    """what each octant counts with in its cell (c, 8) [1]"""
    shear: Floats
    """and what its rest of shear does (c, 8) [1]"""
    total: Floats
    """volume of each root and its slivers, over that of an octant; 0 of slivers (c, 8) [1]"""


def cut_cells(body: Body, cells: Ints, root: Ints) -> Ints:
    """Cells among these with gradients of their own (u,); root (c, 8) as of `body.slivers`."""
    part = np.flatnonzero((body.fill[cells] < 1.0).any(axis=1) & body.boxes)
    apart = root // 8 != np.arange(len(root))[:, None]
    return np.union1d(part, root[apart] // 8).astype(np.int32)


def count_octants(body: Body, cells: Ints, root: Ints) -> Octants:
    """Of the body's cells (c,) with these roots (c, 8)."""
    cut, own_place = cut_cells(body, cells, root), np.arange(root.size).reshape(root.shape)
    fill = np.maximum(body.fill[cells], FILL_FLOOR)
    own = body.axes @ mean_gradients(filled_moments(body, cells[cut], fill[cut]), body.edges)
    if np.array_equal(root, own_place):
        return Octants(cut, own, own, fill, fill, fill)
    true, joined = true_fill(body, cells), root != own_place
    is_root = np.isin(own_place, root[joined])
    shared = joined | is_root
    gathered = np.bincount(root[shared], weights=true[shared], minlength=root.size).reshape(root.shape)
    total = np.where(joined, 0.0, np.where(is_root, gathered, fill))
    elsewhere = root // 8 != own_place // 8
    abroad = np.isin(own_place, root[elsewhere])
    gradient = own.copy()
    number = np.full(len(root), -1)
    number[cut] = np.arange(len(cut))
    integral = body.axes @ gradient_integrals(filled_moments(body, cells[cut], true[cut]), body.edges)
    sums = np.zeros_like(integral).reshape(-1, 3, 27)
    local = 8 * number[root // 8] + root % 8  # of the roots, among cut cells
    inside = ~elsewhere[cut]
    np.add.at(sums, local[cut][inside], integral[inside])
    changed = (is_root & ~abroad)[cut]
    gradient[changed] = sums.reshape(integral.shape)[changed] / total[cut][changed][:, None, None]
    return Octants(
        cut=cut,
        gradient=gradient,
        own=own,
        fill=np.where(joined | abroad, 0.0, total),
        shear=np.where(joined, SLIVER_SHEAR, total),
        total=total,
    )
