"""Seam compliance by probing: the real sweeps answer small forces on the blocks near the seam.

Blocks further away are left out. Nodes at which the probed ones meet them carry their mass, so that a region without
clamps takes up all the momentum that it is given; where some are clamped, these nodes are held still.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.facts import cores
from softseam_services.body.body import Floats, Ints
from softseam_services.jit import record

from .kernels.begin import find_patches
from .kernels.block import new_workspace
from .kernels.probe import probe_seam
from .kernels.thread_team import new_team
from .model import PbdModel
from .parameters import PbdParameters, block_softness
from .records import PbdState, Scratch, new_inputs, new_scratch, new_state
from .two_threads import share_out

Ways = NDArray[np.float64]

REACH = 0.45
"""blocks further from the seam than this share of a P wave's way in a step are left out: measured, what they would
add to the compliance is below 3 %"""
LEAST_LAYERS, MOST_LAYERS = 3, 8
STRAIN = 1e-6
"""displacement that a probe aims at, in block edges"""
WORTH_TWO = 40_000
"""columns times blocks times substeps of a probe from which on a second thread shares it"""
MOST_WAYS = 4_000_000
"""numbers that are kept of what a probe found, so that steps can be settled by it; beyond that none are"""


def no_ways() -> Ways:
    """Of nothing."""
    return np.zeros((0, 2, 0, 3))


@record
class Probing(NamedTuple):
    """What `kernels.probe` needs beside a step's: e nodes at which what lies beyond begins, s nodes of the seam."""

    edge: Ints
    """(e,)"""
    share_of_edge: Floats
    """of its mass (e,)"""
    parts: Ints
    team: NDArray[np.int64]
    """alone"""
    columns: Ints
    """first of those that are probed, and the first that is not (2,)"""
    compliance: Floats
    """(3s, 3s) [m/N]"""
    ways: Ways
    """(3s, 2, k + 1, 3) [m/N, m/s/N]"""


class _Bench(NamedTuple):
    """What one thread probes some of the columns with."""

    start: PbdState
    work: PbdState
    scratch: Scratch
    probing: Probing
    ws: Floats


