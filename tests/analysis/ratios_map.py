"""The atlas's map of ratios across the seam against coupling scheme and integrator: an oscillator split in two.

Unlike sides are shown where their ratio is all that counts, on linear systems, scanned and simulated. The far side is
implicit Euler, as XPBD is; `PositionConstant` is the scheme of the product. `make atlas` adds this map to the others.
"""

from __future__ import annotations

import itertools
from functools import partial

import numpy as np
from numpy.typing import NDArray

from analysis.linear_study.gravouil_combescure import GravouilCombescure
from analysis.linear_study.integrators import LinearSide
from analysis.linear_study.position_constant import PositionConstant
from analysis.linear_study.prakash_hjelmstad import PrakashHjelmstad
from analysis.linear_study.split import Scheme, Split, SplitState, amplification, spectral_radius
from analysis.linear_study.velocity_constant import VelocityConstant
from softseam_protocol.scene.kinds import INTEGRATORS as FACTS
from softseam_studies.atlas.grid import Cell, Map, Panel
from softseam_studies.atlas.verdicts import Verdict, percent

Floats = NDArray[np.float64]

RATIOS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 99.0)
STEPS = (0.002, 0.02, 0.1, 0.3, 0.7, 2.0)
"""over the period of the whole"""
SUBSTEPS = (1, 3, 20)
"""of the far side"""
SCHEMES = ("position, constant", "velocity, constant", "Prakash-Hjelmstad", "Gravouil-Combescure")
PRODUCT = "position, constant"
INTEGRATORS = ("implicit_euler", "midpoint", "bdf2", "newmark")
STABLE = 1e-9
"""a spectral radius above 1 by less than this is rounding"""
BOUND = 0.1
FINE = 1.0 / 400.0
"""step over period at which the motion is compared with the closed form"""
N_STEPS = 400
"""simulated steps of the worst case"""


def build(ratios: tuple[float, ...] = RATIOS) -> Map:
    """The map; a smaller one for tests."""
    pairs = list(itertools.product(reversed(SCHEMES), reversed(INTEGRATORS)))
    cells = [
        Cell(
            panel,
            i,
            j,
            f"{what} ratio {ratio:g}, {scheme}, {integrator}",
            partial(run, what, ratio, scheme, integrator),
            0.1,
            scheme != PRODUCT,
        )
        for panel, what in enumerate(("mass", "stiffness"))
        for i, ratio in enumerate(ratios)
        for j, (scheme, integrator) in enumerate(pairs)
    ]
    rows = tuple(
        f"{scheme}; {integrator.replace('_', ' ')}{'' if scheme == PRODUCT else ' (control)'}"
        for scheme, integrator in pairs
    )
    columns = tuple(f"{ratio:g}" for ratio in ratios)
    return Map(
        "seam",
        "Ratios across the seam against the scheme",
        "No runs of the product, but of its scheme and others: a mass on a spring, split in two; the far side is "
        "implicit Euler with 1, 3 or 20 substeps, as XPBD is. "
        "Unstable: at some step from 0.002 to 2 periods the spectral radius exceeds 1, and the simulation at the worst "
        f"one grows. Accurate: else, and within {100 * BOUND:g} % of cos(omega t) over a period of 400 steps. The "
        "product couples by position with a constant multiplier, and refuses integrators that this would give energy. "
        "In the rows, position or velocity is what both sides agree in at the end of a step, with one force all over "
        "it; with Prakash-Hjelmstad the force changes evenly over the step. The others are there to compare.",
        (
            Panel(
                "Mass near / far (stiffness equal)", "mass ratio", "scheme; integrator of the near side", columns, rows
            ),
            Panel("Stiffness near / far (mass equal)", "stiffness ratio", "", columns, rows),
        ),
        tuple(cells),
    )


