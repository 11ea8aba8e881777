"""What each quantity of a run is claimed to be off by, from its difference to the sibling's.

d = |J - J_sibling|,   |J|^2 = (1/T) int_0^T J(t)^2 dt                                                            (1)
s = |J(t + step) - J(t)| where forces time the motion, else 0,   x = max(0, d - s)                                (2)
claim = a (min(x, d0) + b max(x - d0, 0)) + c delta x + s + f |J| + k delta |J|,   d0 = 0.05 |J|                  (3)
delta = (1/E) sum_i min(D_i, max(K_i-1, K_i)),   at most 1                                                        (4)

is the claim of the curve. What is read off it has a claim of its own, by what is read off the sibling's:
eq. (3), of a mean g times that, and h times what changes in a step beside a peak, with

d_r = max(|r - r_sibling|, e d),   s of that number,   max(|r|, |J|) in place of |J|,   f at least 0.008          (5)

Slip begins at the end of a step where friction is spent, a threshold that both runs may miss: s counts twice, as of the
sibling's steps, b = 1, and a is more. A lift is less by what slips: b = 1.

s    where a force ends a phase or is kept, the next begins at the end of a step, whenever the force was reached: up to
     one step late in the run, up to two of these in the sibling. So much of d says nothing of cells
a    the sibling errs by more, (1) of sibling.py, but errors grow slowly at edges; and XPBD errs otherwise than FEM. The
     forces of tools on a body that nothing holds are of blows, which err as the root of a step: a = 1/(2^(1/2) - 1)
b    of large differences most is the sibling's own error, which grew faster than its cells; of a run by XPBD less is,
     for its model may err by as much, and of meshes, which lie otherwise in other cells: their error does not fall with
     the length of these alone. Stress follows from derivatives, and is of a lower order: b is half as large again
c    where steps take much of the motion, their error no longer grows with their length: what swings or rebounds within
     a few steps is lost by the run and by its sibling alike. K is the kinetic energy, D what a step took, and E the
     largest energy. What steps take beyond the motion that there was is of bodies that tools press slowly, whose work
     implicit Euler counts by the force at the end of the step: that changes forces little
e    two curves meet now and then, where what is read off both is the same by chance; not so where both are 0
g    what is too much at one time and too little at another is less in the mean
h    the true peak is between two steps, but for compression: tools stop within a step. Where forces time the motion, it
     is one step's all for whatever these move, compression, too: a force is reached within one, and passed at its end.
     Twice h of forces of tools; five times of those of blows, which are higher in shorter steps
f    two curves that cross, or that an edge within a cell bends alike, differ by less than either errs; forces of tools
     most often, whose edges lie anywhere within cells of both, stress, runs by XPBD, whose model's error may be the
     sibling's of its cells, and single numbers, but for a compression that tools prescribe
k    where a body that nothing holds came to rest is left by its last hops, which steps take: both runs may lose them
     alike, and be at one. Of displacements that are less than a fifth of a cell; of what moves farther d says enough

Nothing is claimed of slip while a body only creeps: points beside the edges of a contact slide by a hundredth of a
cell, which neither these cells nor longer ones show. And what would be claimed to be off by more than it is, is *not
settled*.

The numbers are chosen on the scenes of docs/results/claims.md and checked on others, there, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam.claims.sibling import LONGER
from softseam.columns import is_nothing, rms, shown_unit
from softseam_protocol.models import REFERENCE
from softseam_protocol.quantities import OF_TOOLS, PROBED, quantity
from softseam_protocol.scene.bodies import MeshShape
from softseam_protocol.scene.motion import ClosePhase
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]
Read = Callable[[Floats, Floats], tuple[float, float, float]]
"""of times (n,) [s] and values (n,): the number, by how much it changes where all comes a step later, and what changes
in a step beside a peak"""


def measured(entry: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """Times (n,) [s] at which a quantity's entry in a report was measured, and its values (n,)."""
    time, values = (np.array(entry[name], dtype=np.float64) for name in ("time", "values"))
    known = np.isfinite(values)
    return time[known], values[known]


def _end(time: Floats, values: Floats) -> tuple[float, float, float]:
    return float(values[-1]), _largest(np.diff(values[-2:])), 0.0


