"""Which bodies of a pile are swept four at a time, see `kernels.fours`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .kernels.block_rows import N_STRESS
from .kernels.fours import Fours
from .kernels.lanes import LANES, aligned
from .model import PbdModel
from .parameters import PbdParameters

Built = tuple[PbdModel, PbdParameters]
"""of a body"""


def fours_of(bodies: Sequence[Built]) -> Fours:
    """Of the bodies of a pile, in their order: boxes of an elastic material, one block in each batch, and at least one
    other body whose structure and constants are the same."""
    found: dict[tuple[object, ...], list[int]] = {}
    for number, (model, parameters) in enumerate(bodies):
        if _sparse(model, parameters):
            constants = parameters.arrays.constants
            key = id(model), constants.table.tobytes(), constants.number.tobytes(), parameters.arrays.law
            found.setdefault((*key, parameters.arrays.kappa), []).append(number)
    kinds = [numbers for numbers in found.values() if len(numbers) > 1]
    kind = np.full(len(bodies), -1, dtype=np.int32)
    for place, numbers in enumerate(kinds):
        kind[numbers] = place
    f = sum(-(-len(numbers) // LANES) for numbers in kinds)
    m = max((bodies[numbers[0]][0].blocks.n_batches for numbers in kinds), default=0)
    return Fours(
        kind=kind,
        n_kinds=len(kinds),
        bodies=np.zeros((f, LANES), dtype=np.int64),
        nodes=np.zeros((f, m, 8, LANES), dtype=np.int32),
        volume=aligned(f, m, LANES),
        softness=aligned(f, m, LANES),
        stress=aligned(f, m, N_STRESS),
    )


def _sparse(model: PbdModel, parameters: PbdParameters) -> bool:
    """Whether a body has one block in each batch, of a law that neither damps nor remembers."""
    plain = model.blocks.boxes and not parameters.blocks.n_state and not parameters.explicit
    one_each = bool(((model.blocks.octant >= 0).sum(axis=1) == 1).all())
    return plain and one_each and parameters.arrays.stiffness_time == 0.0
