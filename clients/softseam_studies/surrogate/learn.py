"""Make a surrogate: run a scene with FEM at spread values, fit polynomials to what its squeezes came to, and find what
they are off by."""

import math
from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from softseam.errors import BadInput, SimulationFailed
from softseam.observation import Observation
from softseam.session import Session, open_as_given
from softseam.variants import AS_GIVEN, with_settings
from softseam_protocol.models import REFERENCE
from softseam_protocol.scene.scene import Scene
from softseam_studies.surrogate.surrogate import COVERED, Floats, Surrogate, Varied, spread, terms

Curve = tuple[Floats, Floats]
"""squeezes of a run as its steps end (s,), rising, and the logarithms of its quantities (k, s)"""
SQUEEZES = 16
"""squeezes at which it is given, evenly in their logarithm"""
_LEAST = 0.05
"""the least of them, of the largest [1]: less is hardly a touch"""
_DEGREES = (1, 2, 3)


def learn(
    scene: Scene | str,
    varied: Sequence[Varied],
    quantities: Sequence[str],
    runs: int,
    settings: Sequence[str] = (),
    progress: Callable[[int], None] = lambda done: None,
    seed: int = 0,
) -> Surrogate:
    """A surrogate of a scene whose motion squeezes its body; progress hears how many runs were made.

    Raises BadInput for what cannot be fitted, SceneRefused for values that the scene cannot have, and SimulationFailed.
    """
    least = terms(np.zeros((1, len(varied))), 1).shape[1] + 2
    if runs < max(20, least):
        raise BadInput(f"--runs {runs}: a claim of {COVERED:.0%} needs {max(20, least)} runs at least")
    began, within = perf_counter(), spread(runs, len(varied), seed)
    wanted = f"quantities=[{', '.join(quantities)}]"
    curves = []
    for done, point in enumerate(within):
        values = [one.value(float(at)) for one, at in zip(varied, point, strict=True)]
        chosen = [setting for one, value in zip(varied, values, strict=True) for setting in one.settings(value)]
        with open_as_given(scene, model=REFERENCE, settings=[*settings, *AS_GIVEN, wanted, *chosen]) as session:
            curves.append(_curve(session, quantities, ", ".join(chosen)))
        progress(done + 1)
    squeezes = common_squeezes(curves)
    degree, coefficients, claims = fitted(within, curves, squeezes)
    name = scene if isinstance(scene, str) else scene.name
    taken = perf_counter() - began
    return Surrogate(name, tuple(varied), tuple(quantities), squeezes, degree, coefficients, claims, runs, taken)


def _curve(session: Session, quantities: Sequence[str], values: str) -> Curve:
    """Of a run until the body is squeezed no further. Raises BadInput."""
    squeezes: list[float] = []
    found: list[list[float]] = []

    def see(observation: Observation) -> None:
        squeeze = observation.quantities.get("compression", 0.0)
        if squeeze > max(squeezes, default=0.0):
            squeezes.append(squeeze)
            found.append([observation.quantities[name] for name in quantities])

    try:
        session.run(see, fields=True)
    except SimulationFailed as error:
        raise SimulationFailed(f"with {values}: {error}; vary less, or shorten `step`") from error
    if len(squeezes) < 3:
        raise BadInput(
            f"with {values} the body is squeezed in {len(squeezes)} steps, and 3 are needed: give the scene's motion a "
            "phase that closes two tools, or shorten `step`"
        )
    numbers = np.array(found).T
    for name, row in zip(quantities, numbers, strict=True):
        if not (row > 0.0).all():
            raise BadInput(f"{name} is not positive with {values}, so that it has no logarithm to fit")
    return np.array(squeezes), np.log(numbers)


def checked(scene: Scene, varied: Sequence[Varied], settings: Sequence[str]) -> None:
    """Raise SceneRefused where the scene cannot have a bound, and BadInput where a key is given twice."""
    keys = [key for one in varied for key in one.key.split("+")]
    for key in keys:
        if keys.count(key) > 1:
            raise BadInput(f"--vary: {key} is given twice")
    for one in varied:
        for bound in (one.low, one.high):
            with_settings(scene, [*settings, *one.settings(bound)])


def common_squeezes(curves: Sequence[Curve]) -> Floats:
    """Squeezes that all runs reach (g,). Raises BadInput where there are none."""
    last = min(float(squeezes[-1]) for squeezes, _ in curves)
    first = max(_LEAST * last, *(float(squeezes[0]) for squeezes, _ in curves))
    if not first < last:
        raise BadInput(
            f"one run ends squeezed by {last:.3g}, another one's first step squeezes by {first:.3g}: vary less, or "
            "shorten `step`"
        )
    return np.geomspace(first, last, SQUEEZES)


def fitted(within: Floats, curves: Sequence[Curve], grid: Floats) -> tuple[int, Floats, Floats]:
    """The degree that claims least, coefficients (k, m, g) and claims (k, g), for runs at points (n, d)."""
    n = len(within)
    given_rows = np.stack([[np.interp(np.log(grid), np.log(at), row) for row in rows] for at, rows in curves], axis=1)
    rank = min(n, math.ceil(COVERED * (n + 1))) - 1
    best: tuple[float, int, Floats, Floats] | None = None
    for degree in _DEGREES:
        design = terms(within, degree)
        if 2 * design.shape[1] > n and degree > 1:
            break
        inverse = np.linalg.pinv(design)
        coefficients = inverse @ given_rows
        own = np.einsum("nm,mn->n", design, inverse)  # what a run has of its own fit: left out, it errs by so much more
        others = given_rows - (given_rows - design @ coefficients) / (1.0 - own)[:, None]
        errors = np.stack([_errors(curve, others[:, i], grid) for i, curve in enumerate(curves)], axis=1)
        claims = np.sort(errors, axis=1)[:, rank]
        worth = float(claims.mean())
        if best is None or worth < best[0]:
            best = worth, degree, coefficients, claims
    assert best is not None
    return best[1:]


def _errors(curve: Curve, given_rows: Floats, grid: Floats) -> Floats:
    """Largest error of what is given (k, g) of a run, at its steps around each squeeze of the grid (k, g)."""
    squeezes, values = np.log(curve[0]), curve[1]
    at = np.log(grid)
    error = np.stack(
        [np.abs(np.interp(squeezes, at, line) - row) for line, row in zip(given_rows, values, strict=True)]
    )
    reach = at[1] - at[0]
    found = np.empty_like(given_rows)
    for place, middle in enumerate(at):
        near = np.flatnonzero((np.abs(squeezes - middle) <= reach) & (squeezes >= at[0]) & (squeezes <= at[-1]))
        if not len(near):
            near = np.array([int(np.argmin(np.abs(squeezes - middle)))])
        found[:, place] = error[:, near].max(axis=1)
    return found
