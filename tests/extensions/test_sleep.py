"""A rule to sleep and a reason to wake from outside: what is at rest sleeps, until a tool is near.

Without gravity a block at rest stays where it is, so that sleeping changes nothing but rounding: a run in which it
sleeps, and one in which it never does, agree to 1e-12 m, before a tool wakes it and while that tool presses it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import softseam
from softseam_coupling.sleep import SLEEP, WAKE, Mask, Neighbourhood, Reasons
from softseam_protocol.messages.participant import Advance, Configure, Reply, Request
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

EDGE, RADIUS, SPEED, STEP = 0.04, 0.01, 0.1, 5e-3
NEAR, REST = 0.02, 1e-24
"""how far from a block's box a ball's surface wakes it [m]; least kinetic energy that is more than rounding [J]"""


def may_sleep(around: Neighbourhood) -> Mask:
    """A rule: bodies that are at rest."""
    return np.asarray(around.kinetic <= REST)


def near(around: Neighbourhood) -> Reasons:
    """A reason: a ball is near a body."""
    (position,), (tool,) = around.position, around.tools
    away = np.linalg.norm(np.maximum(np.maximum(around.low - position, position - around.high), 0.0), axis=1)
    return {
        body: f"{tool} is {1e3 * (away[body] - RADIUS):.0f} mm from {around.names[body]}"
        for body in np.flatnonzero(away < RADIUS + NEAR).tolist()
    }


ROWS = ((SLEEP, "at_rest", may_sleep), (WAKE, "ball_is_near", near))


class Counting(EmbeddedTransport):
    """It counts how often each body is asked to advance, by itself or in a pile."""

    def __init__(self) -> None:
        super().__init__()
        self.asked = {"still": 0, "busy": 0}
        self._bodies: dict[str, list[str]] = {}

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        for part, request in requests.items():
            if isinstance(request, Configure):
                self._bodies[part] = request.bodies or [request.body]
            if isinstance(request, Advance):
                for place, body in enumerate(self._bodies[part]):
                    self.asked[body] += not (len(request.asleep) and request.asleep[place])
        return super().exchange(requests)


def scene(model: str, sleep: bool) -> Scene:
    """Two blocks apart, one that spins, and one at rest, onto which a ball comes down from 4 cm above."""
    block = {
        "shape": {"kind": "block", "size": [EDGE] * 3},
        "cell": EDGE / 2,
        "material": {"young": 2e4, "poisson": 0.3, "density": 1000.0},
    }
    bodies = {"still": block, "busy": block | {"position": [0.5, 0, 0], "spin": [1.0, 2.0, 3.0]}}
    ball = {"kind": "sphere", "radius": RADIUS, "position": [0, 0, EDGE + 0.04 + RADIUS]}
    data: dict[str, Any] = {"softseam": 1, "name": "sleep", "gravity": [0, 0, 0], "step": STEP, "duration": 0.45}
    data |= {"bodies": bodies, "tools": {"ball": ball}, "regions": {"default": model}}
    data |= {"motion": [{"tools": ["ball"], "move": [0, 0, -0.043], "speed": SPEED}], "models": SOLVED}
    return Scene.model_validate(data | ({"sleep": "at_rest"} if sleep else {}))


SOLVED = {"fem": {"tolerance": 1e-12}}
STEPS, WAKES = 90, round((0.04 - NEAR) / SPEED / STEP)
"""of the run; by whose end the ball is near"""


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_nothing_is_asked_of_what_sleeps_until_a_tool_is_near(model: str) -> None:
    """The block at rest is asked until it sleeps, in a step or two, and again from when the ball is near."""
    transport = Counting()
    simulation = Simulation(bundle_scene(scene(model, sleep=True)), transport)
    counts = [dict(transport.asked)]
    while not simulation.done:
        simulation.step()
        counts.append(dict(transport.asked))
    simulation.close()
    still, busy = (np.diff([count[name] for count in counts]) for name in ("still", "busy"))
    assert busy.all() and not still[2 : WAKES - 1].any() and still[WAKES + 1 :].all()
    (woken,) = (event for event in simulation.events if "mm from still" in event.message)
    assert abs(woken.header.step - WAKES) <= 1


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_run_with_sleep_is_the_run_without(model: str) -> None:
    """To 1e-12 m in every step, the press by 3 mm included; restored in its sleep, it goes on with the same bits."""
    with softseam.open(scene(model, sleep=True)) as slept, softseam.open(scene(model, sleep=False)) as awake:
        whole = taken(awake, STEPS)
        before, kept = taken(slept, WAKES // 2), slept.snapshot()
        after = taken(slept, STEPS - len(before))
        slept.restore(kept)
        again = taken(slept, len(after))
    assert np.abs(whole[-1] - whole[0]).max() > 3e-3
    np.testing.assert_allclose([*before, *after], whole, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(after, again)


def taken(sim: softseam.Session, steps: int) -> list[Any]:
    """Positions of the block that rests after each of so many steps."""
    return [sim.run(fields=True, max_steps=1).bodies["still"].positions for _ in range(steps)]
