"""Blocks of four alike bodies of a pile side by side, where each body fills one lane of its own batches only.

A body of one cell has one block of each colour, in a batch with three empty ones. Bodies with the same structure and
constants lie in the same places of the same batches: so four of them are swept at one go, each in a lane of its own,
with the same bits. What the sweeps need lies here while a step lasts; a state is each body's own.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints
from softseam_services.jit import njit, record

from .block_rows import N_STRESS
from .lanes import LANES
from .sweep import sweep


@record
class Fours(NamedTuple):
    """Of b bodies of a pile, in at most f fours of a group, with at most m batches each."""

    kind: Ints
    """alike bodies have the same (b,); -1 where a body fills its lanes, or has none alike"""
    n_kinds: int
    bodies: NDArray[np.int64]
    """of each four, -1 in lanes that are empty (f, LANES)"""
    nodes: Ints
    """rows of the pile's xw (f, m, 8, LANES)"""
    volume: Floats
    """[m^3] (f, m, LANES)"""
    softness: Floats
    """see `records.Scratch` [1/kg] (f, m, LANES)"""
    stress: Floats
    """see `records.PbdState` (f, m, N_STRESS)"""


@njit(cache=True, error_model="numpy")
def form_fours(members, row, fours, bodies, padding, alone):
    """Put the bodies of a group into fours, with their stress; returns how many there are, and how many bodies are in
    none, which are the first of alone (b,).

    row      first row of each body in the pile's xw
    padding  the first of eight rows there that never move
    """
    n, n_alone = 0, 0
    for body in bodies:
        if fours.kind[body] < 0:
            alone[n_alone] = body
            n_alone += 1
    for kind in range(fours.n_kinds):
        lane = LANES
        for body in bodies:
            if fours.kind[body] != kind:
                continue
            if lane == LANES:
                fours.bodies[n, :] = -1
                lane, n = 0, n + 1
            fours.bodies[n - 1, lane] = body
            lane += 1
    for four in range(n):
        for batch in range(len(members[fours.bodies[four, 0]].model.blocks)):
            for lane in range(LANES):
                body = fours.bodies[four, lane]
                if body < 0:
                    for node in range(8):
                        fours.nodes[four, batch, node, lane] = padding + node
                    fours.volume[four, batch, lane] = fours.softness[four, batch, lane] = 0.0
                    for entry in range(lane, N_STRESS, LANES):
                        fours.stress[four, batch, entry] = 0.0
                    continue
                one = members[body]
                for node in range(8):
                    fours.nodes[four, batch, node, lane] = row[body] + one.model.blocks[batch, node, 0]
                fours.volume[four, batch, lane] = one.parameters.volume[batch, 0]
                for entry in range(0, N_STRESS, LANES):
                    fours.stress[four, batch, entry + lane] = one.after.stress[batch, entry]
    return n, n_alone


@njit(cache=True, error_model="numpy")
def soften_lane(one, fours, four, lane):
    """The softness of a body's blocks, as tools hold its nodes now, into its lane."""
    for batch in range(len(one.model.blocks)):
        fours.softness[four, batch, lane] = one.scratch.softness[batch, 0]


@njit(cache=True, error_model="numpy")
def sweep_four(first, fours, four, xw, h, ws):
    """Sweep the blocks of a four once, of which this is the first body."""
    sweep(
        *(ws, xw, fours.nodes[four], fours.volume[four], fours.softness[four], fours.stress[four]),
        *(first.parameters.constants, first.parameters.law, first.parameters.kappa, h, 0, len(first.model.blocks)),
    )


@njit(cache=True, error_model="numpy")
def end_fours(members, fours, n):
    """Give the bodies of n fours their stress back."""
    for four in range(n):
        for lane in range(LANES):
            body = fours.bodies[four, lane]
            if body < 0:
                break
            stress = members[body].after.stress
            for batch in range(len(stress)):
                for entry in range(0, N_STRESS, LANES):
                    stress[batch, entry] = fours.stress[four, batch, entry + lane]
