"""The step of `group` for a graphics card: the same lanes, in CUDA.

One thread block a group of 32 pieces; its warps share out the blocks of a colour, the nodes and the pairs, and their
threads are the pieces.
"""

import math
from typing import Any

import numba.cuda
import numpy as np
from numba import float32, int32

from softseam_services.jit.retarget import Retarget
from softseam_services.pbd.batch import layout as lay
from softseam_services.pbd.kernels import pairs
from softseam_services.pbd.kernels.block_rows import VOLUME as BLOCK_VOLUME
from softseam_services.pbd.kernels.contact import NO_MEMORY
from softseam_services.pbd.kernels.form import FORM
from softseam_services.shapes.branches import BOX

from . import lane as lanes
from .group import N_ROWS_OF_BLOCK, N_ROWS_OF_PAIR

cuda: Any = numba.cuda
LANES = 32
"""pieces of a group"""
WARPS = 16
"""of a thread block"""
MOST_TOOLS = 8
_AT = 24
"""row of the workspace from which on a block's own numbers lie"""
_ALL = 0xFFFFFFFF


def _compile(function: Any) -> Any:
    return cuda.jit(device=True, fastmath=False, inline=False)(function)


@cuda.jit(device=True)
def logarithm(x: Any) -> Any:
    """ln x."""
    return math.log(x)


_retarget = Retarget(
    np.float32, "of_card", _compile, {"LANES": 1, "EIGHT": 1, "WIDE": LANES}, {"logarithm": logarithm, "np": math}
)
begin_on_box = _retarget(lanes.begin_on_box)
box_gap_of = _retarget(lanes.box_gap_of)
counted = _retarget(lanes.counted)
finish_node = _retarget(lanes.finish_node)
largest_of_eight = _retarget(lanes.largest_of_eight)
lends = _retarget(lanes.lends)
look_at_block = _retarget(lanes.look_at_block)
plane_gap_of = _retarget(lanes.plane_gap_of)
predict_node = _retarget(lanes.predict_node)
solve_block = _retarget(lanes.solve_block)
solve_pair = _retarget(lanes.solve_pair)
spread_stress = _retarget(lanes.spread_stress)


@cuda.jit(device=True)
def _load(ws, row, s, at, count):
    for r in range(count):
        ws[row + r] = s[at + LANES * r]


@cuda.jit(device=True)
def _store(ws, row, s, at, count):
    for r in range(count):
        s[at + LANES * r] = ws[row + r]


@cuda.jit(device=True)
def _load_nodes(ws, s, nodes, block, first, start):
    for i in range(8):
        at = first + LANES * (lay.N_OF_NODE * nodes[block, i] + start)
        for c in range(3):
            ws[3 * i + c] = s[at + LANES * c]


@cuda.jit(device=True)
def _store_nodes(ws, s, nodes, block, first, start):
    for i in range(8):
        at = first + LANES * (lay.N_OF_NODE * nodes[block, i] + start)
        for c in range(3):
            s[at + LANES * c] = ws[3 * i + c]


@cuda.jit(device=True)
def _contacts(s, row, tools, first_node, first_pair, points, kind, shape, flags, near, hh, softens, warp):
    n_tools, part = len(kind), lends(hh)
    newer_box = part if near < float32(1.5) else float32(NO_MEMORY)
    if softens:
        for point in range(warp, len(points), WARPS):
            s[first_node + LANES * (lay.N_OF_NODE * points[point] + lay.HOLDS)] = float32(0.0)
        cuda.syncthreads()
    for tool in range(n_tools):
        a, b, c = shape[tool, 0], shape[tool, 1], shape[tool, 2]
        _load(row, lanes.TOOL, s, tools + LANES * lay.N_OF_TOOL * tool, lay.N_OF_TOOL)
        for point in range(warp, len(points), WARPS):
            if flags[tool, point] == 0:
                continue
            node = first_node + LANES * lay.N_OF_NODE * points[point]
            pair = first_pair + LANES * lay.N_OF_PAIR * (n_tools * point + tool)
            _load(row, 0, s, node + LANES * lay.X, 4)
            _load(row, pairs.BEFORE, s, node + LANES * lay.OLD, 3)
            _load(row, pairs.FORCE, s, pair + LANES * lay.FORCE, 3)
            _load(row, pairs.STEADY, s, pair + LANES * lay.STEADY, 2)
            _load(row, pairs.FRICTION, s, pair + LANES * lay.FRICTION, 3)  # and compliance
            if kind[tool] == BOX:
                _load(row, pairs.FACED, s, pair + LANES * lay.FACED, 3)
                solve_pair(row, 0, box_gap_of(row, 0, a, b, c), hh, newer_box)
            else:
                solve_pair(row, 0, plane_gap_of(row, 0, a, b, c), hh, part)
            _store(row, 0, s, node + LANES * lay.X, 3)
            _store(row, pairs.FORCE, s, pair + LANES * lay.FORCE, 3)
            _store(row, pairs.STEADY, s, pair + LANES * lay.STEADY, 2)
            _store(row, pairs.SLIPPED, s, pair + LANES * lay.SLIPPED, 3)
            if softens:
                holds = s[node + LANES * lay.HOLDS] + row[pairs.HOLD]
                s[node + LANES * lay.HOLDS] = holds
                s[node + LANES * lay.SOFT] = counted(holds, row[3])
        cuda.syncthreads()