def _peak(time: Floats, values: Floats) -> tuple[float, float, float]:
    """The value farthest from 0, whenever it comes."""
    at = int(np.argmax(np.abs(values)))
    return float(values[at]), 0.0, _largest(np.diff(values[max(0, at - 1) : at + 2]))


def _mean(time: Floats, values: Floats) -> tuple[float, float, float]:
    """Over time; a step later its last value is gone, and the first counts twice."""
    if len(time) < 2:
        return float(values[-1]), 0.0, 0.0
    late = abs(float(values[-1] - values[0])) / (len(values) - 1)
    return float(np.trapezoid(values, time) / (time[-1] - time[0])), late, 0.0


def _largest(changes: Floats) -> float:
    return float(np.abs(changes).max(initial=0.0))


READINGS: dict[str, Read] = {"end": _end, "peak": _peak, "mean": _mean}
"""By its name in a report."""


SMALL = 2.0
"""a of eq. (3) [1]"""
OF_BLOWS = 1.0 / (LONGER**0.5 - 1.0)
"""a of forces between tools and bodies that nothing holds [1]"""
OF_SLIP = 3.0
"""a of slip [1]"""
LARGE = 0.05
"""d0 over |J| [1]"""
BEYOND = 0.2
"""b, of a run by FEM [1]"""
BEYOND_OTHERWISE = 0.4
"""and of one by XPBD, or by both models, and of meshes [1]"""
OF_STRESS = 1.5
"""times b, of stress [1]"""
OF_MOTION = 4.0
"""c [1]"""
OF_REST = 1.5
"""k, of displacements of bodies that nothing holds, less than `SLIDES` [1]"""
LEAST = 0.002
"""f [1]"""
LEAST_OTHERWISE = 0.008
"""and of forces of tools, of stress, of a run by XPBD or by both models, and of single numbers [1]"""
FINER = LONGER / (LONGER - 1.0)
"""times d that is claimed where the sibling has the shorter cells and steps, so that d is less than the error: (2) of
sibling.py, of first order [1]"""
OF_CURVE = 0.55
"""e of eq. (5) [1]"""
OF_MEAN = 0.8
"""g [1]"""
BESIDE = 0.3
"""h [1]"""
SLIDES = 0.2
"""slip, or displacement, over the longest edge of the run's cells from which on a body does not creep [1]"""
NEXT_TO_NOTHING = 0.1
"""of |J|: what is read off a curve and is less is claimed relative to this, for it may be 0 at the end [1]"""
GROWS = 1.1
"""of what need not settle: times by which the finer run's exceeds the coarser's from which on it is said to grow [1]"""


