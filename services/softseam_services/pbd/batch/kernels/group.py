"""A step of one group of pieces, all its lanes together, on a processor."""

from softseam_services.pbd.batch import layout as lay
from softseam_services.pbd.kernels.block_rows import VOLUME as BLOCK_VOLUME
from softseam_services.pbd.kernels.block_rows import WANTED
from softseam_services.pbd.kernels.form import FORM
from softseam_services.pbd.kernels.lanes import LANES, batch_kernel
from softseam_services.shapes.branches import BOX

from .blocks import N_ROWS_OF_BLOCK, find_held, soften_blocks, spread_stresses, sweep_blocks
from .contacts import N_ROWS_OF_PAIR, account, begin_contacts, find_near, solve_contacts
from .lane import WIDE, finish_node, first_of, largest_of_eight, look_at_block, predict_node
from .rows import load_block, load_rows, store_block, store_rows

__all__ = ["N_ROWS_OF_BLOCK", "N_ROWS_OF_PAIR", "advance_groups"]


@batch_kernel
def carry(s, ws, layout, nodes, n, points, n_tools):
    """Accelerations by the blocks' stress and the contacts' forces, once a step: `kernels.substep.carried`."""
    at_nodes, at_blocks, at_pairs = layout.nodes, layout.blocks, layout.pairs
    for i in range(n):
        node = first_of(at_nodes + lay.N_OF_NODE * i)
        for lane in range(WIDE):
            for c in range(3):
                s[node + WIDE * (lay.A + c) + lane] = 0.0
            s[node + WIDE * lay.SOFT + lane] = 8.0 * s[node + WIDE * lay.W + lane]
    for block in range(len(nodes)):
        at = at_blocks + lay.N_OF_BLOCK * block
        load_rows(ws, 0, s, at + lay.WEIGHTS, 8)
        for lane in range(LANES):
            ws[lane + LANES * WANTED] = 8.0 * largest_of_eight(ws, lane)
        store_rows(ws, WANTED, s, at + lay.SOFTNESS, 1)
        load_block(ws, s, nodes, block, at_nodes, lay.A)
        spread_stresses(ws, s, at)
        store_block(ws, s, nodes, block, at_nodes, lay.A)
    for point in range(len(points)):
        node = first_of(at_nodes + lay.N_OF_NODE * points[point])
        for tool in range(n_tools):
            pair = first_of(at_pairs + lay.N_OF_PAIR * (n_tools * point + tool))
            for c in range(3):
                for lane in range(WIDE):
                    s[node + WIDE * (lay.A + c) + lane] += s[pair + WIDE * (lay.FORCE + c) + lane]
    for i in range(n):
        node = first_of(at_nodes + lay.N_OF_NODE * i)
        for lane in range(WIDE):
            for c in range(3):
                s[node + WIDE * (lay.A + c) + lane] *= s[node + WIDE * lay.W + lane]


@batch_kernel
def predict(s, layout, n, push, keep, h):
    """`predict_node` of all nodes."""
    for i in range(n):
        node = first_of(layout.nodes + lay.N_OF_NODE * i)
        for lane in range(WIDE):
            predict_node(s, node + lane, push, keep, h)


@batch_kernel
def finish(s, layout, n, per_h):
    """`finish_node` of all nodes."""
    for i in range(n):
        node = first_of(layout.nodes + lay.N_OF_NODE * i)
        for lane in range(WIDE):
            finish_node(s, node + lane, per_h)


