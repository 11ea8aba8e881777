"""A session begun anew with another scene: the same bits as a session that was opened with it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from held_cube import CLOSE, SCENE

import softseam
from softseam.embedded import EmbeddedBackend
from softseam.errors import BadSnapshot, NotReset, SceneRefused, ServicesFailed
from softseam.recording import Recording
from softseam.scenes import bundle_of, load_scene
from softseam.session import Session
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import Observation
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.materials import AnyMaterial
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport

pytestmark = pytest.mark.kernels

NUMBERS = {
    "modulus": ["body.material.young=30e3"],
    "Poisson's ratio": ["body.material.poisson=0.3"],
    "density": ["body.material.density=1200"],
    "damping": ["body.material.retardation_time=0.02"],
    "gravity": ["gravity=[0, 0, -5]"],
    "friction": ["tools.left.friction=0.1"],
    "friction over the surface": ["body.friction_field={spread: 0.4, length: 0.01}"],
    "pose": ["tools.left.position=[-0.0153, 0.001, 0.016]"],
    "step": ["step=0.005"],
    "size": ["body.shape.size=[0.022, 0.022, 0.022]", "body.cell=0.011", "tools.left.position=[-0.0165, 0, 0.016]",
             "tools.right.position=[0.0165, 0, 0.016]"],
    "cells": ["body.cell=0.005"],
    "regions": ["regions={default: pbd}"],
}  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scene") / "cube.yaml"
    file.write_text(SCENE)
    return file


@pytest.fixture
def backend(path: Path) -> EmbeddedBackend:
    return EmbeddedBackend(bundle_of(path)[1])


@pytest.fixture
def sim(path: Path, backend: EmbeddedBackend) -> Iterator[softseam.Session]:
    with Session(*bundle_of(path), backend) as session:
        yield session


def some_steps(session: softseam.Session) -> list[Any]:
    """What is seen of a few steps with the tools moved by hand."""
    seen = [session.step(CLOSE, count=count) for count in (1, 4)]
    return [(o.time, o.positions.tobytes(), o.cauchy.tobytes(), dict(o.quantities), dict(o.wrench)) for o in seen]


def material(scene: Scene) -> AnyMaterial:
    assert isinstance(scene.body, BodySpec)
    return scene.body.material


def text(seen: list[Any]) -> str:
    """To be compared, arrays and all."""
    return repr(seen)


@pytest.mark.parametrize("settings", NUMBERS.values(), ids=NUMBERS.keys())
def test_the_same_bits_as_opened_with_the_settings(path: Path, sim: softseam.Session, settings: list[str]) -> None:
    sim.reset()
    first = text(some_steps(sim))
    sim.reset(settings=settings)
    here = text(some_steps(sim))
    with softseam.open(path, settings=settings) as other:
        other.reset()
        assert text(some_steps(other)) == here
    assert here != first
    sim.reset(settings=())
    assert text(some_steps(sim)) == first, "settings are of the scene as it was opened"


def test_settings_stay_until_others_are_given_and_do_not_add_up(sim: softseam.Session) -> None:
    sim.reset(settings=NUMBERS["modulus"])
    assert material(sim.scene).young == 30e3
    sim.reset()
    assert material(sim.scene).young == 30e3
    sim.reset(settings=NUMBERS["density"])
    assert (material(sim.scene).young, material(sim.scene).density) == (20e3, 1200)


def test_a_setting_that_is_none_changes_nothing(sim: softseam.Session) -> None:
    """What can be refused without a look at the body is: the run goes on where it is."""
    sim.reset()
    before = sim.step(CLOSE)
    young = "body.material.young"
    for wrong in ("body.material.yuong=3e4", f"{young}=-1", f"{young}=.inf", "tools.lift.friction=1"):
        with pytest.raises((SceneRefused, softseam.BadInput)):
            sim.reset(settings=[wrong])
    assert sim.last is before
    assert sim.step(CLOSE).step == 2


def test_a_scene_that_cannot_be_simulated_leaves_the_one_that_was(sim: softseam.Session) -> None:
    """Its participants find out; the session stands at the start of the scene that it had."""
    sim.reset()
    first = text(some_steps(sim))
    pbd = ["regions={default: pbd}", "models.pbd.method=leapfrog", "models.pbd.substeps=1"]
    unstable = [*pbd, "tools={}", "motion=[]", "duration=1", "quantities=[]"]
    with pytest.raises(SceneRefused, match="leapfrog is unstable"):
        sim.reset(settings=unstable)
    assert sim.scene.regions.near is not None
    with pytest.raises(NotReset):
        sim.step(CLOSE)
    sim.reset()
    assert text(some_steps(sim)) == first


def test_a_scene_whose_answer_is_lost_is_sent_again(
    sim: softseam.Session, backend: EmbeddedBackend, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The backend has the new scene, and its client does not know: the next reset says which one is meant."""
    sim.reset()
    first = text(some_steps(sim))

    def lost(seed: int, bundle: Bundle | None = None) -> Observation:
        EmbeddedBackend.reset(backend, seed, bundle)
        raise ServicesFailed("no answer")

    with monkeypatch.context() as patch:
        patch.setattr(backend, "reset", lost)
        with pytest.raises(ServicesFailed):
            sim.reset(settings=NUMBERS["modulus"])
    assert material(sim.scene).young == 20e3
    sim.reset()
    assert text(some_steps(sim)) == first


def test_another_scene_with_other_bodies_and_tools(sim: softseam.Session, backend: EmbeddedBackend) -> None:
    """From one body to a sheet and back, each as if it were opened; parts that are gone are released."""
    transport = backend.simulation._participants
    assert isinstance(transport, EmbeddedTransport)
    sim.reset()
    some_steps(sim)
    sheet = sim.reset(scene="cloth_fold")
    with softseam.open("cloth_fold") as other:
        opened = other.reset()
        assert sheet.positions.shape == opened.positions.shape
        assert sim.step(count=2).positions.tobytes() == other.step(count=2).positions.tobytes()
    held = {part: list(server.slots) for part, server in transport._servers.items() if server.slots}
    assert held == {"body.far": [("local", "body.far")]}
    sim.reset(scene=load_scene("cantilever"), settings=["body.material.young=2e4"])
    assert sim.scene.name == "cantilever"
    sim.reset(settings=["body.material.density=900"])
    assert sim.scene.name == "cantilever" and material(sim.scene).young != 2e4
    with pytest.raises(SceneRefused, match="no file is called"):
        sim.reset(scene="no_such_scene")


def test_a_snapshot_is_of_the_scene_with_its_numbers(sim: softseam.Session) -> None:
    sim.reset()
    sim.step(CLOSE)
    state = sim.snapshot()
    sim.reset(settings=NUMBERS["modulus"])
    with pytest.raises(BadSnapshot, match="another scene"):
        sim.restore(state)
    sim.reset(settings=())
    assert sim.restore(state).step == 1


def test_a_recording_is_of_the_scene_that_it_shows(path: Path, tmp_path: Path) -> None:
    file = tmp_path / "cube.mcap"
    with softseam.open(path, record=file) as sim:
        sim.reset()
        sim.reset(settings=NUMBERS["modulus"])
        sim.step(CLOSE, count=3)
    recording = Recording(file)
    assert material(recording.scene).young == 30e3
    assert len(list(recording.reports())) == 3