@cuda.jit(launch_bounds=LANES * WARPS)
def advance(
    state,
    layout,
    nodes,
    colours,
    n,
    points,
    kind,
    shape,
    gravity,
    kappa,
    keep,
    h,
    n_substeps,
    dt,
    share,
    margin,
    flags_of,
):
    """`group.advance_groups` of all groups: state (groups * rows * LANES,); colours (c + 1,) where their blocks begin;
    flags_of (groups, t, p) room."""
    group, lane, warp = cuda.blockIdx.x, cuda.threadIdx.x % LANES, cuda.threadIdx.x // LANES
    s, flags = state, flags_of[group]
    tools, at_nodes, at_blocks, at_pairs, at_out, rows = layout
    base = group * rows * LANES + lane
    first_node, first_block, first_pair = base + LANES * at_nodes, base + LANES * at_blocks, base + LANES * at_pairs
    tools, out = base + LANES * tools, base + LANES * at_out
    n_tools = len(kind)
    ws = cuda.local.array(N_ROWS_OF_BLOCK, float32)
    row = cuda.local.array(N_ROWS_OF_PAIR, float32)
    most = cuda.shared.array((WARPS, LANES), float32)
    met = cuda.shared.array((MOST_TOOLS, LANES), int32)
    zero, one = float32(0.0), float32(1.0)
    hh, per_h = h * h, one / h
    push = gravity[0], gravity[1], gravity[2]
    _load(ws, FORM, s, base + LANES * lay.CONSTANTS, 30)
    ws[BLOCK_VOLUME] = s[base + LANES * lay.VOLUME]
    row[pairs.ALLOWED] = zero
    # accelerations by what the blocks' stress and the contacts' forces are
    fastest = zero
    for i in range(warp, n, WARPS):
        node = first_node + LANES * lay.N_OF_NODE * i
        square = zero
        for c in range(3):
            s[node + LANES * (lay.A + c)] = zero
            v = s[node + LANES * (lay.V + c)]
            square += v * v
        fastest = max(fastest, square)
        s[node + LANES * lay.SOFT] = float32(8.0) * s[node + LANES * lay.W]
    most[warp, lane] = fastest
    if warp < n_tools:
        met[warp, lane] = 0
    cuda.syncthreads()
    for colour in range(len(colours) - 1):
        for block in range(colours[colour] + warp, colours[colour + 1], WARPS):
            _load(ws, _AT, s, first_block + LANES * lay.N_OF_BLOCK * block, lay.N_OF_BLOCK)
            _load_nodes(ws, s, nodes, block, first_node, lay.A)
            spread_stress(ws, 0, ws, _AT)
            _store_nodes(ws, s, nodes, block, first_node, lay.A)
        cuda.syncthreads()
    for point in range(warp, len(points), WARPS):
        node = first_node + LANES * lay.N_OF_NODE * points[point]
        for tool in range(n_tools):
            pair = first_pair + LANES * lay.N_OF_PAIR * (n_tools * point + tool)
            for c in range(3):
                s[node + LANES * (lay.A + c)] += s[pair + LANES * (lay.FORCE + c)]
    cuda.syncthreads()
    for i in range(warp, n, WARPS):
        node = first_node + LANES * lay.N_OF_NODE * i
        for c in range(3):
            s[node + LANES * (lay.A + c)] *= s[node + LANES * lay.W]
    # pairs that may touch
    quickest = zero
    for tool in range(n_tools):
        square = zero
        for c in range(3):
            way = s[tools + LANES * (lay.N_OF_TOOL * tool + lay.WAY + c)]
            square += way * way
        quickest = max(quickest, square)
    for other in range(WARPS):
        fastest = max(fastest, most[other, lane])
    reach = margin + float32(2.0) * dt * (math.sqrt(fastest) + per_h * math.sqrt(quickest))
    for tool in range(n_tools):
        a, b, c = shape[tool, 0], shape[tool, 1], shape[tool, 2]
        _load(row, lanes.TOOL, s, tools + LANES * lay.N_OF_TOOL * tool, lay.N_OF_TOOL)
        for point in range(warp, len(points), WARPS):
            node = first_node + LANES * lay.N_OF_NODE * points[point]
            pair = first_pair + LANES * lay.N_OF_PAIR * (n_tools * point + tool)
            _load(row, 0, s, node + LANES * lay.X, 4)
            row[pairs.FACED], row[pairs.FACED + 1], row[pairs.FACED + 2] = zero, zero, zero
            if kind[tool] == BOX:
                gap = box_gap_of(row, 0, a, b, c)[0]
            else:
                gap = plane_gap_of(row, 0, a, b, c)[0]
            x, y = s[pair + LANES * lay.FORCE], s[pair + LANES * (lay.FORCE + 1)]
            z = s[pair + LANES * (lay.FORCE + 2)]
            meets = gap < reach or x * x + y * y + z * z > zero
            give = hh * row[3] if meets else zero
            s[pair + LANES * lay.GIVE] = give
            s[pair + LANES * (lay.GIVE + 1)] = one / give if give > zero else zero
            if meets:
                met[tool, lane] = 1
            else:
                s[pair + LANES * lay.STEADY] = zero
                s[pair + LANES * (lay.STEADY + 1)] = zero
            for entry in range(3):
                s[pair + LANES * (lay.MEAN + entry)] = zero
            some = cuda.any_sync(_ALL, meets)
            if lane == 0:
                flags[tool, point] = 1 if some else 0
    cuda.syncthreads()
    near = zero
    for tool in range(n_tools):
        near += float32(met[tool, lane])
    if warp == 0:
        s[base + LANES * lay.NEAR] = near
    for _ in range(n_substeps):
        for tool in range(n_tools):
            if kind[tool] == BOX:
                a, b, c = shape[tool, 0], shape[tool, 1], shape[tool, 2]
                _load(row, lanes.TOOL, s, tools + LANES * lay.N_OF_TOOL * tool, lay.N_OF_TOOL)
                for point in range(warp, len(points), WARPS):
                    if flags[tool, point] == 0:
                        continue
                    pair = first_pair + LANES * lay.N_OF_PAIR * (n_tools * point + tool)
                    _load(row, pairs.BEFORE, s, first_node + LANES * (lay.N_OF_NODE * points[point] + lay.X), 3)
                    _load(row, pairs.FORCE, s, pair + LANES * lay.FORCE, 3)
                    begin_on_box(row, 0, a, b, c)
                    _store(row, pairs.FACED, s, pair + LANES * lay.FACED, 3)
        cuda.syncthreads()
        if warp < n_tools:
            at = tools + LANES * lay.N_OF_TOOL * warp
            for c in range(3):
                s[at + LANES * (lay.POSITION + c)] += s[at + LANES * (lay.WAY + c)]
        for i in range(warp, n, WARPS):
            predict_node(s, first_node + LANES * lay.N_OF_NODE * i, push, keep, h)
        cuda.syncthreads()
        _contacts(s, row, tools, first_node, first_pair, points, kind, shape, flags, near, hh, True, warp)
        for colour in range(len(colours) - 1):
            for block in range(colours[colour] + warp, colours[colour + 1], WARPS):
                at = first_block + LANES * lay.N_OF_BLOCK * block
                for i in range(8):
                    ws[i] = s[first_node + LANES * (lay.N_OF_NODE * nodes[block, i] + lay.SOFT)]
                softness = largest_of_eight(ws, 0)
                _load(ws, _AT, s, at, lay.N_OF_BLOCK - 1)
                ws[_AT + lay.SOFTNESS] = softness
                _load_nodes(ws, s, nodes, block, first_node, lay.X)
                solve_block(ws, 0, ws, _AT, kappa, hh)
                _store(ws, _AT, s, at, 21)
                _store_nodes(ws, s, nodes, block, first_node, lay.X)
            cuda.syncthreads()
        _contacts(s, row, tools, first_node, first_pair, points, kind, shape, flags, near, hh, False, warp)
        for i in range(warp, n, WARPS):
            finish_node(s, first_node + LANES * lay.N_OF_NODE * i, per_h)
        for tool in range(n_tools):
            for point in range(warp, len(points), WARPS):
                if flags[tool, point] == 0:
                    continue
                pair = first_pair + LANES * lay.N_OF_PAIR * (n_tools * point + tool)
                x, y = s[pair + LANES * lay.FORCE], s[pair + LANES * (lay.FORCE + 1)]
                z = s[pair + LANES * (lay.FORCE + 2)]
                touches = x * x + y * y + z * z > zero
                s[pair + LANES * lay.MEAN] += share * x
                s[pair + LANES * (lay.MEAN + 1)] += share * y
                s[pair + LANES * (lay.MEAN + 2)] += share * z
                for entry in range(3):
                    slip = s[pair + LANES * (lay.SINCE + entry)] + s[pair + LANES * (lay.SLIPPED + entry)]
                    s[pair + LANES * (lay.SINCE + entry)] = slip if touches else zero
        cuda.syncthreads()
    # what comes out: by one warp, in one order
    stress, energy, least = zero, zero, float32(9.0)
    for block in range(warp, len(nodes), WARPS):
        _load_nodes(ws, s, nodes, block, first_node, lay.X)
        square, of_block, J = look_at_block(ws, 0)
        stress, energy, least = max(stress, square), energy + of_block, min(least, J)
    most[warp, lane] = stress
    cuda.syncthreads()
    for other in range(WARPS):
        stress = max(stress, most[other, lane])
    cuda.syncthreads()
    most[warp, lane] = least
    cuda.syncthreads()
    for other in range(WARPS):
        least = min(least, most[other, lane])
    cuda.syncthreads()
    most[warp, lane] = energy
    cuda.syncthreads()
    if warp > 0:
        return
    energy = zero
    for other in range(WARPS):
        energy += most[other, lane]
    total, mx, my, mz = zero, zero, zero, zero
    for i in range(n):
        node = first_node + LANES * lay.N_OF_NODE * i
        w = s[node + LANES * lay.W]
        mass = one / w if w > zero else zero
        total += mass
        mx += mass * s[node]
        my += mass * s[node + LANES]
        mz += mass * s[node + LANES * 2]
    s[out + LANES * lay.MIDDLE] = mx / total
    s[out + LANES * (lay.MIDDLE + 1)] = my / total
    s[out + LANES * (lay.MIDDLE + 2)] = mz / total
    s[out + LANES * lay.STRESS2], s[out + LANES * lay.STRAIN], s[out + LANES * lay.LEAST_J] = stress, energy, least
    farthest = zero
    for tool in range(n_tools):
        fx, fy, fz, count = zero, zero, zero, zero
        for point in range(len(points)):
            if flags[tool, point] == 0:
                continue
            pair = first_pair + LANES * lay.N_OF_PAIR * (n_tools * point + tool)
            x, y, z = s[pair + LANES * lay.MEAN], s[pair + LANES * (lay.MEAN + 1)], s[pair + LANES * (lay.MEAN + 2)]
            fx, fy, fz = fx - x, fy - y, fz - z
            count += one if x * x + y * y + z * z > zero else zero
            if kind[tool] == BOX:
                x, y, z = (
                    s[pair + LANES * lay.SINCE],
                    s[pair + LANES * (lay.SINCE + 1)],
                    s[pair + LANES * (lay.SINCE + 2)],
                )
                farthest = max(farthest, x * x + y * y + z * z)
        of_tool = out + LANES * (lay.N_OUT + lay.N_OUT_OF_TOOL * tool)
        s[of_tool], s[of_tool + LANES], s[of_tool + 2 * LANES], s[of_tool + 3 * LANES] = fx, fy, fz, count
    s[out + LANES * lay.SLIP] = farthest
