"""Blocks of a group, one after the other, each of all lanes."""

from softseam_services.pbd.batch.layout import N_OF_BLOCK, N_OF_NODE, SOFT, SOFTNESS, X
from softseam_services.pbd.kernels.form import FORM
from softseam_services.pbd.kernels.lanes import LANES, batch_kernel

from .lane import first_of, largest_of_eight, solve_block, spread_stress
from .rows import load_block, move, store_block

N_ROWS_OF_BLOCK = FORM + 30
"""of the workspace of a block"""


@batch_kernel
def spread_stresses(ws, s, at):
    """`spread_stress` of all lanes, of the block whose first row is `at`."""
    at = first_of(at)
    for lane in range(LANES):
        spread_stress(ws, lane, s, at + lane)


@batch_kernel
def solve_blocks(ws, s, at, kappa, hh):
    """`solve_block` of all lanes."""
    at = first_of(at)
    for lane in range(LANES):
        solve_block(ws, lane, s, at + lane, kappa, hh)


@batch_kernel
def sweep_blocks(s, ws, layout, nodes, kappa, hh):
    """Solve each block once."""
    for block in range(len(nodes)):
        load_block(ws, s, nodes, block, layout.nodes, X)
        solve_blocks(ws, s, layout.blocks + N_OF_BLOCK * block, kappa, hh)
        store_block(ws, s, nodes, block, layout.nodes, X)


@batch_kernel
def soften_blocks(s, ws, layout, nodes, held):
    """Blocks with nodes that tools may hold, whose numbers are in held, their count first: `kernels.hold`."""
    for number in range(1, held[0] + 1):
        block = held[number]
        for i in range(8):
            move(ws, LANES * i, s, first_of(layout.nodes + N_OF_NODE * nodes[block, i] + SOFT))
        for lane in range(LANES):
            ws[lane + LANES * 8] = largest_of_eight(ws, lane)
        move(s, first_of(layout.blocks + N_OF_BLOCK * block + SOFTNESS), ws, LANES * 8)


@batch_kernel
def find_held(nodes, points, active, held):
    """Blocks with a node of a pair that is active: held (1 + b,), their count first; a point's node is in points."""
    held[0] = 0
    for block in range(len(nodes)):
        found = False
        for tool in range(len(active)):
            for number in range(1, active[tool, 0] + 1):
                node = points[active[tool, number]]
                for i in range(8):
                    found = found or nodes[block, i] == node
        if found:
            held[0] += 1
            held[held[0]] = block
