"""What of a region evolves."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from softseam_services.body.body import Floats
from softseam_services.jit import record


@record
class StateArrays(NamedTuple):
    """Those of a `FemState` that kernels step, by reference."""

    x: Floats
    v: Floats
    contact: Floats
    history: Floats
    share: Floats
    passed: Floats


@dataclass
class FemState:
    """Everything of a region that evolves (n nodes, p surface points, t tools). Its arrays are filled in place."""

    x: Floats
    """(n, 3) [m]"""
    v: Floats
    """(n, 3) [m/s]"""
    contact: Floats
    """per point and tool: force on the body [N], slip since contact began [m], anchor [m] (p, t, 9)"""
    history: Floats
    """what the integrator keeps of the steps before (k, n, 3)"""
    past: float = 0.0
    """length of the step that made the history, 0 where there is none [s]; of statics, the share of the load borne"""
    level: int = 0
    """substeps by error begin with 2^-level of the step"""
    material: Floats = field(default_factory=lambda: np.zeros((0, 8, 0)))
    """what a material with state remembers, of each octant (c, 8, n); (0, 8, 0) of others"""
    dissipated: Floats = field(default_factory=lambda: np.zeros(1))
    """what such a material dissipated since the state was first made (1,) [J]"""
    share: Floats = field(default_factory=lambda: np.zeros(0))
    """of full quadrature in each cell over the last step, negative where there was none (c,); (0,) where cells keep
    their quadrature, see kernels/quadrature_blending.py"""
    passed: Floats = field(default_factory=lambda: np.zeros(1))
    """energy that cells gained as they passed between quadratures, since the state was first made (1,) [J]"""

    @cached_property
    def arrays(self) -> StateArrays:
        """What kernels step, as one; to make them takes longer than to copy a small state."""
        return StateArrays(self.x, self.v, self.contact, self.history, self.share, self.passed)

    def copy(self) -> FemState:
        arrays = self.x.copy(), self.v.copy(), self.contact.copy(), self.history.copy()
        blending = self.share.copy(), self.passed.copy()
        return FemState(*arrays, self.past, self.level, self.material.copy(), self.dissipated.copy(), *blending)

    def into(self, other: FemState) -> None:
        """Write this state over the other."""
        other.x[:], other.v[:], other.contact[:], other.history[:] = self.x, self.v, self.contact, self.history
        other.past, other.level = self.past, self.level
        other.material[:], other.dissipated[:] = self.material, self.dissipated
        other.share[:], other.passed[:] = self.share, self.passed


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
