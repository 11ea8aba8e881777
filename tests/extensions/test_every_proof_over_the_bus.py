"""Every thing that is added from outside, over the bus: the same bits as in one process, restored, and after deaths.

Services import the proofs beside this, and so their rows; these say that what comes out is right.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_contact_law
import test_discretisation
import test_interface
import test_law_in_every_solver
import test_model_with_a_service
import test_rung
import test_sleep
from extended_services import extended

import softseam
from softseam.pictures import draw_pictures
from softseam.recording import Recording
from softseam.replay import verify
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.scene.file import load_scene, scene_from_bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.supervisor import Supervisor

pytestmark = pytest.mark.slow

MODULES: tuple[Any, ...] = (
    test_interface,
    test_contact_law,
    test_sleep,
    test_law_in_every_solver,
    test_model_with_a_service,
    test_discretisation,
    test_rung,
)
ROWS = tuple(row for module in MODULES for row in module.ROWS)
SERVED = (*(module.__name__ for module in MODULES if module is not test_model_with_a_service), "mass_springs")
"""modules that services import: to them the model's service is another's"""


@dataclass(frozen=True)
class Proof:
    """A scene, steps before a snapshot and after it, and services that die before a step."""

    scene: Callable[[], Scene]
    before: int
    after: int
    deaths: Mapping[int, str] = field(default_factory=dict)


def held(model: str) -> Scene:
    """softseam's own law with state, which takes no row from outside."""
    kept = scene_from_bundle(load_scene(Path(__file__).parents[2] / "scenes" / "tofu_held.yaml").bundle)
    return Scene.model_validate(kept.model_dump(mode="json", exclude_unset=True) | {"regions": {"default": model}})


UP = test_rung.UP
GRAINS = {"regions": {"default": "springs"}}
PROOFS = {
    "interface": Proof(partial(test_interface.scene, ("fem", "pbd"), 0.1), 20, 10, {22: "pbd"}),
    "contact law": Proof(partial(test_contact_law.scene, ("fem", "pbd"), 0.3), 10, 10, {12: "fem"}),
    "sleep": Proof(partial(test_sleep.scene, "fem", sleep=True), 20, 70, {30: "fem"}),
    "what relaxes": Proof(partial(held, "fem"), 20, 10, {22: "fem"}),
    "what relaxes in blocks": Proof(partial(held, "pbd"), 20, 10, {22: "pbd"}),
    "law in parts": Proof(partial(test_law_in_every_solver.scene, "cut"), 20, 10, {15: "fem"}),
    "law that changes its solver": Proof(partial(test_law_in_every_solver.scene, "switched"), 210, 90),
    "model": Proof(test_model_with_a_service.scene, 10, 10, {12: "springs"}),
    "grains": Proof(test_discretisation.scene, 20, 10, {22: "pbd"}),
    "grains of the model": Proof(partial(test_discretisation.scene, **GRAINS), 10, 10, {12: "springs"}),
    "rung": Proof(test_rung.scene, UP + 3, test_rung.STEPS - UP - 3, {UP: "fem", UP + 1: "fem"}),
}


class Services:
    """All of this machine, and the model's own beside them."""

    def __init__(self, where: str, supervised: Supervisor) -> None:
        self.where, self._supervised = where, supervised
        self._start()

    def _start(self) -> None:
        command = [sys.executable, "-m", "mass_springs", "--connect", self.where]
        self._own = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self._own.stdout is not None and "answers" in self._own.stdout.readline()

    def stop(self) -> None:
        self._own.kill()
        self._own.communicate()

    def kill(self, name: str) -> None:
        """Have another take over from a service that dies at once."""
        if name != "springs":
            os.kill(self._supervised.pid(name), signal.SIGKILL)
            return
        self.stop()
        self._start()


@pytest.fixture(scope="module")
def services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    with extended(tmp_path_factory.mktemp("services"), *SERVED) as (where, supervised):
        found = Services(where, supervised)
        yield found
        found.stop()


def taken(sim: softseam.Session, steps: range, services: Services | None = None, proof: Proof | None = None) -> Any:
    """Positions of all bodies, energies and quantities after each of these steps."""
    seen = []
    for step in steps:
        dies = proof is not None and step in proof.deaths
        if services is not None and proof is not None and dies:
            services.kill(proof.deaths[step])
        one = sim.run(fields=True, max_steps=1)
        assert dies == any(event.kind is EventKind.PARTICIPANT_RESTORED for event in one.events)
        seen.append(({name: body.positions for name, body in one.bodies.items()}, one.energies, one.quantities))
    return seen


@pytest.mark.parametrize("name", PROOFS)
def test_it_is_the_run_in_one_process(services: Services, name: str) -> None:
    """To the bit in every step: services die on the way, and it goes on once more from a snapshot."""
    proof = PROOFS[name]
    first, then = range(proof.before), range(proof.before, proof.before + proof.after)
    with softseam.open(proof.scene()) as alone:
        whole = taken(alone, first)
        alone.snapshot()  # solvers forget there what they may compute again
        whole += taken(alone, then)
    with softseam.open(proof.scene(), connect=services.where) as sim:
        before = taken(sim, first, services, proof)
        kept = sim.snapshot()
        after = taken(sim, then, services, proof)
        sim.restore(kept)
        again = taken(sim, then)
    np.testing.assert_equal([*before, *after], whole)
    np.testing.assert_equal(again, after)


@pytest.mark.parametrize("name", ["what relaxes", "what relaxes in blocks", "model", "grains", "grains of the model"])
def test_it_is_recorded_drawn_and_replayed(services: Services, tmp_path: Path, name: str) -> None:
    """The recorder's file of some steps, simulated again in this process."""
    with softseam.open(PROOFS[name].scene(), connect=services.where, record=True) as sim:
        seen = sim.run(fields=True, max_steps=40)
    assert sim.recorded is not None
    recording = Recording(sim.recorded.path)
    *_, last = recording.frames()
    np.testing.assert_array_equal(last.x, seen.positions)
    assert all(path.stat().st_size for path in draw_pictures(recording, tmp_path))
    assert verify(recording).same


def test_the_model_conforms(services: Services) -> None:
    """The kit's solid: springs meet its Young's modulus and Poisson's ratio along the axes."""
    command = [str(Path(sys.executable).with_name("softseam")), "conform", services.where, "--service", "springs"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "springs conforms" in done.stdout, done.stdout + done.stderr
