"""Rows of a group into those of a workspace, and back."""

from softseam_services.pbd.batch.layout import N_OF_NODE
from softseam_services.pbd.kernels.lanes import LANES, batch_kernel, move_four

from .lane import WIDE, first_of

move = move_four


@batch_kernel
def load_block(ws, s, nodes, block, at_nodes, start):
    """Rows `start` of a block's nodes, 3 of each, into the first rows."""
    for i in range(8):
        node = first_of(at_nodes + N_OF_NODE * nodes[block, i] + start)
        for c in range(3):
            move(ws, LANES * (3 * i + c), s, node + WIDE * c)


@batch_kernel
def store_block(ws, s, nodes, block, at_nodes, start):
    """The way back of `load_block`."""
    for i in range(8):
        node = first_of(at_nodes + N_OF_NODE * nodes[block, i] + start)
        for c in range(3):
            move(s, node + WIDE * c, ws, LANES * (3 * i + c))


@batch_kernel
def load_rows(ws, row, s, at, count):
    """Rows of a group into rows of a workspace."""
    for r in range(count):
        move(ws, LANES * (row + r), s, first_of(at + r))


@batch_kernel
def store_rows(ws, row, s, at, count):
    """The way back of `load_rows`."""
    for r in range(count):
        move(s, first_of(at + r), ws, LANES * (row + r))
