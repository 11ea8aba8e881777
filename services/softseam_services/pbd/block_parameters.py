"""The numbers of a region's blocks: volumes and constants, laid out as the blocks' structure is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from softseam_services.body.body import Body, Floats, Region
from softseam_services.body.materials.point import NEO_HOOKEAN

from .blocks import Blocks
from .forms import SIGNS, build_forms
from .hourglass import block_constants
from .kernels import block_rows
from .kernels.block import Constants, new_workspace
from .kernels.block_rows import MU, N_FOLD, OF_BENDING, OF_STRAIN, G
from .kernels.form import N_FORM
from .kernels.lanes import LANES
from .kernels.memory import LENGTH, LOST, MEMORY, SMALL
from .kernels.renew import renew

VERY_FLAT, MOSTLY = 5.0, 5.0
"""longest edge over the shortest, and a damping time in longest undamped substeps (decision 24)"""


@dataclass(frozen=True)
class BlockParameters:
    """Of n_batches * 4 padded blocks, see `Blocks`."""

    volume: Floats
    """fill times volume, 0 for padding (n_batches, 4 lanes) [m^3]"""
    edges: Floats
    """of boxes, else the shortest of all (3,) [m]"""
    constants: Constants
    padding: Floats
    """constants of an empty block; those of boxes are their material's (0,)"""
    padding_x: Floats
    """rest positions of the padding's nodes (8, 3) [m]"""
    law: int
    """number of the materials' kind in `body.materials.point`; of a material with state the address of its `respond`"""
    small: bool
    """whether that law knows small strains only"""
    branches: int = 0
    """that relax or yield, of the material with most"""
    yields: bool = False
    """whether one of these has a slider"""

    @property
    def n_state(self) -> int:
        """Numbers that each block remembers."""
        if self.branches:
            return (OF_STRAIN + OF_BENDING) * (1 + self.branches) + self.yields + 1
        return max(0, self.constants.table.shape[1] - MEMORY) if self.constants.table.ndim > 2 else 0

    @property
    def dissipated(self) -> float:
        """By the material since `hold` [J]."""
        if self.branches:
            return float(np.vdot(self.volume, self.constants.fold[:, block_rows.LOST - block_rows.FOLD]))
        return float(self.constants.table[:, LOST].sum()) if self.n_state else 0.0

    def hold(self, memory: Floats, length: float = 0.0) -> None:
        """Have kernels see what the blocks remember (b, n, LANES) as a step of this length begins [s]; 0 to look.

        Of blocks that relax, what folds it does for the middle of that step, and kernels of a step renew it.
        """
        if self.branches:
            nodes, xw = np.zeros((len(memory), 8, LANES), dtype=np.int32), np.zeros((0, 4))
            renew(new_workspace(), xw, nodes, self.constants, memory, 0.0, 0.0, 0.5 * length, 0, len(memory))
        elif self.n_state:
            table = self.constants.table
            table[:, MEMORY:], table[:, LENGTH], table[:, LOST] = memory, length, 0.0

    def memory(self, memory: Floats) -> None:
        """What they remember now, into memory (b, n, LANES); of blocks that relax it is there."""
        if self.n_state and not self.branches:
            memory[:] = self.constants.table[:, MEMORY:]

    def only(self, whole: Blocks, part: Blocks) -> BlockParameters:
        """Of some blocks, `part`, of those that this describes, `whole`."""
        place = np.empty(len(whole.ids), dtype=np.int64)
        real = whole.order >= 0
        place[whole.order[real]] = np.flatnonzero(real)
        lane = np.where(part.order >= 0, place[np.searchsorted(whole.ids, part.ids)][part.order], -1)
        volume = np.where(lane >= 0, self.volume.ravel()[lane], 0.0)
        fold = self.constants.fold
        if self.branches:
            own = np.where(lane >= 0, fold.transpose(1, 0, 2).reshape(N_FOLD, -1)[:, lane], 0.0)
            fold = np.ascontiguousarray(own.transpose(1, 0, 2))
        if part.boxes:
            return replace(self, volume=volume, constants=Constants(self.constants.table, part.material, fold))
        own = self.constants.table.transpose(0, 2, 1).reshape(-1, self.constants.table.shape[1])
        table = np.where((lane >= 0)[:, :, None], own[lane], self.padding)
        return replace(self, volume=volume, constants=_of_forms(table, fold))


