"""A solver's state as bytes: a magic, the shapes, and the arrays as little-endian float64."""

import struct

import numpy as np

from softseam_services.body.body import Floats

_MAGIC = b"SSFEM5\0\0"


def pack(*arrays: Floats) -> bytes:
    """Bytes of float64 arrays."""
    sizes = struct.pack(f"<I{len(arrays)}Q", len(arrays), *(a.size for a in arrays))
    return b"".join([_MAGIC, sizes, *(np.ascontiguousarray(a, dtype="<f8").tobytes() for a in arrays)])


def unpack(data: bytes, *shapes: tuple[int, ...]) -> list[Floats]:
    """Arrays of these shapes; raises ValueError where the bytes are not such a state."""
    sizes = [int(np.prod(shape)) for shape in shapes]
    header = _MAGIC + struct.pack(f"<I{len(sizes)}Q", len(sizes), *sizes)
    if data[: len(header)] != header or len(data) != len(header) + 8 * sum(sizes):
        raise ValueError("the snapshot is not of an FEM region of this size: restore it with the same scene and cells")
    flat = np.frombuffer(data, dtype="<f8", offset=len(header)).astype(np.float64)
    if not np.isfinite(flat).all():
        raise ValueError("the snapshot holds numbers that are not finite: it is damaged")
    parts = np.split(flat, np.cumsum(sizes)[:-1])
    return [part.reshape(shape).copy() for part, shape in zip(parts, shapes, strict=True)]
