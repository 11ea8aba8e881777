"""Bodies upon one another: a tower buckles where a column does, and another code finds the same force."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import softseam
from softseam.errors import SoftseamError
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.scene import Scene

WIDTH, YOUNG, DENSITY = 0.05, 2e4, 1050.0
BUCKLES = float(np.cbrt(7.837 * YOUNG * WIDTH**2 / 12.0 / (DENSITY * 9.81)))
"""height at which a column buckles under its own weight [m]: A. G. Greenhill, Proc. Camb. Phil. Soc. 4 (1881), 65-73;
that of three cubes of such tofu is .147, so that they lean"""


def leaning(height: float, model: str) -> float:
    """How far the uppermost of three blocks of one tower is from where it stood, after a push [m]."""
    bodies: dict[str, Any] = {}
    for at in range(3):
        bodies[f"block{at}"] = {
            "shape": {"kind": "block", "size": [WIDTH, WIDTH, height / 3.0]},
            "cell": WIDTH / 2.0,
            "position": [0.0, 0.0, at * height / 3.0],
            "material": {"young": YOUNG, "poisson": 0.3, "density": DENSITY, "retardation_time": 0.01},
        }
    bodies["block2"]["velocity"] = [0.02, 0.0, 0.0]
    data = {"softseam": 1, "name": "tower", "step": 0.01, "duration": 1.6, "bodies": bodies}
    data |= {"tools": {"ground": {"kind": "plane", "friction": 1.0}}, "contacts": {"friction": 0.8}}
    data["regions"] = {"default": model}
    with softseam.open(Scene.model_validate(json.loads(json.dumps(data)))) as sim:
        sim.reset(seed=0)
        ways = [0.0]
        while not sim.done and abs(ways[-1]) < WIDTH:
            ways.append(float(sim.step().bodies["block2"].positions[:, 0].mean()))
    return float(np.abs(ways).max())


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_tower_buckles_where_a_column_does(model: str) -> None:
    """Within 5 % of the height: below it swings, above it falls."""
    assert leaning(0.95 * BUCKLES, model) < 0.006
    assert leaning(1.05 * BUCKLES, model) >= WIDTH


PEER = 3.74
"""force on a stiff cube that sticks to a soft one and is pressed by 4 mm [N]: tests/benchmarks/peer_two_blocks.py with
scikit-fem 12.0.2, 3.813 on cells of 10 mm, 3.773 of 6.7 mm, and from these for cells that vanish"""


@pytest.mark.parametrize("models", [("fem", "fem"), ("pbd", "pbd"), ("fem", "pbd"), ("pbd", "fem")], ids=" on ".join)
def test_another_code_presses_a_stiff_cube_into_a_soft_one_with_the_same_force(models: tuple[str, str]) -> None:
    """Within 2 %."""
    edge, pressed = 0.04, 0.004

    def cube(model: str, height: float, young: float, poisson: float, **keys: Any) -> dict[str, Any]:
        material = {"kind": "neo_hookean", "young": young, "poisson": poisson, "density": 1000.0}
        about = {"shape": {"kind": "block", "size": [edge] * 3}, "cell": edge / 4.0, "position": [0.0, 0.0, height]}
        return about | {"material": material | {"retardation_time": 0.01}, "regions": {"default": model}} | keys

    fixed = [{"min": [-1.0, -1.0, -1e-3], "max": [1.0, 1.0, 1e-3]}]
    bodies = {"lower": cube(models[1], 0.0, 2e4, 0.45, fixed=fixed), "upper": cube(models[0], edge, 3e5, 0.3)}
    data: dict[str, Any] = {"softseam": 1, "name": "pressed", "gravity": [0.0, 0.0, 0.0], "step": 0.01}
    data |= {"bodies": bodies, "contacts": {"friction": 1.0}}
    data["tools"] = {"press": {"kind": "plane", "point": [0.0, 0.0, 2.0 * edge], "normal": [0.0, 0.0, -1.0]}}
    data["motion"] = [{"tools": ["press"], "move": [0.0, 0.0, -pressed], "speed": 0.02}, {"hold": 0.3}]
    with softseam.open(Scene.model_validate(json.loads(json.dumps(data)))) as sim:
        assert float(sim.run().report.wrench[0, 2]) == pytest.approx(PEER, rel=0.02)


def squeezed(models: tuple[str, ...], young: float, step: float) -> StepReport:
    """The end of a run in which three cubes upon one another are pressed by 4 mm."""
    edge, bodies = 0.04, {}
    for at, model in enumerate(models):
        material = {"kind": "neo_hookean", "young": young, "poisson": 0.3, "density": 1000.0, "retardation_time": 0.01}
        bodies[f"cube{at}"] = {
            "shape": {"kind": "block", "size": [edge] * 3},
            "cell": edge / 2.0,
            "position": [0.0, 0.0, at * edge],
            "material": material,
            "regions": {"default": model},
        }
    press = {"kind": "plane", "point": [0.0, 0.0, 3.0 * edge], "normal": [0.0, 0.0, -1.0], "friction": 1.0}
    data = {"softseam": 1, "name": "squeezed", "step": step, "bodies": bodies, "contacts": {"friction": 0.5}}
    data |= {"tools": {"ground": {"kind": "plane", "friction": 1.0}, "press": press}}
    data["motion"] = [{"tools": ["press"], "move": [0.0, 0.0, -0.004], "speed": 0.02}, {"hold": 0.2}]
    with softseam.open(Scene.model_validate(json.loads(json.dumps(data)))) as sim:
        return sim.run().report


@pytest.mark.parametrize("models", [("pbd", "fem", "fem"), ("pbd", "fem", "pbd")], ids=" ".join)
def test_a_guest_is_squeezed_between_a_pile_and_others(models: tuple[str, ...]) -> None:
    """With 55 N, as FEM alone is within 1 %, and what the ground has more than the press is the weights. A body of mass
    m and edge a that dead loads F squeeze topples in a step h from F a = m a^2/(6 h^2) on, here 70 N."""
    alone = squeezed(("fem", "fem", "fem"), 1e6, 0.0025)
    found = squeezed(models, 1e6, 0.0025)
    np.testing.assert_allclose(found.wrench[:, 2], alone.wrench[:, 2], rtol=0.01)
    assert found.wrench[:, 2].sum() == pytest.approx(-3.0 * 0.04**3 * 1000.0 * 9.81, rel=1e-4)


@pytest.mark.parametrize(("young", "step"), [(3e5, 0.005), (2e6, 0.0025)])
def test_a_guest_that_is_squeezed_beyond_that_is_named(young: float, step: float) -> None:
    """It was thrown about in silence, and the press felt nothing in the end."""
    with pytest.raises(SoftseamError, match=r"cube1 fell over.*Take steps of [0-9.]+ ms or shorter"):
        squeezed(("pbd", "fem", "pbd"), young, step)
