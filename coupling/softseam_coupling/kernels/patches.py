"""Clean shapes for a set of grid cells: no islands, no holes, no seam that hangs on an edge or a corner."""

import numpy as np

from softseam_coupling.kept_kernels import njit


@njit(cache=True, error_model="numpy")
def label_components(inside, neighbours, label, stack):
    """Number the face-connected components of the cells where `inside` holds; returns how many.

    neighbours  (C, 6)  face neighbours, -1 for none
    label       (C,)    out: component, -1 outside; components in the order of their first cell
    stack       (C,)    work
    """
    label[:] = -1
    n = 0
    for start in range(inside.shape[0]):
        if not inside[start] or label[start] >= 0:
            continue
        label[start] = n
        stack[0] = start
        top = 1
        while top > 0:
            top -= 1
            cell = stack[top]
            for f in range(6):
                other = neighbours[cell, f]
                if other >= 0 and inside[other] and label[other] < 0:
                    label[other] = n
                    stack[top] = other
                    top += 1
        n += 1
    return n


@njit(cache=True, error_model="numpy")
def fill_islands(near, neighbours, min_patch, label, stack):
    """Make near every far component of fewer than min_patch cells that touches a near cell; returns the cells added.

    near  (C,)  updated in place
    """
    n_cells = near.shape[0]
    n = label_components(~near, neighbours, label, stack)
    size = np.zeros(n, dtype=np.int32)
    touches = np.zeros(n, dtype=np.bool_)
    for cell in range(n_cells):
        if label[cell] >= 0:
            size[label[cell]] += 1
            for f in range(6):
                other = neighbours[cell, f]
                if other >= 0 and near[other]:
                    touches[label[cell]] = True
    added = 0
    for cell in range(n_cells):
        if label[cell] >= 0 and touches[label[cell]] and size[label[cell]] < min_patch:
            near[cell] = True
            added += 1
    return added


@njit(cache=True, error_model="numpy")
def _connected(block, kind, position, reach):
    """Whether the cells of one kind in a 2 x 2 x 2 block are face-connected inside the block."""
    total = 0
    first = -1
    for o in range(8):
        reach[o] = False
        if block[o] >= 0 and kind[block[o]] == position:
            total += 1
            if first < 0:
                first = o
    if total < 2:
        return True
    reach[first] = True
    reached = 1
    changed = True
    while changed:
        changed = False
        for o in range(8):
            if reach[o] or block[o] < 0 or kind[block[o]] != position:
                continue
            for axis in range(3):
                if reach[o ^ (1 << axis)]:
                    reach[o] = True
                    reached += 1
                    changed = True
                    break
    return reached == total


@njit(cache=True, error_model="numpy")
def mend_contacts(near, was_near, distance, blocks):
    """Where near (or far) cells of a 2 x 2 x 2 block meet only at an edge or a corner, make a far cell of it near.

    Chosen: a cell that was near already, else the one closest to a tool, else the first. One pass; returns the cells
    added. Far cells that the body itself leaves apart (their link would be a missing cell) are not mended by that, so
    a block without a near cell is left alone.

    near            (C,)    updated in place
    was_near        (C,)
    distance        (C,)    [m]
    blocks          (b, 8)  cells around each inner lattice point, -1 where the body has none; octant o = i + 2 j + 4 k
    """
    reach = np.zeros(8, dtype=np.bool_)
    added = 0
    for b in range(blocks.shape[0]):
        block = blocks[b]
        while True:
            some_near = False
            best = -1
            for o in range(8):
                cell = block[o]
                if cell < 0:
                    continue
                if near[cell]:
                    some_near = True
                elif best < 0 or (was_near[cell] and not was_near[best]):
                    best = cell
                elif was_near[cell] == was_near[best] and distance[cell] < distance[best]:
                    best = cell
            if not some_near or best < 0:
                break
            if _connected(block, near, True, reach) and _connected(block, near, False, reach):
                break
            near[best] = True
            added += 1
    return added