@dataclass(frozen=True)
class Scale:
    """How much of a difference to its sibling a run claims.

    alike  whether FEM alone made the run, as it makes the sibling
    taken  share of the largest energy of its bodies that the run's steps took of motion, delta of eq. (4) [1]
    timed  whether forces time the motion
    late   times that s counts where they do [1]
    finer  whether the sibling's cells and steps are the shorter ones
    free   whether nothing holds one of its bodies but tools
    small  a of eq. (3) [1]
    beyond b of eq. (3) [1]; None: by the models
    least  f of eq. (3) [1]
    rest   k of eq. (3) [1]
    beside h; 1 where forces time the motion [1]
    cell   longest edge of the run's cells; 0 where any slip is of a body that slides [m]
    """

    alike: bool
    taken: float
    timed: bool = False
    late: float = 1.0
    finer: bool = False
    free: bool = False
    small: float = SMALL
    beyond: float | None = None
    least: float = LEAST
    rest: float = 0.0
    beside: float = BESIDE
    cell: float = 0.0

    @classmethod
    def of(cls, scene: Scene, report: Mapping[str, Any], finer: bool, cell: float = 0.0) -> Scale:
        """Of a run of this scene that the report is of; finer, cell: as above."""
        grips = [phase for phase in scene.motion if isinstance(phase, ClosePhase)]
        timed = any(grip.force is not None or grip.until.force is not None for grip in grips)
        free = any(not body.said("fixed", ()) for body in scene.bodies.values())
        alike, taken = report["model"] == REFERENCE, motion_taken(report["energy"])
        meshes = any(
            (it := body.in_cells) is not None and isinstance(it.shape, MeshShape) for body in scene.bodies.values()
        )
        beyond = BEYOND_OTHERWISE if meshes else None
        least = LEAST if alike else LEAST_OTHERWISE
        beside = 1.0 if timed else BESIDE
        return cls(alike, taken, timed, finer=finer, free=free, beyond=beyond, least=least, beside=beside, cell=cell)

    def at(self, name: str) -> Scale:
        """That of a quantity."""
        kind = name.rpartition(".")[2]
        if kind == "slip":
            return replace(self, small=OF_SLIP, beyond=1.0, timed=True, late=LONGER)
        if kind == "compression":
            return self if self.timed else replace(self, beside=0.0, least=LEAST)
        if kind == "lift_height":
            return replace(self, beyond=1.0)
        if quantity(name).unit == "Pa":
            return replace(self, beyond=OF_STRESS * (BEYOND if self.alike else BEYOND_OTHERWISE), least=LEAST_OTHERWISE)
        if kind in PROBED and self.free:
            return replace(self, rest=OF_REST)
        if kind not in OF_TOOLS:
            return self
        small, beside = (OF_BLOWS, 5.0 * BESIDE) if self.free else (self.small, 2.0 * BESIDE)
        return replace(self, small=small, least=LEAST_OTHERWISE, beside=beside)

    @property
    def factor(self) -> float:
        """Of a small difference [1]."""
        return FINER if self.finer else self.small + OF_MOTION * self.taken

    def claim(self, off: float, size: float, in_a_step: float) -> float:
        """Eq. (3), in the unit of d = off, |J| = size and |J(t + step) - J(t)| = in_a_step."""
        late = self.late * in_a_step if self.timed else 0.0
        beyond = max(0.0, off - late)
        least = self.least + (self.rest * self.taken if size < SLIDES * self.cell else 0.0)
        return self.factor * beyond - self._less * max(0.0, beyond - LARGE * size) + late + least * size

    @property
    def _less(self) -> float:
        """Times what is large of a difference that is not claimed, a (1 - b) [1]."""
        beyond = self.beyond if self.beyond is not None else BEYOND if self.alike else BEYOND_OTHERWISE
        return 0.0 if self.finer else self.small * (1.0 - beyond)


def motion_taken(energy: Mapping[str, Any]) -> float:
    """Eq. (4) of a report's `energy` [1]."""
    kinetic, taken = (np.array(energy["ledger"][name], dtype=np.float64) for name in ("kinetic", "dissipation"))
    there = np.maximum(kinetic, np.append(kinetic[:1], kinetic[:-1]))
    of_motion = float(np.nansum(np.clip(taken, 0.0, there)))
    return min(1.0, of_motion / energy["largest"]) if energy["largest"] > 0.0 else 0.0


def in_a_step(entry: Mapping[str, Any]) -> float:
    """|J(t + step) - J(t)| of a quantity's entry in a report, in its unit."""
    time, values = measured(entry)
    return rms(np.diff(values), time[1:]) if len(time) > 1 else 0.0


def claims(run: Mapping[str, Any], sibling: Mapping[str, Any], scale: Scale) -> dict[str, dict[str, Any]]:
    """By quantity of the run: `absolute`, eq. (3) in its unit, `share`, over |J|, and `why` there is neither, '' where
    there is; and of each of READINGS, by its name, the same by eq. (5), beside its `value`.

    run, sibling: `quantities` of both reports. Both are taken at the sibling's times at which it was measured, the run
    between its own by straight lines. A share of what is nothing is None.
    """
    grown = growing(run, sibling, scale.finer)
    return {name: _claim(name, entry, sibling.get(name), scale, grown.get(name, 1.0)) for name, entry in run.items()}


def unclaimed(run: Mapping[str, Any], why: str) -> dict[str, dict[str, Any]]:
    """The same where nothing is claimed of any quantity, for one reason."""
    return {name: _nothing(entry, why) for name, entry in run.items()}


