"""A shear modulus and branches that relax, of what a laboratory measured: least squares of moduli above 0.

Every test is linear in the moduli of springs behind dashpots of given times, one a decade of what it lasted:

    sweep   G'(w) = G_inf + sum_i G_i (w t_i)^2/(1 + (w t_i)^2),   G''(w) = sum_i G_i w t_i/(1 + (w t_i)^2)         (1)
    bar     P = (G_inf (l^2 - 1/l) + sum_i G_i (l^2/q_i^2 - q_i/l))/l,   dq_i/dt = (l^2 - q_i^3/l)/(3 t_i q_i)      (2)

P: force over first area, l: stretch, q_i: that of a dashpot, 1 at first; of a bar whose sides are free and whose volume
stays. (1): Ferry, Viscoelastic Properties of Polymers, 3; (2): a neo-Hookean branch, Ci = diag(q^2, 1/q, 1/q), by
dCi/dt = (C - tr(C Ci^-1)/3 Ci)/t (docs/decisions/65-laws-that-relax.md).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from softseam_protocol.scene.materials import MOST_BRANCHES

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Branches:
    """What was found: moduli [Pa] of all springs, the lasting one first, and the times (k,) [s] of the others."""

    modulus: Floats
    error: Floats
    """standard errors, as if what is left were noise of every row apart [Pa]"""
    time: Floats
    found: Floats
    """what (1) or (2) make of them, in the order of the data"""
    off: float
    """root of the mean square of what is left, over what was measured (sweep) or its largest (bar) [1]"""

    @property
    def quick(self) -> float:
        """Shear modulus of a quick load [Pa]."""
        return float(self.modulus.sum())

    @property
    def share(self) -> Floats:
        """Of each branch (k,) [1]."""
        return np.asarray(self.modulus[1:] / self.quick)


def of_sweep(frequency: Floats, storage: Floats, loss: Floats) -> Branches:
    """Of moduli (n,) [Pa] at angular frequencies (n,) [rad/s]; `found`: storage, then loss (2 n,)."""
    measured = np.concatenate([storage, loss])

    def solved(times: Floats) -> Branches:
        x = np.outer(frequency, times)
        design = np.zeros((2 * len(frequency), 1 + len(times)))
        design[: len(frequency), 0] = 1.0
        design[: len(frequency), 1:] = x**2 / (1.0 + x**2)
        design[len(frequency) :, 1:] = x / (1.0 + x**2)
        return _solved(design, measured, 1.0 / np.abs(measured), times)

    return _best(solved, 1.0 / frequency.max(), 1.0 / frequency.min())


def of_bar(time: Floats, stretch: Floats, stress: Floats) -> Branches:
    """Of force over first area (n,) [Pa] at these times (n,) [s] and stretches (n,), between which the stretch goes
    straight; at rest before the first."""
    weight = np.full(len(stress), 1.0 / np.abs(stress).max())

    def solved(times: Floats) -> Branches:
        design = np.column_stack([(stretch**2 - 1.0 / stretch) / stretch, _branch_stress(time, stretch, times)])
        return _solved(design, stress, weight, times)

    return _best(solved, 2.0 * float(np.median(np.diff(time))), 0.5 * float(time[-1] - time[0]))


def _best(solved: Callable[[Floats], Branches], least: float, most: float) -> Branches:
    """Of times one a decade between these [s], or nearer, all of them moved by up to half a decade."""
    count = int(np.clip(round(np.log10(most / least)) + 1, 1, MOST_BRANCHES)) if most > least else 1
    times = np.geomspace(least, most, count) if count > 1 else np.array([np.sqrt(least * most)])
    return min((solved(factor * times) for factor in 10.0 ** np.linspace(-0.5, 0.5, 11)), key=lambda each: each.off)


def _branch_stress(time: Floats, stretch: Floats, times: Floats) -> Floats:
    """Of branches of unit modulus (n, k), by (2) and Runge and Kutta's method of fourth order."""
    q, stress = np.ones(len(times)), np.zeros((len(time), len(times)))

    def rate(q: Floats, length: float) -> Floats:
        return np.asarray((length**2 - q**3 / length) / (3.0 * times * q))

    start, before = time[0], 1.0
    for row, (now, after) in enumerate(zip(time, stretch, strict=True)):
        pieces = max(1, int(np.ceil(5.0 * (now - start) / times.min())))
        h, change = (now - start) / pieces, (after - before) / pieces
        for piece in range(pieces):
            length = before + piece * change
            a = rate(q, length)
            b = rate(q + 0.5 * h * a, length + 0.5 * change)
            c = rate(q + 0.5 * h * b, length + 0.5 * change)
            d = rate(q + h * c, length + change)
            q = q + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        stress[row] = (after**2 / q**2 - q / after) / after
        start, before = now, after
    return stress


def _solved(design: Floats, measured: Floats, weight: Floats, times: Floats) -> Branches:
    """The springs, without branches that have less than half a percent of the quick modulus."""
    kept = np.ones(len(times) + 1, dtype=bool)
    while True:
        moduli, _ = nnls(design[:, kept] * weight[:, None], measured * weight)
        small = kept.copy()
        small[kept] = moduli < 0.005 * moduli.sum()
        small[0] = False
        if not small.any() or not moduli.any():
            break
        kept &= ~small
    left = (design[:, kept] @ moduli - measured) * weight
    free = moduli > 0.0
    weighted = (design[:, kept] * weight[:, None])[:, free]
    spare = max(1, len(measured) - int(free.sum()))
    error = np.zeros(len(moduli))
    error[free] = np.sqrt(np.diag(np.linalg.pinv(weighted.T @ weighted)) * (left @ left) / spare)
    return Branches(moduli, error, times[kept[1:]], design[:, kept] @ moduli, float(np.sqrt(np.mean(left**2))))
