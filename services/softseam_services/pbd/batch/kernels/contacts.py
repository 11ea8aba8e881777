"""Contacts of a group: which points may touch, and the force of those that do."""

import numpy as np

from softseam_services.pbd.batch import layout as lay
from softseam_services.pbd.kernels import pairs
from softseam_services.pbd.kernels.contact import NO_MEMORY
from softseam_services.pbd.kernels.lanes import LANES, batch_kernel
from softseam_services.pbd.kernels.pairs import EIGHT
from softseam_services.shapes.branches import BOX

from .lane import TOOL, WIDE, begin_on_box, box_gap_of, counted, first_of, lends, plane_gap_of, solve_pair
from .rows import load_rows, store_rows

ROW_HOLDS, ROW_SOFT, ROW_NEAR = (TOOL + lay.N_OF_TOOL + number for number in range(3))
N_ROWS_OF_PAIR = ROW_NEAR + 1
"""of the workspace of a pair"""


@batch_kernel
def find_near(s, row, layout, n, points, kind, shape, hh, dt, margin, active):
    """Pairs that may touch in this step in any lane, tool after tool: active (t, 1 + p), their count first."""
    at_nodes, at_pairs, n_tools = layout.nodes, layout.pairs, len(kind)
    for lane in range(LANES):
        row[lane], row[lane + LANES] = 0.0, 0.0
    for i in range(n):
        node = first_of(at_nodes + lay.N_OF_NODE * i + lay.V)
        for lane in range(WIDE):
            x, y, z = s[node + lane], s[node + WIDE + lane], s[node + 2 * WIDE + lane]
            row[lane] = max(row[lane], x * x + y * y + z * z)
    for tool in range(n_tools):
        at = first_of(layout.tools + lay.N_OF_TOOL * tool + lay.WAY)
        for lane in range(WIDE):
            x, y, z = s[at + lane], s[at + WIDE + lane], s[at + 2 * WIDE + lane]
            row[lane + LANES] = max(row[lane + LANES], x * x + y * y + z * z)
    per_h, near = 1.0 / np.sqrt(hh), first_of(lay.NEAR)
    for lane in range(LANES):
        # A step has dt/h substeps, and a tool's way is that of one.
        speed = np.sqrt(row[lane]) + per_h * np.sqrt(row[lane + LANES])
        row[lane + EIGHT * ROW_NEAR] = margin + 2.0 * dt * speed
    for lane in range(WIDE):
        s[near + lane] = 0.0
    for tool in range(n_tools):
        a, b, c = shape[tool, 0], shape[tool, 1], shape[tool, 2]
        load_rows(row, TOOL, s, layout.tools + lay.N_OF_TOOL * tool, lay.N_OF_TOOL)
        found = 0
        for lane in range(LANES):
            row[lane + EIGHT * ROW_HOLDS] = 0.0
        for point in range(len(points)):
            node = at_nodes + lay.N_OF_NODE * points[point]
            pair = at_pairs + lay.N_OF_PAIR * (n_tools * point + tool)
            load_rows(row, 0, s, node + lay.X, 4)
            load_rows(row, pairs.FORCE, s, pair + lay.FORCE, 3)
            load_rows(row, pairs.STEADY, s, pair + lay.STEADY, 2)
            for lane in range(LANES):
                for entry in range(3):
                    row[lane + EIGHT * (pairs.FACED + entry)] = 0.0
                if kind[tool] == BOX:
                    gap = box_gap_of(row, lane, a, b, c)[0]
                else:
                    gap = plane_gap_of(row, lane, a, b, c)[0]
                x, y = row[lane + EIGHT * pairs.FORCE], row[lane + EIGHT * (pairs.FORCE + 1)]
                z = row[lane + EIGHT * (pairs.FORCE + 2)]
                carries = x * x + y * y + z * z > 0.0
                meets = gap < row[lane + EIGHT * ROW_NEAR] or carries
                w = row[lane + EIGHT * pairs.W]
                give = hh * w if meets else 0.0
                row[lane + EIGHT * pairs.GIVE] = give
                row[lane + EIGHT * (pairs.GIVE + 1)] = 1.0 / give if give > 0.0 else 0.0
                row[lane + EIGHT * pairs.STEADY] = row[lane + EIGHT * pairs.STEADY] if meets else 0.0
                row[lane + EIGHT * (pairs.STEADY + 1)] = row[lane + EIGHT * (pairs.STEADY + 1)] if meets else 0.0
                one = 1.0 if meets else 0.0
                row[lane + EIGHT * ROW_HOLDS] = max(row[lane + EIGHT * ROW_HOLDS], one)
                row[lane + EIGHT * ROW_SOFT] = one
            store_rows(row, pairs.GIVE, s, pair + lay.GIVE, 2)
            store_rows(row, pairs.STEADY, s, pair + lay.STEADY, 2)
            meeting = 0.0
            for lane in range(LANES):
                meeting += row[lane + EIGHT * ROW_SOFT]
            pair = first_of(pair)
            for entry in range(3):
                for lane in range(WIDE):
                    s[pair + WIDE * (lay.MEAN + entry) + lane] = 0.0
            if meeting > 0.0:
                found += 1
                active[tool, found] = point
        active[tool, 0] = found
        for lane in range(WIDE):
            s[near + lane] += row[lane + EIGHT * ROW_HOLDS]