def _claim(
    name: str, entry: Mapping[str, Any], other: Mapping[str, Any] | None, scale: Scale, grown: float
) -> dict[str, Any]:
    """Of one quantity; other: of the sibling, None where it has none; grown: `growing`, 1 where it is not."""
    why = _why_none(name, entry, other, scale, grown)
    if why or other is None:
        return _nothing(entry, why)
    own, (off, size), longer = scale.at(name), difference(entry, other), "shorter" if scale.finer else "longer"
    apart = f"it differs by {100.0 * off / size:.0f} %" if size > 0.0 else "it is not 0"
    found = _settled(name, own.claim(off, size, in_a_step(entry)), size, f"{apart} with {longer} cells and steps")
    prescribed = own.beside == 0.0
    number = own if prescribed else replace(own, least=max(own.least, LEAST_OTHERWISE))
    unit, factor = shown_unit(name)
    for reading, read in READINGS.items():
        (value, late, beside), (there, _, _) = read(*measured(entry)), read(*measured(other))
        by_chance = 0.0 if is_nothing(name, abs(value)) and is_nothing(name, abs(there)) else OF_CURVE * off
        text = f"{factor * value:.4g} {unit} here, {factor * there:.4g} {unit} with {longer} cells and steps"
        if abs(value - there) < by_chance:
            text += f", and {apart} on the way"
        claim = number.claim(max(abs(value - there), by_chance), max(abs(value), size), late)
        claim = (OF_MEAN if reading == "mean" else 1.0) * claim + own.beside * beside
        found[reading] = {"value": value} | _settled(name, claim, max(abs(value), NEXT_TO_NOTHING * size), text)
    return found


def _why_none(name: str, entry: Mapping[str, Any], other: Mapping[str, Any] | None, scale: Scale, grown: float) -> str:
    """Why nothing is claimed of a quantity: a word or two, a colon, and a sentence; '' where something is."""
    if quantity(name).group == "error":
        return "an estimate itself: it says how far this one run is off, and has no error of its own"
    if other is None:
        return "none: the run to compare with does not measure it"
    if not np.isfinite(difference(entry, other)[0]):
        return "none: never measured in both runs at once"
    if grown > 1.0:
        return (
            f"grows: {grown:.2g} times with cells half as long, and has not settled; at edges of tools and clamps it "
            "never does: shorten body.cell, or ask for von_mises_p99"
        )
    slid = max(float(measured(each)[1].max()) for each in (entry, other))
    if name.rpartition(".")[2] == "slip" and 0.0 < slid < SLIDES * scale.cell:
        return (
            f"creeps: what slides by less than {1e3 * SLIDES * scale.cell:.2g} mm, a fifth of a cell, are points "
            "beside the edges of the contact, which no run on such cells shows"
        )
    return ""


def _settled(name: str, claim: float, size: float, text: str) -> dict[str, Any]:
    """A claim of something so large, where it is less than that; text: why, where it is not."""
    if claim > size and not is_nothing(name, claim):
        return {"absolute": None, "share": None, "why": f"not settled: {text}"}
    return {"absolute": claim, "share": None if is_nothing(name, size) else claim / size, "why": ""}


def _nothing(entry: Mapping[str, Any], why: str) -> dict[str, Any]:
    """No claim of a quantity with this entry."""
    time, values = measured(entry)
    none: dict[str, Any] = {"absolute": None, "share": None, "why": why}
    return none | {
        name: {"value": read(time, values)[0] if len(time) else None} | none for name, read in READINGS.items()
    }


def growing(run: Mapping[str, Any], sibling: Mapping[str, Any], finer: bool) -> dict[str, float]:
    """|J| on the shorter cells over that on the longer ones, of quantities that need not settle and grew by `GROWS`.

    run, sibling: `quantities` of both reports; finer: whether the sibling has the shorter cells.
    """
    found = {}
    for name, entry in run.items():
        if name not in sibling or quantity(name).settles:
            continue
        at, here, there = _together(entry, sibling[name])
        sizes = [rms(values, at) for values in ((there, here) if finer else (here, there))]
        if sizes[1] > 0.0 and sizes[0] > GROWS * sizes[1]:
            found[name] = sizes[0] / sizes[1]
    return found


def difference(run: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[float, float]:
    """|J - J'| and |J| of a quantity's entries in two reports; NaN where they have no time in common."""
    at, here, there = _together(run, other)
    time, values = measured(run)
    return (rms(here - there, at), rms(values, time)) if len(at) else (float("nan"), float("nan"))


def _together(run: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[Floats, Floats, Floats]:
    """Times (n,) [s] of the other's within the run's, and the values (n,) of both, the run's between its own."""
    (time, values), (at, others) = measured(run), measured(other)
    within = (at >= time[0] - 1e-9) & (at <= time[-1] + 1e-9) if len(time) else np.zeros(len(at), dtype=bool)
    at = at[within]
    return at, np.interp(at, time, values) if len(at) else at, others[within]
