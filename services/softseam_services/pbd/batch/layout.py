"""How the numbers of many pieces lie in memory: row r of a lane at WIDE r + lane, one group of lanes after another.

A group has rows of a lane's own numbers, then of each tool, node, block and pair of a point and a tool, in this order.
"""

from typing import NamedTuple

# Of a lane: constants of its blocks as in `kernels.block`, volume of a block, number of tools that it is near to.
CONSTANTS, VOLUME, NEAR, N_OF_LANE = 0, 30, 31, 32
# Of a tool: where it is, where it goes in a step, its turn row by row (own = R^T world).
POSITION, WAY, TURN, N_OF_TOOL = 0, 3, 6, 15
# Of a node: where it is, inverse mass, 8 times what counts of it in a block's local solve, where it was, velocity,
# acceleration by blocks and contacts, prediction, directions in which it is held.
X, W, SOFT, OLD, V, A, STAR, HOLDS, N_OF_NODE = 0, 3, 4, 5, 8, 11, 14, 17, 18
# Of a block: stress as in `kernels.block`, inverse masses of its nodes, 8 times the largest that counts.
STRESS, WEIGHTS, SOFTNESS, N_OF_BLOCK = 0, 21, 29, 30
# Of a pair, as in `kernels.pairs`: force, pressure with a memory and debt, side faced, slip in the substep and since it
# touches, mean force, friction, compliance and its inverse.
FORCE, STEADY, FACED, SLIPPED, SINCE, MEAN, FRICTION, GIVE, N_OF_PAIR = 0, 3, 5, 8, 11, 14, 17, 18, 20
# What comes out, of a lane: middle, largest von Mises stress squared, strain energy, least J, slip; then of each tool
# force on it and points that touch.
MIDDLE, STRESS2, STRAIN, LEAST_J, SLIP, N_OUT, N_OUT_OF_TOOL = 0, 3, 4, 5, 6, 7, 4


class Layout(NamedTuple):
    """Rows where the parts of a group begin."""

    tools: int
    nodes: int
    blocks: int
    pairs: int
    out: int
    rows: int


def lay_out(t: int, n: int, b: int, p: int) -> Layout:
    """Of t tools, n nodes, b blocks and p points."""
    tools = N_OF_LANE
    nodes = tools + t * N_OF_TOOL
    blocks = nodes + n * N_OF_NODE
    pairs = blocks + b * N_OF_BLOCK
    out = pairs + p * t * N_OF_PAIR
    return Layout(tools, nodes, blocks, pairs, out, out + N_OUT + t * N_OUT_OF_TOOL)
