"""Make a surrogate: run a scene with FEM at spread values, and fit polynomials to what its squeezes came to."""

from collections.abc import Callable, Sequence
from time import perf_counter

import numpy as np

from softseam.errors import BadInput, SimulationFailed
from softseam.observation import Observation
from softseam.session import Session, open_as_given
from softseam.variants import AS_GIVEN, with_settings
from softseam_protocol.models import REFERENCE
from softseam_protocol.scene.scene import Scene
from softseam_studies.surrogate.fitting import Curve, common_squeezes, fitted
from softseam_studies.surrogate.surrogate import COVERED, Surrogate, terms
from softseam_studies.surrogate.varied import Varied, spread


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
