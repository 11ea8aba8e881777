"""Seam compliance by probing: the real sweeps answer small forces on the blocks near the seam.

Blocks further away are left out. Nodes at which the probed ones meet them carry their mass, so that a region without
clamps takes up all the momentum that it is given; where some are clamped, these nodes are held still.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats

from .blocks import build_blocks, make_viscous
from .kernels.block import new_workspace
from .kernels.crew import new_crew
from .kernels.probe import probe_seam
from .model import KAPPA, PbdModel
from .records import PointArrays, block_arrays, new_contacts, solve_arrays, tool_arrays

Ways = NDArray[np.float64]

REACH = 0.45
"""blocks further from the seam than this share of a P wave's way in a step are left out: measured, what they would
add to the compliance is below 3 %"""
LEAST_LAYERS, MOST_LAYERS = 3, 8
STRAIN = 1e-6
"""displacement that a probe aims at, in block edges"""
MOST_WAYS = 4_000_000
"""numbers that are kept of what a probe found, so that steps can be settled by it; beyond that none are"""


def no_ways() -> Ways:
    """Of nothing."""
    return np.zeros((0, 2, 0, 3))


class SeamProbe:
    """The blocks within some layers of the seam, numbered on their own."""

    def __init__(self, model: PbdModel, dt: float) -> None:
        region, levels = model.region, model.levels
        # Damping by stiffness spreads news within the step as a longer one would: sqrt(b dt) is how far, over c_p.
        reached_in = np.sqrt(dt * (dt + model.spec.damping.stiffness))
        way = reached_in * model.body.wave_speed / float(model.blocks.edges.min())
        layers = int(np.clip(np.ceil(REACH * way), LEAST_LAYERS, MOST_LAYERS))
        all_nodes = np.concatenate([model.blocks.nodes.transpose(0, 2, 1).reshape(-1, 8)])
        octants = model.blocks.octant.ravel()
        all_nodes, octants = all_nodes[octants >= 0], octants[octants >= 0]
        reached = np.zeros(model.n_nodes, dtype=np.bool_)
        reached[model.seam] = True
        inside = np.zeros(len(all_nodes), dtype=np.bool_)
        for _ in range(layers):
            inside = reached[all_nodes].any(axis=1)
            reached[all_nodes[inside]] = True
        blocks = build_blocks(model.body, region, model.spec.hourglass, levels, octants[inside])
        make_viscous(blocks, model.viscous_times)
        used = blocks.nodes < model.n_nodes
        ids = np.unique(np.concatenate([blocks.nodes[used], model.seam]))
        number = np.full(model.n_nodes + 8, -1, dtype=np.int32)
        number[ids] = np.arange(len(ids))
        number[model.n_nodes :] = len(ids) + np.arange(8)
        held = np.zeros(model.n_nodes, dtype=np.bool_)
        held[all_nodes[~inside]] = True
        held[model.seam] = False
        outside = ~levels.hangs
        outside[ids] = False
        left_out, edge = np.flatnonzero(outside), np.flatnonzero(held & ~outside)
        clamped = bool((model.inverse_mass[np.concatenate([left_out, edge])] == 0.0).any())
        self.ids = ids.astype(np.int32)
        """nodes that are probed (k,)"""
        self.beyond = left_out[: 0 if clamped else len(left_out)].astype(np.int32)
        """free nodes that are not, and go along with the nodes at which they begin"""
        mass = model.mass[edge]
        lighter = 0.0 if clamped else mass.sum() / (mass.sum() + model.mass[left_out].sum()) if len(edge) else 1.0
        inverse_mass = np.where(held, lighter * model.inverse_mass, model.inverse_mass)[ids]
        self._edge = number[edge[: 0 if clamped else len(edge)]]
        self._share_of_edge = mass[: len(self._edge)] / max(mass.sum(), 1e-300)
        self._dt = dt
        self._model, self._blocks = model, blocks
        nodes = number[blocks.nodes]
        padded = np.concatenate([model.inverse_mass[ids], np.zeros(8)])
        self._arrays = block_arrays(blocks, nodes, np.ascontiguousarray(8.0 * padded[nodes].max(axis=1)))
        self._seam = number[model.seam]
        # Points that follow nodes of the probed blocks only.
        rows = np.repeat(np.arange(model.n_points), np.diff(model.indptr))
        astray = np.zeros(model.n_points, dtype=np.bool_)
        astray[rows[number[model.node] < 0]] = True
        self._used = np.flatnonzero(~astray & model.active)
        kept = ~astray[rows] & model.active[rows]
        indptr = np.zeros(len(self._used) + 1, dtype=np.int32)
        np.cumsum(np.diff(model.indptr)[self._used], out=indptr[1:])
        self._points = PointArrays(
            indptr=indptr,
            node=number[model.node[kept]],
            weight=model.weight[kept],
            softness=model.point_softness[self._used],
            active=np.ones(len(self._used), dtype=np.bool_),
            inverse_mass=model.inverse_mass[ids],
            side=np.full((len(self._used), model.n_tools), -1, dtype=np.int32),
            soft=np.zeros((len(self._used), model.n_tools)),
        )
        self._tools = tool_arrays(model.tools)
        self._contacts = new_contacts(len(ids), blocks.n_batches, len(self._used), model.n_tools)
        n = len(ids)
        self._xw = np.zeros((n + 8, 4))
        self._xw[:n, 3] = inverse_mass
        self._xw[n:, :3] = blocks.padding_x
        self._ws = new_workspace()
        self._crew = new_crew(alone=True)
        self._solve = solve_arrays(model, blocks, 0, 0.0)

    @property
    def dt(self) -> float:
        """The step that the probe was built for [s]."""
        return self._dt

    @property
    def n_blocks(self) -> int:
        return int((self._blocks.octant >= 0).sum())

    @property
    def keeps_ways(self) -> bool:
        """Whether what every node does is small enough to be kept."""
        return 18 * len(self._seam) * (len(self.ids) + 1) <= MOST_WAYS

    def compliance(
        self, x: Floats, force: Floats, position: Floats, orientation: Floats, ramp: bool = False
    ) -> tuple[Floats, Ways]:
        """d(seam x at the end of a step)/d(seam force), constant over the step, about the positions x (3s, 3s) [m/N].

        ramp: d(seam v)/d(seam force at the end), the force being linear in time, instead [m/(N s)].

        The probes start from rest with the exact stress at x and without loads, so that only they move anything;
        contacts stay as they are, tools stand still. Equal to the derivative of the step up to the motion within it.
        Also d(x, v)/d(force) of every probed node, and last of `beyond` (3m, 2, k + 1, 3), where `keeps_ways`: forces
        on the nodes m that the seam follows, which are the seam's own where none of them hangs.
        """
        blocks, dt = self._blocks, self._dt
        self._model.find_shares(x, position, orientation)
        np.take(self._model.edges.side, self._used, axis=0, out=self._points.side)
        np.take(self._model.edges.give, self._used, axis=0, out=self._points.soft)
        seam_mass = self._xw[self._seam, 3]
        n_seam = len(self._seam)
        result = np.zeros((3 * n_seam, 3 * n_seam))
        ways = no_ways()
        if self.keeps_ways:
            ways = np.zeros((3 * n_seam, 2, len(self.ids) + 1, 3))
        free = seam_mass[seam_mass > 0.0]
        if n_seam == 0 or len(free) == 0:
            return result, ways
        probe = STRAIN * float(blocks.edges.min()) / (dt * dt * float(np.median(free)))
        probe_seam(
            *(np.ascontiguousarray(x[self.ids]), np.ascontiguousarray(force[self._used])),
            *(self._arrays, self._points, self._tools, self._contacts, self._solve, self._xw),
            *(position, orientation, self._seam, probe),
            *(dt, self._model.substeps(dt), self._model.spec.sweeps, KAPPA, ramp),
            *(np.array([0, blocks.n_batches], dtype=np.int32), self._crew, self._ws),
            *(self._edge, self._share_of_edge, result, ways),
        )
        weight = self._model.seam_weight
        if weight is not None:
            # What a node of the region's seam feels and shows goes by the nodes that it follows: H = W H_m W^T.
            by_node = result.reshape(n_seam, 3, n_seam, 3)
            size = 3 * len(weight)
            result = np.einsum("sm,manb,tn->satb", weight, by_node, weight, optimize=True).reshape(size, size)
        return result, ways
