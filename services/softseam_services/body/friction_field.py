"""How friction varies over a body's surface: a smooth random field of place, the same whatever the cells.

Friction of a tool at a place X of the body at rest is the tool's coefficient times
  f(X) = prod_j exp(a cos(k_j . X + phi_j)) / I_0(a),   j = 1 .. COSINES                                         (1)
with phases phi_j drawn evenly and wave vectors k_j from a normal distribution of variance 1/length^2 along each axis,
so that the logarithm's correlation at a distance d is exp(-d^2/(2 length^2)): spectral representation (M. Shinozuka,
G. Deodatis, Appl. Mech. Rev. 44 (1991) 191-204), of the density that belongs to that correlation. As exp(a cos phi) has
the mean I_0(a), the modified Bessel function, over phi,
  <f> = 1,   <f^2> = (I_0(2 a)/I_0(a)^2)^COSINES = 1 + spread^2                                                  (2)
over phases, and so over a surface that is large beside the length, whatever the seed. f is nowhere less than
(exp(-a)/I_0(a))^COSINES > 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.friction_field import FrictionFieldSpec

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

COSINES = 16
"""few, so that a field costs next to nothing, and enough that its logarithm is nearly normal: excess -1.5/16"""


@dataclass(frozen=True)
class FrictionField:
    """One field, or k fields; of k, arrays have a first axis (k,)."""

    amplitude: Floats
    """a of eq. (1); 0 where friction is even (...)"""
    wave: Floats
    """k_j (..., COSINES, 3) [1/m]"""
    phase: Floats
    """phi_j (..., COSINES)"""

    def factor(self, x: Floats) -> Floats:
        """Eq. (1) at places at rest (..., p, 3) [m]: (..., p) [1]; 1 where friction is even."""
        if not self.amplitude.any():
            return np.ones(x.shape[:-1])
        total = np.zeros(x.shape[:-1])
        for j in range(COSINES):
            kx, ky, kz = (self.wave[..., j, axis, None] for axis in range(3))
            # sums of three and no product of matrices: the same bits however many places there are
            total += np.cos(kx * x[..., 0] + ky * x[..., 1] + kz * x[..., 2] + self.phase[..., j, None])
        a = self.amplitude[..., None]
        return np.asarray(np.exp(a * total - COSINES * np.log(np.i0(a))))

    def at_points(self, x_rest: Floats, indptr: Ints, node: Ints, weight: Floats) -> Floats:
        """Eq. (1) where points are at rest that follow nodes at x_rest (n, 3) [m], as of `point_weights`: (p,) [1]."""
        if not len(node):
            return np.ones(0)
        return self.factor(np.add.reduceat(weight[:, None] * x_rest[node], indptr[:-1]))


EVEN = FrictionField(np.zeros(()), np.zeros((COSINES, 3)), np.zeros(COSINES))
"""1 everywhere"""


def draw_fields(specs: Sequence[FrictionFieldSpec | None], origin: Floats, axes: Floats | None = None) -> FrictionField:
    """The fields of k specs, each by its seed alone; None is even friction.

    origin  where the origin of the body's own frame is at rest (3,) [m]
    axes    its axes there, one a row (3, 3); None: those of the world
    """
    amplitude = np.array([0.0 if spec is None else _amplitude(spec.spread) for spec in specs])
    wave, phase = np.zeros((len(specs), COSINES, 3)), np.zeros((len(specs), COSINES))
    for i, spec in enumerate(specs):
        if spec is not None:
            random = np.random.default_rng(spec.seed)
            wave[i] = random.standard_normal((COSINES, 3)) / spec.length
            phase[i] = random.uniform(0.0, 2.0 * np.pi, COSINES)
    if axes is not None:
        wave = wave @ axes
    return FrictionField(amplitude, wave, phase - (wave * origin).sum(axis=-1))


def draw_field(spec: FrictionFieldSpec | None, origin: Floats, axes: Floats | None = None) -> FrictionField:
    """The field of one spec, see `draw_fields`."""
    if spec is None:
        return EVEN
    fields = draw_fields([spec], origin, axes)
    return FrictionField(fields.amplitude[0], fields.wave[0], fields.phase[0])


@lru_cache
def _amplitude(spread: float) -> float:
    """a of eq. (2), whose right side is a^2/2 a cosine where a is small: that much too large or small, each time."""
    if spread == 0.0:
        return 0.0
    wanted = np.log1p(spread * spread) / COSINES
    a = np.sqrt(2.0 * wanted)
    for _ in range(20):
        a *= np.sqrt(wanted / (np.log(np.i0(2.0 * a)) - 2.0 * np.log(np.i0(a))))
    return float(a)