class SeamProbe:
    """The blocks within some layers of the seam, numbered on their own, with the numbers that they have."""

    def __init__(self, model: PbdModel, parameters: PbdParameters, dt: float) -> None:
        # Damping by stiffness spreads news within the step as a longer one would: sqrt(b dt) is how far, over c_p.
        reached_in = np.sqrt(dt * (dt + parameters.spec.damping.stiffness))
        way = reached_in * parameters.wave_speed / float(parameters.blocks.edges.min())
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
        blocks = model.blocks.only(octants[inside])
        numbers = parameters.blocks.only(model.blocks, blocks)
        self._blocks = blocks
        used = blocks.nodes < model.n_nodes
        ids = np.unique(np.concatenate([blocks.nodes[used], model.seam]))
        number = np.full(model.n_nodes + 8, -1, dtype=np.int32)
        number[ids] = np.arange(len(ids))
        number[model.n_nodes :] = len(ids) + np.arange(8)
        held = np.zeros(model.n_nodes, dtype=np.bool_)
        held[all_nodes[~inside]] = True
        held[model.seam] = False
        outside = ~model.levels.hangs
        outside[ids] = False
        left_out, edge = np.flatnonzero(outside), np.flatnonzero(held & ~outside)
        of_all = parameters.arrays
        clamped = bool((of_all.inverse_mass[np.concatenate([left_out, edge])] == 0.0).any())
        self.ids = ids.astype(np.int32)
        """nodes that are probed (k,)"""
        self.beyond = left_out[: 0 if clamped else len(left_out)].astype(np.int32)
        """free nodes that are not, and go along with the nodes at which they begin"""
        mass = of_all.mass[edge]
        lighter = 0.0 if clamped else mass.sum() / (mass.sum() + of_all.mass[left_out].sum()) if len(edge) else 1.0
        inverse_mass = np.where(held, lighter * of_all.inverse_mass, of_all.inverse_mass)[ids]
        self.dt = dt
        """the step that the probe was built for [s]"""
        self.n_blocks = len(blocks.ids)
        # Points that follow nodes of the probed blocks only.
        rows = np.repeat(np.arange(model.n_points), np.diff(model.indptr))
        astray = np.zeros(model.n_points, dtype=np.bool_)
        astray[rows[number[model.node] < 0]] = True
        self._used = np.flatnonzero(~astray & model.touches.any(axis=1))
        kept = np.isin(rows, self._used)
        indptr = np.zeros(len(self._used) + 1, dtype=np.int32)
        np.cumsum(np.diff(model.indptr)[self._used], out=indptr[1:])
        nodes = number[blocks.nodes]
        self._model, self._parameters = model, parameters
        self._arrays = model.arrays._replace(
            blocks=nodes,
            n_surface=int(np.count_nonzero(self._used < model.n_surface)),
            seam=number[model.seam],
            indptr=indptr,
            node=number[model.node[kept]],
            touches=model.touches[self._used],
            visits=np.argsort(np.argsort(model.visits)[self._used]).astype(np.int32),
        )
        own = of_all.inverse_mass[ids]
        self._numbers = of_all._replace(
            mass=of_all.mass[ids],
            inverse_mass=own,
            x_rest=of_all.x_rest[ids],
            volume=numbers.volume,
            softness=block_softness(nodes, own),
            constants=numbers.constants,
            weight=of_all.weight[kept],
            tilt=of_all.tilt[kept],
            point_softness=of_all.point_softness[self._used],
            point_give=of_all.point_give[self._used],
            point_lag=of_all.point_lag[self._used],
            friction_factor=of_all.friction_factor[self._used],
            tolerance=0.0,
        )
        n, p, t, b = len(ids), len(self._used), model.n_tools, blocks.n_batches
        self._patch = np.zeros((model.n_points, 2, 3))
        self._inputs = new_inputs(t, len(model.seam))
        self._seam_mass = inverse_mass[self._arrays.seam]
        beyond = edge[: len(edge) if not clamped else 0]
        columns = 3 * len(model.seam)
        self.keeps_ways = 6 * columns * (n + 1) <= MOST_WAYS
        """whether what every node does is small enough to be kept"""
        self._compliance = np.zeros((columns, columns))
        self._ways = np.zeros((columns, 2, n + 1, 3)) if self.keeps_ways else no_ways()
        long = columns * len(blocks.ids) * parameters.substeps(dt) >= WORTH_TWO
        middle = columns // 2 if long and cores() > 1 else columns
        self._benches = []
        for ends in ((0, middle), (middle, columns)) if middle < columns else ((0, columns),):
            scratch = new_scratch(self._arrays, self._numbers, numbers.padding_x, 0)
            scratch.xw[:n, 3] = inverse_mass
            probing = Probing(
                edge=number[beyond],
                share_of_edge=mass[: len(beyond)] / max(mass.sum(), 1e-300),
                parts=np.array([0, b], dtype=np.int32),
                team=new_team(alone=True),
                columns=np.array(ends, dtype=np.int32),
                compliance=self._compliance,
                ways=self._ways,
            )
            start, work = new_state(n, b, p, t), new_state(n, b, p, t)
            self._benches.append(_Bench(start, work, scratch, probing, new_workspace()))

    def compliance(
        self, x: Floats, force: Floats, lean: Floats, position: Floats, orientation: Floats, ramp: bool = False
    ) -> tuple[Floats, Ways]:
        """d(seam x at the end of a step)/d(seam force), constant over the step, about the positions x (3s, 3s) [m/N].

        ramp: d(seam v)/d(seam force at the end), the force being linear in time, instead [m/(N s)].

        The probes start from rest with the exact stress at x and without loads, so that only they move anything;
        contacts stay as they are, but that what friction holds at its bound slides, and tools stand still. Equal to
        the derivative of the step up to the motion within it.
        What blocks remember is that which `BlockParameters.hold` was given, and stays.
        Also d(x, v)/d(force) of every probed node, and last of `beyond` (3m, 2, k + 1, 3), where `keeps_ways`: forces
        on the nodes m that the seam follows, which are the seam's own where none of them hangs. The next probe
        overwrites them.
        """
        parameters, inputs = self._parameters, self._inputs
        edge = float(parameters.blocks.edges.min())
        n_seam, free = len(self._seam_mass), self._seam_mass[self._seam_mass > 0.0]
        if len(free) == 0:
            return np.zeros((3 * n_seam, 3 * n_seam)), self._ways
        inputs.position[:], inputs.orientation[:] = position, orientation
        find_patches(self._model.arrays, parameters.arrays, x, self._patch)
        if parameters.blocks.n_state:
            own = parameters.blocks.only(self._model.blocks, self._blocks).constants
            self._numbers.constants.table[:] = own.table
            self._numbers.constants.fold[:] = own.fold
        for bench in self._benches:
            np.take(self._patch, self._used, axis=0, out=bench.scratch.contacts.patch)
            np.take(x, self.ids, axis=0, out=bench.start.x)
            np.take(force, self._used, axis=0, out=bench.start.force)
            np.take(lean, self._used, axis=0, out=bench.start.lean)

        def probe(place: int) -> None:
            bench = self._benches[place]
            probe_seam(
                *(self._arrays, self._numbers, bench.start, bench.work, inputs, bench.scratch, bench.probing),
                *(self.dt, parameters.substeps(self.dt), parameters.spec.sweeps, ramp),
                *(STRAIN * edge / (self.dt * self.dt * float(np.median(free))), bench.ws),
            )

        if len(self._benches) > 1:
            share_out(probe)
        else:
            probe(0)
        result, ways = self._compliance.copy(), self._ways
        weight = self._model.seam_weight
        if weight is not None:
            # What a node of the region's seam feels and shows goes by the nodes that it follows: H = W H_m W^T.
            by_node = result.reshape(n_seam, 3, n_seam, 3)
            size = 3 * len(weight)
            result = np.einsum("sm,manb,tn->satb", weight, by_node, weight, optimize=True).reshape(size, size)
        return result, ways
