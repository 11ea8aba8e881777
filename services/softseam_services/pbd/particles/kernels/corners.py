"""Corners of constraints: between particles and the workspace's rows four lanes at a time, or edges of one lane."""

from softseam_services.pbd.kernels.lanes import lane_kernel, transpose_four

CORNER = 32
"""numbers of a corner in a workspace: x, y, z, w of eight lanes"""


@lane_kernel
def gather_corner(ws, xw, nodes, batch, corner, four):
    """x, y, z, w of a corner (n + 8, 4) into rows `CORNER * corner`, lanes four .. four + 3 of a batch."""
    at = CORNER * corner + four
    transpose_four(
        *(ws, at, at + 8, at + 16, at + 24, xw),
        *(4 * nodes[batch, corner, four], 4 * nodes[batch, corner, four + 1]),
        *(4 * nodes[batch, corner, four + 2], 4 * nodes[batch, corner, four + 3]),
    )


@lane_kernel
def scatter_corner(ws, xw, nodes, batch, corner, four):
    """The way back of `gather_corner`."""
    at = CORNER * corner + four
    transpose_four(
        *(xw, 4 * nodes[batch, corner, four], 4 * nodes[batch, corner, four + 1]),
        *(4 * nodes[batch, corner, four + 2], 4 * nodes[batch, corner, four + 3]),
        *(ws, at, at + 8, at + 16, at + 24),
    )


@lane_kernel
def three_edges(xw, i, j, k, m):
    """From particle i to j, k and m (9 values) [m]."""
    x, y, z = xw[i, 0], xw[i, 1], xw[i, 2]
    return (
        *(xw[j, 0] - x, xw[j, 1] - y, xw[j, 2] - z),
        *(xw[k, 0] - x, xw[k, 1] - y, xw[k, 2] - z),
        *(xw[m, 0] - x, xw[m, 1] - y, xw[m, 2] - z),
    )