@batch_kernel
def summarise(s, ws, layout, nodes, n, points, kind, active):
    """What comes out of a step."""
    n_tools, out = len(kind), first_of(layout.out)
    for entry in range(lay.N_OUT + lay.N_OUT_OF_TOOL * n_tools):
        for lane in range(WIDE):
            s[out + WIDE * entry + lane] = 0.0
    for lane in range(LANES):
        ws[lane + LANES * WANTED], ws[lane + LANES * (WANTED + 1)], ws[lane + LANES * (WANTED + 2)] = 0.0, 0.0, 9.0
        for entry in range(3, 7):
            ws[lane + LANES * (WANTED + entry)] = 0.0
    for i in range(n):
        load_rows(ws, 0, s, layout.nodes + lay.N_OF_NODE * i + lay.X, 4)
        for lane in range(LANES):
            w = ws[lane + 3 * LANES]
            mass = 1.0 / w if w > 0.0 else 0.0
            ws[lane + LANES * (WANTED + 3)] += mass
            ws[lane + LANES * (WANTED + 4)] += mass * ws[lane]
            ws[lane + LANES * (WANTED + 5)] += mass * ws[lane + LANES]
            ws[lane + LANES * (WANTED + 6)] += mass * ws[lane + 2 * LANES]
    for block in range(len(nodes)):
        load_block(ws, s, nodes, block, layout.nodes, lay.X)
        for lane in range(LANES):
            square, energy, J = look_at_block(ws, lane)
            ws[lane + LANES * WANTED] = max(ws[lane + LANES * WANTED], square)
            ws[lane + LANES * (WANTED + 1)] += energy
            ws[lane + LANES * (WANTED + 2)] = min(ws[lane + LANES * (WANTED + 2)], J)
    for lane in range(LANES):
        for entry in range(3):
            ws[lane + LANES * (WANTED + 4 + entry)] /= ws[lane + LANES * (WANTED + 3)]
    store_rows(ws, WANTED + 4, s, layout.out + lay.MIDDLE, 3)
    store_rows(ws, WANTED, s, layout.out + lay.STRESS2, 1)
    store_rows(ws, WANTED + 1, s, layout.out + lay.STRAIN, 1)
    store_rows(ws, WANTED + 2, s, layout.out + lay.LEAST_J, 1)
    for tool in range(n_tools):
        of_tool = out + WIDE * (lay.N_OUT + lay.N_OUT_OF_TOOL * tool)
        for number in range(1, active[tool, 0] + 1):
            pair = first_of(layout.pairs + lay.N_OF_PAIR * (n_tools * active[tool, number] + tool))
            for lane in range(WIDE):
                x, y = s[pair + WIDE * lay.MEAN + lane], s[pair + WIDE * (lay.MEAN + 1) + lane]
                z = s[pair + WIDE * (lay.MEAN + 2) + lane]
                s[of_tool + lane] -= x
                s[of_tool + WIDE + lane] -= y
                s[of_tool + 2 * WIDE + lane] -= z
                s[of_tool + 3 * WIDE + lane] += 1.0 if x * x + y * y + z * z > 0.0 else 0.0
                if kind[tool] == BOX:
                    x, y = s[pair + WIDE * lay.SINCE + lane], s[pair + WIDE * (lay.SINCE + 1) + lane]
                    z = s[pair + WIDE * (lay.SINCE + 2) + lane]
                    s[out + WIDE * lay.SLIP + lane] = max(s[out + WIDE * lay.SLIP + lane], x * x + y * y + z * z)


@batch_kernel
def advance_groups(state, first, end, ws, row, layout, nodes, n, points, kind, shape, gravity, now, active, held):
    """A step of the groups first .. end - 1 of state (groups, rows * WIDE), updated in place.

    ws, row (N_ROWS_OF_BLOCK * LANES,), (N_ROWS_OF_PAIR * LANES,) workspaces, zero before and after where not written
    nodes   (b, 8) of the blocks, in the order in which they are solved
    n       number of nodes; points (p,) those of the surface
    kind, shape  (t,), (t, 3) of tools: boxes by their half edges, planes by their normals
    now     `pieces.Timing`
    active, held  (t, 1 + p), (1 + b,) room
    """
    hh, per_h, n_tools = now.h * now.h, 1.0 / now.h, len(kind)
    push = gravity[0], gravity[1], gravity[2]
    for group in range(first, end):
        s = state[group]
        load_rows(ws, FORM, s, lay.CONSTANTS, 30)
        load_rows(ws, BLOCK_VOLUME, s, lay.VOLUME, 1)
        carry(s, ws, layout, nodes, n, points, n_tools)
        find_near(s, row, layout, n, points, kind, shape, hh, now.step, now.margin, active)
        find_held(nodes, points, active, held)
        for _ in range(now.substeps):
            begin_contacts(s, row, layout, points, kind, shape, active)
            predict(s, layout, n, push, now.keep, now.h)
            solve_contacts(s, row, layout, points, kind, shape, active, hh, True)
            soften_blocks(s, ws, layout, nodes, held)
            sweep_blocks(s, ws, layout, nodes, now.kappa, hh)
            solve_contacts(s, row, layout, points, kind, shape, active, hh, False)
            finish(s, layout, n, per_h)
            account(s, layout, n_tools, active, now.share)
        summarise(s, ws, layout, nodes, n, points, kind, active)