def run(what: str, ratio: float, scheme: str, integrator: str) -> Verdict:
    """One cell."""

    mass, stiffness = (ratio, 1.0) if what == "mass" else (1.0, ratio)
    solver = _schemes()[scheme]
    worst, at = -1.0, (0.0, 0)
    for step, substeps in itertools.product(STEPS, SUBSTEPS):
        growth = spectral_radius(solver, split(mass, stiffness, integrator, step, substeps)) - 1.0
        if growth > worst:
            worst, at = growth, (step, substeps)
    text = f"spectral radius 1 + {worst:.2g} at {at[0]:g} periods a step, {at[1]} substeps"
    if worst > STABLE:
        grown = energy(solver, split(mass, stiffness, integrator, *at), N_STEPS)
        text += f"; simulated, the energy grows {grown:.1e} times in {N_STEPS} steps"
        if scheme == PRODUCT and "position" not in FACTS[integrator].seams:
            return Verdict("refused", f"the product refuses {integrator} at a seam; {text}")
        return Verdict("unstable", text, None, (), ("the scan of the spectral radius",))
    if scheme == PRODUCT and "position" not in FACTS[integrator].seams:
        return Verdict("refused", f"the product refuses {integrator} at a seam, which grows at other ratios")
    error = max(off(solver, split(mass, stiffness, integrator, FINE, substeps)) for substeps in SUBSTEPS)
    calm = energy(solver, split(mass, stiffness, integrator, *at), N_STEPS)
    text = f"stable at every step; off cos(omega t) by {percent(error)}; energy at most {calm:.3g} times the first"
    if error > BOUND:
        return Verdict("inaccurate", text, error, (), ("the gap at the seam",) if scheme != PRODUCT else ())
    return Verdict("accurate", text, error)


def split(mass: float, stiffness: float, near: str, step: float, substeps: int) -> Split:
    """Mass and stiffness of the near side, of the far side's 1; step in periods of the whole."""

    period = 2.0 * np.pi * np.sqrt((mass + 1.0) / (stiffness + 1.0))
    return Split(
        LinearSide(np.array([[mass]]), np.array([[stiffness]]), np.array([[1.0]])),
        LinearSide(np.eye(1), np.eye(1), -np.eye(1)),
        step * period,
        near,
        "implicit_euler",
        substeps,
    )


def energy(scheme: Scheme, system: Split, n_steps: int) -> float:
    """Largest energy of a simulation, relative to the first, released from rest at 1."""

    step, state = amplification(scheme, system), _packed(_released(system))
    first = most = _energy(system, state)
    for _ in range(n_steps):
        state = step @ state
        most = max(most, _energy(system, state))
        if not most < 1e12 * first:
            break
    return most / first


def off(scheme: Scheme, system: Split) -> float:
    """Largest distance of either side from cos(omega t) over a period, both released from 1 [1]."""

    step, state, worst = amplification(scheme, system), _packed(_released(system)), 0.0
    n = round(1.0 / FINE)
    for i in range(1, n + 1):
        state = step @ state
        true = np.cos(2.0 * np.pi * i / n)
        worst = max(worst, abs(float(state[0]) - true), abs(float(state[4]) - true))
    return worst


def _packed(state: SplitState) -> Floats:
    """Near side (4,), far side (4,) and multiplier as `amplification` takes them (9,)."""
    return np.concatenate([state.near, state.far, state.lambda_])


def _energy(system: Split, state: Floats) -> float:
    return system.near.energy(state[:4]) + system.far.energy(state[4:8])


def _released(system: Split) -> SplitState:
    """Both sides at 1, at rest, with the multiplier that gives them the same acceleration."""
    m_near, k_near = float(system.near.mass[0, 0]), float(system.near.stiffness[0, 0])
    acceleration = -(k_near + 1.0) / (m_near + 1.0)
    one, zero = np.ones(1), np.zeros(1)
    return system.init(one, zero, one, zero, np.array([m_near * acceleration + k_near]))


def _schemes() -> dict[str, Scheme]:
    return dict(
        zip(SCHEMES, (PositionConstant(), VelocityConstant(), PrakashHjelmstad(), GravouilCombescure()), strict=True)
    )
