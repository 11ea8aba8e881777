"""A material law from outside: Gent's rubber, whose chains straighten, with a parameter of its own.

psi = -mu L/2 ln(1 - i1/L) - mu ln J + lambda/2 ln(J)^2,  i1 = I1 - 3 < L
(Gent, Rubber Chem. Technol. 69, 1996, with the volume part of softseam's neo-Hookean solid).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
import pytest
from pydantic import Field
from scipy.optimize import brentq

import softseam
from softseam_protocol.scene.materials import MATERIALS, MaterialSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.materials import LAWS, Law


class Gent(MaterialSpec):
    kind: Literal["gent"] = "gent"
    limit: float = Field(gt=0.0, description="I1 - 3 at which chains are straight [1]")


def response(i1, i2, j, parameters):  # type: ignore[no-untyped-def]
    mu, lam, limit = parameters[0], parameters[1], parameters[2]
    left, log, J = limit - i1, np.log1p(j), 1.0 + j
    psi = -0.5 * mu * limit * np.log1p(-i1 / limit) - mu * log + 0.5 * lam * log * log
    d1, d11 = 0.5 * mu * limit / left, 0.5 * mu * limit / (left * left)
    return psi, d1, 0.0, (lam * log - mu) / J, d11, 0.0, 0.0, 0.0, 0.0, (lam * (1.0 - log) + mu) / (J * J)


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    MATERIALS.add("gent", Gent)
    LAWS.add("gent", Law(lambda spec, elastic: (elastic.mu, elastic.lambda_, spec.limit), response))
    yield
    MATERIALS.remove("gent")
    LAWS.remove("gent")


EDGE, YOUNG, POISSON, LIMIT = 0.05, 20e3, 0.45, 0.8
PLATE = {"kind": "box", "size": [0.01, 0.2, 0.2], "friction": 0.0}
SCENE = {
    "softseam": 1,
    "name": "gent",
    "gravity": [0, 0, 0],
    "body": {
        "shape": {"kind": "block", "size": [EDGE] * 3},
        "cell": EDGE / 2,
        "material": {"kind": "gent", "young": YOUNG, "poisson": POISSON, "density": 1050, "limit": LIMIT},
    },
    "tools": {"left": PLATE | {"position": [-0.0301, 0, 0.025]}, "right": PLATE | {"position": [0.0301, 0, 0.025]}},
    "motion": [{"tools": ["left", "right"], "close": 0.05, "until": {"compression": 0.3}}, {"hold": 0.5}],
    "quantities": ["grip_force", "compression"],
}


def force(stretch: float, limit: float = LIMIT) -> float:
    """Of a bar with free sides [N]: P = 0 across it."""
    mu, lam = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))

    def stress(along: float, across: float) -> float:
        chains = limit / (limit + 3 - stretch**2 - 2 * across**2)
        return float(mu * (chains * along - 1 / along) + lam * np.log(stretch * across**2) / along)

    across = brentq(lambda b: stress(b, b), 0.9, 1.25, xtol=1e-14)
    return float(-stress(stretch, across) * EDGE**2)


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_law_from_outside_meets_its_closed_form(model: Literal["fem", "pbd"]) -> None:
    """A cube squeezed by 30 % between smooth plates; chains that straighten make it a sixth stiffer."""
    with softseam.open(softseam.with_model(Scene.model_validate(SCENE), model)) as sim:
        sim.reset(seed=0)
        while not sim.done:
            seen = sim.step()
    stretch = 1 - seen.quantities["compression"]
    assert seen.grip_force == pytest.approx(force(stretch), rel=1e-6)
    assert force(stretch) > 1.17 * force(stretch, limit=1e9)


def test_a_kind_without_a_law_fails_at_start() -> None:
    MATERIALS.add("forgotten", Gent)
    try:
        with pytest.raises(softseam.BadInput, match="table of material laws: no row 'forgotten'"):
            softseam.open(Scene.model_validate(SCENE))
    finally:
        MATERIALS.remove("forgotten")
