"""How near to breaking a run says it comes, beside a bar's closed form."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import softseam
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.scene.scene import Scene

YOUNG, POISSON, EDGE = 20.0e3, 0.45, 0.02


def bar_stress(stretch: float) -> float:
    """Cauchy stress [Pa] of a neo-Hookean bar whose sides are free: mu (b - 1)/J + lambda ln J/J, across it 0."""
    mu, lambda_ = YOUNG / (2.0 + 2.0 * POISSON), YOUNG * POISSON / (1.0 + POISSON) / (1.0 - 2.0 * POISSON)

    def stress(along: float, volume: float) -> float:
        return float((mu * (along**2 - 1.0) + lambda_ * np.log(volume)) / volume)

    across = brentq(lambda a: stress(a, stretch * a * a), 0.5, 2.0, xtol=1e-14)
    return stress(stretch, stretch * across * across)


def pressed(by: float, model: str = "fem", **material: Any) -> Scene:
    """A cube between a ground and a press without friction, pressed by a share of its height."""
    press = {"kind": "plane", "point": [0.0, 0.0, EDGE], "normal": [0.0, 0.0, -1.0], "friction": 0.0}
    body: dict[str, Any] = {"shape": {"kind": "block", "size": [EDGE] * 3}, "cell": EDGE / 2.0}
    body["material"] = {"young": YOUNG, "poisson": POISSON, "density": 1000.0, "retardation_time": 0.01, **material}
    data = {"softseam": 1, "name": "pressed", "gravity": [0.0, 0.0, 0.0], "step": 0.01, "body": body}
    data |= {"tools": {"floor": {"kind": "plane", "friction": 0.0}, "press": press}, "regions": {"default": model}}
    move = {"tools": ["press"], "move": [0.0, 0.0, -by * EDGE], "speed": by * EDGE / 0.5}
    return Scene.model_validate(data | {"motion": [move, {"hold": 0.5}]})


def run(scene: Scene) -> tuple[dict[str, float], list[str]]:
    """Quantities at the end, and what was said of breaking."""
    said: list[str] = []
    with softseam.open(scene) as sim:
        sim.reset()
        while True:
            seen = sim.step()
            said += [event.message for event in seen.events if event.kind is EventKind.BREAKS]
            if seen.done:
                return dict(seen.quantities), said


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_pressed_cube_says_its_share_of_breaking(model: str) -> None:
    """By 15 %: within 1 % of the closed form over the strength, and no event below 1."""
    strength = 1.6 * abs(bar_stress(0.85))
    end, said = run(pressed(0.15, model, strength=strength))
    assert end["stress_over_strength"] == pytest.approx(1.0 / 1.6, rel=0.01) and not said


def test_what_would_break_is_one_event_with_place_and_time() -> None:
    """Half way there: at 10 % of 20; it stays whole, and the event says so."""
    strength = abs(bar_stress(0.9))
    end, said = run(pressed(0.2, strength=strength))
    assert end["stress_over_strength"] == pytest.approx(abs(bar_stress(0.8)) / strength, rel=0.01)
    assert len(said) == 1
    time = float(said[0].split(" s;")[0].rsplit(" ", 1)[1])
    assert 0.25 <= time <= 0.31, "looked at every fifth step"
    assert all(word in said[0] for word in ("would break", f"{strength:g} Pa", " m at ", "no fracture"))


def test_nothing_is_said_without_a_strength() -> None:
    end, said = run(pressed(0.2))
    assert "stress_over_strength" not in end and not said


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_of_several_bodies_those_say_it_that_have_a_strength(model: str) -> None:
    """Two cubes under one press: the one of which a material says its strength, at the same share as alone."""
    strength = 1.6 * abs(bar_stress(0.85))
    data = pressed(0.15, model).model_dump(mode="json", by_alias=True)
    body = data.pop("body")
    named = {**body, "position": [0.05, 0.0, 0.0], "material": {**body["material"], "strength": strength}}
    data |= {"bodies": {"plain": body, "named": named}, "quantities": ["stress_over_strength"]}
    end, said = run(Scene.model_validate(data))
    assert "plain.stress_over_strength" not in end and not said
    assert end["named.stress_over_strength"] == pytest.approx(1.0 / 1.6, rel=0.01)
