"""An interface from outside: a pad, which springs and damps between a face of one body and a face of another.

Two blocks of mass m that it joins swing about one another as two masses on a spring: T = 2 pi sqrt(m/(2 k)).
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
from pydantic import Field

import softseam
from softseam_coupling.interfaces import KINDS, Meeting, Rows
from softseam_protocol.scene.interfaces import INTERFACES, InterfaceSpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Positive


class PadSpec(InterfaceSpec):
    kind: Literal["pad"] = "pad"
    stiffness: Positive = Field(description="force over the pad's stretch [N/m]")
    damping: float = Field(default=0.0, ge=0.0, description="force over the rate of its stretch [N s/m]")


class Pad:
    """One row: the mean of one face is drawn to that of the other, lambda = -k (g - g_0) - c g'."""

    def __init__(self, spec: PadSpec, a: Meeting, b: Meeting) -> None:
        faces = a.x_rest[:, 2] > a.x_rest[:, 2].max() - 1e-9, b.x_rest[:, 2] < b.x_rest[:, 2].min() + 1e-9
        self.nodes = tuple(np.flatnonzero(face).astype(np.int32) for face in faces)
        first, second = (np.full((1, len(nodes)), 1.0 / len(nodes)) for nodes in self.nodes)
        self.weights = first, second
        self.spec, self.rest = spec, self.stretch(a.x_rest[self.nodes[0]], b.x_rest[self.nodes[1]])
        self.last = self.rest

    def stretch(self, x_a: Any, x_b: Any) -> Any:
        return self.weights[0] @ x_a - self.weights[1] @ x_b

    def rows(self, x: tuple[Any, Any], dt: float) -> Rows:
        k, rate = self.spec.stiffness, self.spec.damping / dt
        offset = (k * self.rest + rate * self.last) / (k + rate)
        return Rows(self.weights, offset, compliance=np.array([1.0 / (k + rate)]))

    def commit(self, x: tuple[Any, Any], multipliers: Any, dt: float) -> None:
        self.last = self.stretch(*x)

    def save(self) -> dict[str, Any]:
        return {"last": self.last}

    def load(self, arrays: Any) -> None:
        self.last = arrays["last"]


ROWS = ((INTERFACES, "pad", PadSpec), (KINDS, "pad", Pad))
EDGE, DENSITY, STIFFNESS, SPEED, STEP = 0.04, 1000.0, 50.0, 0.02, 1e-3
MASS = DENSITY * EDGE**3
PERIOD = 2.0 * np.pi * np.sqrt(0.5 * MASS / STIFFNESS)


def scene(models: tuple[str, str], damping: float = 0.0) -> Scene:
    """Two stiff blocks, one above the other, that part with SPEED each."""
    block = {
        "shape": {"kind": "block", "size": [EDGE] * 3},
        "cell": EDGE / 2,
        "material": {"young": 1e6, "poisson": 0.3, "density": DENSITY},
    }
    places = zip(("lower", "upper"), models, (-SPEED, SPEED), (0.0, EDGE + 0.01), strict=True)
    bodies = {
        name: block | {"position": [0, 0, z], "velocity": [0, 0, v], "regions": {"default": model}}
        for name, model, v, z in places
    }
    pad = {"kind": "pad", "between": ["lower", "upper"], "stiffness": STIFFNESS, "damping": damping}
    data = {"softseam": 1, "name": "pad", "gravity": [0, 0, 0], "step": STEP, "duration": 2.5 * PERIOD}
    return Scene.model_validate(data | {"bodies": bodies, "interfaces": {"pad": pad}})


def stretches(of: Scene) -> tuple[Any, Any]:
    """How far the blocks' middles went apart after each step [m], and all momentum on the way [kg m/s]."""
    with softseam.open(of) as sim:
        seen = [sim.reset(seed=0)]
        while not sim.done:
            seen.append(sim.step())
    middles = [[one.bodies[name].positions.mean(axis=0)[2] for name in ("upper", "lower")] for one in seen]
    return np.subtract(*np.transpose(middles)) - EDGE - 0.01, np.array([one.momentum for one in seen[1:]])


@pytest.mark.parametrize("models", [("fem", "fem"), ("fem", "pbd"), ("pbd", "pbd")])
def test_two_blocks_swing_as_two_masses_on_a_spring(models: tuple[str, str]) -> None:
    """Period within 1 %, momentum to 1e-8; with a damper the swing fades by its logarithmic decrement, to 5 %."""
    stretch, momentum = stretches(scene(models))
    changes = np.flatnonzero(np.diff(np.sign(stretch[2:])))[:4] + 2
    at = changes - stretch[changes] / (stretch[changes + 1] - stretch[changes])
    assert 2.0 * STEP * np.diff(at).mean() == pytest.approx(PERIOD, rel=0.01)
    assert np.abs(momentum).max() < 1e-8 * MASS * SPEED
    assert stretch.max() == pytest.approx(2.0 * SPEED * PERIOD / (2.0 * np.pi), rel=0.05)
    damping = 0.1 * np.sqrt(STIFFNESS * MASS / 2.0)
    damped, _ = stretches(scene(models, damping))
    half = round(0.5 * PERIOD / STEP)
    peaks = damped[:half].max() / stretch[:half].max(), -damped[half : 2 * half].min() / -stretch[half : 2 * half].min()
    assert peaks[1] / peaks[0] == pytest.approx(np.exp(-np.pi * 0.05), rel=0.05)


def test_what_a_pad_did_is_part_of_a_snapshot() -> None:
    with softseam.open(scene(("fem", "pbd"), 0.1)) as sim:
        sim.reset(seed=0)
        for _ in range(20):
            sim.step()
        kept = sim.snapshot()
        after = [sim.step() for _ in range(5)]
        sim.restore(kept)
        again = [sim.step() for _ in range(5)]
    for one, other in zip(after, again, strict=True):
        for name in ("lower", "upper"):
            np.testing.assert_array_equal(one.bodies[name].positions, other.bodies[name].positions)