def build_block_parameters(blocks: Blocks, body: Body, region: Region, hourglass: str) -> BlockParameters:
    """Volumes and constants of a region's blocks."""
    edges = body.edges if blocks.whole else body.edges / 2.0
    fill = body.fill[region.cells].ravel()[blocks.ids]
    padding_x = 0.5 * (1.0 + SIGNS) * edges
    padding = np.zeros(0)
    branches = max(material.n_branches for material in body.materials)
    fold = np.zeros((blocks.n_batches if branches else 0, N_FOLD, LANES))
    if blocks.boxes:
        volume = fill * edges.prod()
        table = np.stack([block_constants(each, edges, hourglass) for each in body.materials])
        constants = Constants(table, blocks.material, fold)
    else:
        x = np.concatenate([body.x_rest[region.nodes[blocks.corners]], padding_x[None]])
        weight = None if blocks.weight is None else np.concatenate([blocks.weight, np.eye(8)[None]])
        forms, volume = np.empty((len(x), N_FORM)), np.empty(len(x))
        kind = np.append(blocks.kind, 0)
        for number, material in enumerate(body.materials):
            mine = kind == number
            forms[mine], volume[mine] = build_forms(
                x[mine], material, hourglass, None if weight is None else weight[mine]
            )
        if body.material.n_state and not branches:
            own = np.zeros((len(forms), MEMORY - N_FORM + body.material.n_state))
            own[:, SMALL - N_FORM] = body.material.small
            forms = np.concatenate([forms, own], axis=1)
        volume = volume[:-1] * fill
        padding = forms[-1]
        constants = _of_forms(forms[blocks.order], fold)
    found = BlockParameters(
        volume=np.where(blocks.order >= 0, volume[blocks.order], 0.0),
        edges=edges,
        constants=constants,
        padding=padding,
        padding_x=padding_x,
        law=body.material.respond if body.material.n_state else body.material.number,
        small=body.material.small,
        branches=branches,
        yields=any(material.yielding for material in body.materials),
    )
    found.hold(np.zeros((blocks.n_batches, found.n_state, LANES)))
    return found


def _of_forms(forms: Floats, fold: Floats) -> Constants:
    """Constants of blocks of any shape (b, LANES, N_FORM)."""
    assert forms.shape[1] == LANES
    return Constants(np.ascontiguousarray(forms.transpose(0, 2, 1)), np.arange(len(forms), dtype=np.int32), fold)


def make_viscous(blocks: BlockParameters, times: float) -> BlockParameters:
    """Have neo-Hookean blocks count with the compliance of the axis that has most in their local solve.

    With one for each axis (`kernels.block`, eq. (4)) what a sweep adds to a flat block's stress has a moment. Stress
    catches up with shape within a few substeps, but not where it is viscous: there the moment turns the block, and
    damping is half of what is asked for, or a fifth more. times: damping time in longest undamped substeps. Blocks that
    are `VERY_FLAT` would gain energy below `MOSTLY`, and keep what they have there.
    """
    if blocks.law != NEO_HOOKEAN:
        return blocks
    table = blocks.constants.table.copy()
    most, least = table[:, G : G + 3].max(axis=1), table[:, G : G + 3].min(axis=1)
    even = (times > 1.0) & ((times > MOSTLY) | (most < VERY_FLAT**2 * least))
    table[:, G : G + 3] = np.where(even[:, None], most[:, None], table[:, G : G + 3])
    return replace(blocks, constants=Constants(table, blocks.constants.number, blocks.constants.fold))


def mean_lag(blocks: BlockParameters, softness: Floats) -> float:
    """8 max w_i V 2 mu G of the blocks, V/mu their weights [1/s^2]; softness (b, 4) is 8 max w_i [1/kg].

    Shear is what slow modes are made of. Where materials differ, the softer one deforms.
    """
    own, boxes = blocks.constants.table[blocks.constants.number], blocks.constants.table.ndim == 2
    mu, slope = (own[:, MU, None], own[:, G : G + 3, None]) if boxes else (own[:, MU], own[:, G : G + 3])
    weight = blocks.volume / mu
    lag = softness * blocks.volume * 2.0 * mu * slope.mean(axis=1)
    return float((weight * lag).sum() / weight.sum())