@batch_kernel
def begin_contacts(s, row, layout, points, kind, shape, active):
    """Sides that points face, with the tools where they begin the substep; tools then go on."""
    n_tools = len(kind)
    for tool in range(n_tools):
        a, b, c = shape[tool, 0], shape[tool, 1], shape[tool, 2]
        at = layout.tools + lay.N_OF_TOOL * tool
        load_rows(row, TOOL, s, at, lay.N_OF_TOOL)
        if kind[tool] == BOX:
            for number in range(1, active[tool, 0] + 1):
                point = active[tool, number]
                pair = layout.pairs + lay.N_OF_PAIR * (n_tools * point + tool)
                load_rows(row, pairs.BEFORE, s, layout.nodes + lay.N_OF_NODE * points[point] + lay.X, 3)
                load_rows(row, pairs.FORCE, s, pair + lay.FORCE, 3)
                for lane in range(LANES):
                    begin_on_box(row, lane, a, b, c)
                store_rows(row, pairs.FACED, s, pair + lay.FACED, 3)
        at = first_of(at)
        for lane in range(WIDE):
            for entry in range(3):
                s[at + WIDE * (lay.POSITION + entry) + lane] += s[at + WIDE * (lay.WAY + entry) + lane]


@batch_kernel
def solve_contacts(s, row, layout, points, kind, shape, active, hh, softens):
    """Solve each pair once, tool after tool; softens: blocks count with less of nodes that are held."""
    n_tools = len(kind)
    part = lends(hh)
    load_rows(row, ROW_NEAR, s, lay.NEAR, 1)
    if softens:
        for tool in range(n_tools):
            for number in range(1, active[tool, 0] + 1):
                node = first_of(layout.nodes + lay.N_OF_NODE * points[active[tool, number]] + lay.HOLDS)
                for lane in range(WIDE):
                    s[node + lane] = 0.0
    for tool in range(n_tools):
        a, b, c = shape[tool, 0], shape[tool, 1], shape[tool, 2]
        load_rows(row, TOOL, s, layout.tools + lay.N_OF_TOOL * tool, lay.N_OF_TOOL)
        for number in range(1, active[tool, 0] + 1):
            point = active[tool, number]
            node = layout.nodes + lay.N_OF_NODE * points[point]
            pair = layout.pairs + lay.N_OF_PAIR * (n_tools * point + tool)
            load_rows(row, 0, s, node + lay.X, 4)
            load_rows(row, pairs.BEFORE, s, node + lay.OLD, 3)
            load_rows(row, pairs.FORCE, s, pair + lay.FORCE, 3)
            load_rows(row, pairs.STEADY, s, pair + lay.STEADY, 2)
            load_rows(row, pairs.FRICTION, s, pair + lay.FRICTION, 3)  # and compliance
            if kind[tool] == BOX:
                load_rows(row, pairs.FACED, s, pair + lay.FACED, 3)
                for lane in range(LANES):
                    newer = part if row[lane + EIGHT * ROW_NEAR] < 1.5 else NO_MEMORY
                    solve_pair(row, lane, box_gap_of(row, lane, a, b, c), hh, newer)
            else:
                for lane in range(LANES):
                    solve_pair(row, lane, plane_gap_of(row, lane, a, b, c), hh, part)
            store_rows(row, 0, s, node + lay.X, 3)
            store_rows(row, pairs.FORCE, s, pair + lay.FORCE, 3)
            store_rows(row, pairs.STEADY, s, pair + lay.STEADY, 2)
            store_rows(row, pairs.SLIPPED, s, pair + lay.SLIPPED, 3)
            if softens:
                load_rows(row, ROW_HOLDS, s, node + lay.HOLDS, 1)
                for lane in range(LANES):
                    holds = row[lane + EIGHT * ROW_HOLDS] + row[lane + EIGHT * pairs.HOLD]
                    row[lane + EIGHT * ROW_HOLDS] = holds
                    row[lane + EIGHT * ROW_SOFT] = counted(holds, row[lane + EIGHT * pairs.W])
                store_rows(row, ROW_HOLDS, s, node + lay.HOLDS, 1)
                store_rows(row, ROW_SOFT, s, node + lay.SOFT, 1)


@batch_kernel
def account(s, layout, n_tools, active, share):
    """Mean forces and slips of a substep that is a `share` of the step."""
    for tool in range(n_tools):
        for number in range(1, active[tool, 0] + 1):
            pair = first_of(layout.pairs + lay.N_OF_PAIR * (n_tools * active[tool, number] + tool))
            for lane in range(WIDE):
                at = pair + lane
                x, y, z = s[at + WIDE * lay.FORCE], s[at + WIDE * (lay.FORCE + 1)], s[at + WIDE * (lay.FORCE + 2)]
                touches = x * x + y * y + z * z > 0.0
                s[at + WIDE * lay.MEAN] += share * x
                s[at + WIDE * (lay.MEAN + 1)] += share * y
                s[at + WIDE * (lay.MEAN + 2)] += share * z
                for entry in range(3):
                    slip = s[at + WIDE * (lay.SINCE + entry)] + s[at + WIDE * (lay.SLIPPED + entry)]
                    s[at + WIDE * (lay.SINCE + entry)] = slip if touches else 0.0
