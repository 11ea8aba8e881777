"""Everything of a body of particles that evolves, in one buffer: to copy it is one copy, a snapshot is its bytes."""

from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.jit import record

MAGIC = b"softseam particles 1\n"


@record
class ParticleState(NamedTuple):
    """n particles, t tools; all fields are views of `buffer`, updated in place by the step."""

    buffer: Floats
    x: Floats
    """positions (n, 3) [m]"""
    v: Floats
    """velocities (n, 3) [m/s]"""
    held: Floats
    """tool that holds each particle, -1 for none (n,)"""
    local: Floats
    """place of held particles in their tool's frame (n, 3) [m]"""
    grips: Floats
    """1 for tools that grip (t,)"""
    strain: Floats
    """strain energy [J] (1,)"""
    slip: Floats
    """of a solid: how far each particle that touches a tool slid along it since it began to (n, t, 3), else none [m]"""


def new_state(n: int, t: int, solid: bool) -> ParticleState:
    """A zero state for n particles, of a solid or not, and t tools."""
    shapes = ((n, 3), (n, 3), (n,), (n, 3), (t,), (1,), (n if solid else 0, t, 3))
    sizes = [int(np.prod(shape)) for shape in shapes]
    buffer = np.zeros(sum(sizes))
    ends = np.cumsum(sizes)
    views = [buffer[end - size : end].reshape(shape) for end, size, shape in zip(ends, sizes, shapes, strict=True)]
    return ParticleState(buffer, *views)


def encode_state(state: ParticleState) -> bytes:
    """Magic line, count of float64 as 8 bytes little-endian, the values little-endian."""
    return MAGIC + len(state.buffer).to_bytes(8, "little") + state.buffer.astype("<f8", copy=False).tobytes()


def decode_state(data: bytes, state: ParticleState) -> None:
    """Overwrite `state` by a snapshot. Raises ValueError where it is not one of this body."""
    head = len(MAGIC) + 8
    if data[: len(MAGIC)] != MAGIC or len(data) < head:
        raise ValueError("this is not a snapshot of a sheet or rope: restore the bytes that `snapshot` returned")
    count = int.from_bytes(data[len(MAGIC) : head], "little")
    if count != len(state.buffer) or len(data) != head + 8 * count:
        raise ValueError(
            f"the snapshot holds {count} numbers in {len(data)} bytes, this body needs {len(state.buffer)}: "
            "configure the body that the snapshot was taken from"
        )
    state.buffer[:] = np.frombuffer(data, dtype="<f8", offset=head)
