"""Everything of a PBD region that evolves, in one buffer: copying the state is one copy, a snapshot is its bytes."""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.jit import record

from .kernels.block_rows import N_STRESS
from .kernels.lanes import LANES
from .kernels.trust import N_MONITOR


@record
class PbdState(NamedTuple):
    """n nodes, b batches, p points, t tools, r numbers that a block remembers; all are views of `buffer`, updated
    in place by the step."""

    buffer: Floats
    x: Floats
    """positions (n, 3) [m]"""
    v: Floats
    """velocities (n, 3) [m/s]"""
    a: Floats
    """accelerations from blocks and contacts (n, 3) [m/s^2]"""
    stress: Floats
    """Lambda of each block: P (3, 3) [N m] then T (4, 3) [N], each entry for 4 lanes (b, 84)"""
    force: Floats
    """contact force of each tool on each point (p, t, 3) [N]"""
    slip: Floats
    """slip of each touching point on each tool since it began to touch (p, t, 3) [m]"""
    steady: Floats
    """of each tool on each point: pressure with a memory, by which friction is bounded, and how far friction went
    beyond the pressure so far, see kernels/contact.py (p, t, 2) [N]"""
    lean: Floats
    """where on its patch each tool presses each point inside a face, in the patch's edges from its middle; 0 at others
    (p, t, 2) [1]"""
    force_mean: Floats
    """contact forces, mean over the substeps of the last step (p, t, 3) [N]"""
    memory: Floats
    """what the material of each block remembers, for 4 lanes (b, r, 4)"""
    monitor: Floats
    """what the last step left for the monitor, see `watch` (N_MONITOR,)"""


def _shapes(n: int, b: int, p: int, t: int, r: int) -> tuple[tuple[int, ...], ...]:
    of_points = (p, t, 3), (p, t, 3), (p, t, 2), (p, t, 2), (p, t, 3)
    return ((n, 3), (n, 3), (n, 3), (b, N_STRESS), *of_points, (b, r, LANES), (N_MONITOR,))


def size_of(n: int, b: int, p: int, t: int, r: int = 0) -> int:
    """Numbers of such a state."""
    return sum(int(np.prod(shape)) for shape in _shapes(n, b, p, t, r))


def new_state(n: int, b: int, p: int, t: int, r: int = 0, buffer: Floats | None = None) -> PbdState:
    """A state for n nodes, b batches, p points and t tools, of blocks that remember r numbers: zero, or in a buffer of
    `size_of` numbers."""
    shapes = _shapes(n, b, p, t, r)
    sizes = [int(np.prod(shape)) for shape in shapes]
    buffer = np.zeros(sum(sizes)) if buffer is None else buffer
    ends = np.cumsum(sizes)
    views = [buffer[end - size : end].reshape(shape) for end, size, shape in zip(ends, sizes, shapes, strict=True)]
    return PbdState(buffer, *views)


MAGIC = b"softseam pbd 6\n"


def encode_state(state: PbdState, probed: Floats) -> bytes:
    """Magic line, counts of float64 in the state and in `probed` as 8 bytes little-endian each, the values likewise."""
    counts = len(state.buffer).to_bytes(8, "little") + len(probed).to_bytes(8, "little")
    return MAGIC + counts + np.concatenate([state.buffer, probed]).astype("<f8", copy=False).tobytes()


def decode_state(data: bytes, state: PbdState, most_probed: int) -> Floats:
    """Overwrite `state` by a snapshot; returns `probed`, of none or so many numbers.

    Raises ValueError where it is no snapshot of this region.
    """
    head = len(MAGIC) + 16
    if data[: len(MAGIC)] != MAGIC or len(data) < head:
        raise ValueError("this is not a snapshot of a PBD participant: restore the bytes that `snapshot` returned")
    count = int.from_bytes(data[len(MAGIC) : head - 8], "little")
    probed = int.from_bytes(data[head - 8 : head], "little")
    if count != len(state.buffer) or probed not in (0, most_probed) or len(data) != head + 8 * (count + probed):
        raise ValueError(
            f"the snapshot holds {count} numbers in {len(data)} bytes, this region needs {len(state.buffer)}: "
            "configure the region that the snapshot was taken from"
        )
    values = np.frombuffer(data, dtype="<f8", offset=head)
    state.buffer[:] = values[:count]
    return values[count:].astype(np.float64)
