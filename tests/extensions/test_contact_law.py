"""A contact law from outside: points of one body's lower face press, without friction, on the plane of another's upper.

w_b are weights of the affine fit to b's face below a point at x of body a: they sum to one and have their centre below
x, so that forces are as large as their reactions, and so are their moments.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest

import softseam
from softseam_coupling.interfaces import KINDS, Meeting, Rows
from softseam_protocol.scene.interfaces import INTERFACES, InterfaceSpec
from softseam_protocol.scene.scene import Scene

PRESSED: list[float] = []  # least and largest multiplier along the normal of each step [N]
EDGE, YOUNG, DENSITY, DRAG, STEP = 0.04, 1e6, 1000.0, 200.0, 5e-3
WEIGHT = 9.81 * DENSITY * EDGE**3
FIRM = 20.0 * YOUNG * EDGE**2 / (0.5 * EDGE)  # twenty times a layer of cells: a weight sinks in by .4 um [N/m]
MODELS, SOLVED = [("fem", "fem"), ("fem", "pbd"), ("pbd", "pbd")], {"fem": {"tolerance": 1e-10}}


class RestsSpec(InterfaceSpec):
    kind: Literal["rests"] = "rests"


class Rests:
    """A row a point: g along the plane's normal is not negative, nor is the force, and one of both is nothing."""

    def __init__(self, spec: RestsSpec, a: Meeting, b: Meeting) -> None:
        faces = a.x_rest[:, 2] < a.x_rest[:, 2].min() + 1e-9, b.x_rest[:, 2] > b.x_rest[:, 2].max() - 1e-9
        self.nodes = tuple(np.flatnonzero(face).astype(np.int32) for face in faces)

    def rows(self, x: tuple[Any, Any], dt: float) -> Rows:
        (points, face), n, middle = x, len(self.nodes[0]), x[1].mean(axis=0)
        axes = np.linalg.svd(face - middle)[2]  # two in the plane, then its normal
        axes[2] *= np.sign(axes[2, 2])
        fit, at = (np.c_[np.ones(len(each)), (each - middle) @ axes[:2].T] for each in (face, points))
        weights = np.eye(n), at @ np.linalg.pinv(fit)
        self.normal = np.tile(axes[2], (n, 1))
        return Rows(weights, np.zeros((n, 3)), compliance=np.full(n, n / FIRM), normal=self.normal)

    def commit(self, x: tuple[Any, Any], multipliers: Any, dt: float) -> None:
        pressed = (multipliers * self.normal).sum(axis=1)
        PRESSED.extend((pressed.min(), pressed.max()))

    def save(self) -> dict[str, Any]:
        return {}

    def load(self, arrays: Any) -> None: ...


@pytest.fixture(autouse=True)
def nothing_pressed() -> None:
    PRESSED.clear()


ROWS = ((INTERFACES, "rests", RestsSpec), (KINDS, "rests", Rests))


def scene(models: tuple[str, str], duration: float, throw: float = 0.0) -> Scene:
    """A stiff cube on another, which stands on the ground; or thrown up with a speed [m/s], without weight and air."""
    cube = {
        "shape": {"kind": "block", "size": [EDGE] * 3},
        "cell": EDGE / 2,
        "material": {"young": YOUNG, "poisson": 0.3, "density": DENSITY},
        "damping": 0.0 if throw else DRAG,
    }
    lower, upper = (cube | {"regions": {"default": model}} for model in models)
    upper |= {"position": [0, 0, EDGE], "velocity": [0, 0, throw]}
    gravity = [0, 0, 0.0 if throw else -9.81]
    data: dict[str, Any] = {"softseam": 1, "name": "rests", "gravity": gravity, "step": STEP, "duration": duration}
    data |= {"bodies": {"lower": lower, "upper": upper}, "tools": {"ground": {"kind": "plane"}}}
    touch = {"touch": {"kind": "rests", "between": ["upper", "lower"]}}
    return Scene.model_validate(data | {"interfaces": touch, "models": SOLVED})


@pytest.mark.parametrize("models", MODELS)
def test_the_ground_carries_two_weights(models: tuple[str, str]) -> None:
    """To 1e-6: swings fade with half the drag, exp(-100 t), to 1e-13 in .3 s; nothing pulls meanwhile.

    Weights shorten the distance of the middles by rho g L^2/E, 16 um, and a little more beneath single points.
    """
    with softseam.open(scene(models, 0.3)) as sim:
        seen = sim.run(fields=True)
    assert -seen.wrench["ground"][2] == pytest.approx(2.0 * WEIGHT, rel=1e-6)
    assert np.abs(seen.wrench["ground"][:2]).max() < 1e-6 * WEIGHT
    assert min(PRESSED) >= 0.0 and max(PRESSED) < WEIGHT
    apart = np.subtract(*(seen.bodies[name].positions.mean(axis=0) for name in ("upper", "lower")))
    np.testing.assert_allclose(apart, (0.0, 0.0, EDGE), rtol=0.0, atol=2.5e-5)


@pytest.mark.parametrize("models", MODELS)
def test_nothing_holds_a_cube_that_is_thrown_up(models: tuple[str, str]) -> None:
    """The lower one stays where it is, and all momentum with the upper one; their interface is idle."""
    with softseam.open(scene(models, 0.05, throw=0.2)) as sim:
        seen = sim.run(fields=True)
    heights = [seen.bodies[name].positions.mean(axis=0)[2] for name in ("lower", "upper")]
    np.testing.assert_allclose(heights, (0.5 * EDGE, 1.5 * EDGE + 0.2 * 0.05), rtol=0.0, atol=1e-12)
    assert seen.report.interfaces["touch"].force == 0.0 and set(PRESSED) == {0.0}


def test_a_restored_pile_settles_with_the_same_bits() -> None:
    with softseam.open(scene(("fem", "pbd"), 0.3)) as sim:
        sim.run(max_steps=5)
        kept = sim.snapshot()
        after = [sim.step() for _ in range(5)]
        sim.restore(kept)
        again = [sim.step() for _ in range(5)]
    for name in ("lower", "upper"):
        one, other = ([each.bodies[name].positions for each in seen] for seen in (after, again))
        np.testing.assert_array_equal(one, other)
