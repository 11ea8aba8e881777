"""Seam compliance by probing: the real sweeps answer small forces on the blocks near the seam."""

from __future__ import annotations

import numpy as np

from softseam_protocol.messages import ToolMotion
from softseam_services.body.body import Floats

from .blocks import build_blocks
from .kernels.block import new_workspace
from .kernels.crew import new_crew
from .kernels.probe import probe_seam
from .model import KAPPA, PbdModel
from .records import solve_arrays

REACH = 0.45
"""blocks further from the seam than this share of a P wave's way in a step are held still: measured, what they would
add to the compliance is below 3 %"""
LEAST_LAYERS, MOST_LAYERS = 3, 8
STRAIN = 1e-6
"""displacement that a probe aims at, in block edges"""


class SeamProbe:
    """The blocks within some layers of the seam, numbered on their own."""

    def __init__(self, model: PbdModel, dt: float) -> None:
        region = model.region
        # Damping by stiffness spreads news within the step as a longer one would: sqrt(b dt) is how far, over c_p.
        reached_in = np.sqrt(dt * (dt + model.spec.damping.stiffness))
        way = reached_in * model.body.wave_speed / float(model.blocks.edges.min())
        layers = int(np.clip(np.ceil(REACH * way), LEAST_LAYERS, MOST_LAYERS))
        all_nodes = np.concatenate([model.blocks.nodes.transpose(0, 2, 1).reshape(-1, 8)])
        octants = model.blocks.octant.ravel()
        all_nodes, octants = all_nodes[octants >= 0], octants[octants >= 0]
        reached = np.zeros(model.n_nodes, dtype=np.bool_)
        reached[region.seam] = True
        inside = np.zeros(len(all_nodes), dtype=np.bool_)
        for _ in range(layers):
            inside = reached[all_nodes].any(axis=1)
            reached[all_nodes[inside]] = True
        blocks = build_blocks(model.body, region, model.spec.hourglass, only=octants[inside])
        used = blocks.nodes < model.n_nodes
        ids = np.unique(np.concatenate([blocks.nodes[used], region.seam]))
        number = np.full(model.n_nodes + 8, -1, dtype=np.int32)
        number[ids] = np.arange(len(ids))
        number[model.n_nodes :] = len(ids) + np.arange(8)
        held = np.zeros(model.n_nodes, dtype=np.bool_)
        held[all_nodes[~inside]] = True
        held[region.seam] = False
        inverse_mass = np.where(held, 0.0, model.inverse_mass)[ids]
        self._dt = dt
        self._model, self._ids, self._blocks = model, ids, blocks
        self._nodes = number[blocks.nodes]
        self._inverse_mass = model.inverse_mass[ids]
        padded = np.concatenate([self._inverse_mass, np.zeros(8)])
        self._softness = np.ascontiguousarray(8.0 * padded[self._nodes].max(axis=1))
        self._seam = number[region.seam]
        # Points that follow nodes of the probed blocks only.
        rows = np.repeat(np.arange(model.n_points), np.diff(model.indptr))
        outside = np.zeros(model.n_points, dtype=np.bool_)
        outside[rows[number[model.node] < 0]] = True
        self._points = np.flatnonzero(~outside & model.active)
        kept = ~outside[rows] & model.active[rows]
        self._indptr = np.zeros(len(self._points) + 1, dtype=np.int32)
        np.cumsum(np.diff(model.indptr)[self._points], out=self._indptr[1:])
        self._node = number[model.node[kept]]
        self._weight = model.weight[kept]
        self._point_softness = model.point_softness[self._points]
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

    def compliance(self, x: Floats, force: Floats, motion: ToolMotion) -> Floats:
        """d(seam x at the end of a step)/d(seam force), constant over the step, about the positions x (3s, 3s) [m/N].

        The probes start from rest with the exact stress at x and without loads, so that only they move anything;
        contacts stay as they are, tools stand still. Equal to the derivative of the step up to the motion within it.
        """
        tools, blocks, dt = self._model.tools, self._blocks, self._dt
        seam_mass = self._xw[self._seam, 3]
        n_seam = len(self._seam)
        free = seam_mass[seam_mass > 0.0]
        if n_seam == 0 or len(free) == 0:
            return np.zeros((3 * n_seam, 3 * n_seam))
        probe = STRAIN * float(blocks.edges.min()) / (dt * dt * float(np.median(free)))
        result = np.zeros((3 * n_seam, 3 * n_seam))
        probe_seam(
            np.ascontiguousarray(x[self._ids]),
            self._ws,
            self._xw,
            self._nodes,
            blocks.volume,
            self._inverse_mass,
            self._softness,
            blocks.constants,
            blocks.law,
            self._indptr,
            self._node,
            self._weight,
            self._point_softness,
            np.ascontiguousarray(force[self._points]),
            tools.kind,
            tools.shape,
            tools.friction,
            motion.position,
            motion.orientation,
            self._seam,
            probe,
            self._solve,
            dt,
            self._model.substeps(dt),
            self._model.spec.sweeps,
            KAPPA,
            np.array([0, blocks.n_batches], dtype=np.int32),
            self._crew,
            result,
        )
        return result
