"""The Python client and the command line through real services: the same as in one process, bit for bit."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from real_services import Services, free_port, squeezed_bar
from trajectory import bits

import softseam
from softseam import connected
from softseam.recording import Recording
from softseam_protocol.bus.client import Router
from softseam_protocol.scene.file import scene_json

SQUEEZE = {"front": [0.0, 0.02, 0.0], "back": [0.0, -0.02, 0.0]}


def test_same_bits_as_embedded(services: Services) -> None:
    """Positions, stresses, multipliers and quantities; by hand and along the scene's motion."""
    services.wait_well()
    seen = []
    for endpoint in (None, services.endpoint):
        with softseam.open(squeezed_bar(), endpoint) as sim:
            sim.reset(seed=2)
            sim.step(SQUEEZE, count=5, fields=False)
            sim.step({"front": [0.0, 0.02, 0.0, 0.1, 0.5, 1.0], "back": [0.0, -0.02, 0.0]})
            obs = sim.step(SQUEEZE)
            later = sim.run(max_steps=5, fields=True)
            seen.append(
                (
                    [o.positions.tobytes() for o in (obs, later)],
                    [o.cauchy.tobytes() for o in (obs, later)],
                    dict(later.quantities),
                    (obs.step, obs.time, later.step, later.time),
                    obs.seam.gap,
                )
            )
    assert seen[0] == seen[1]


def test_a_body_that_turns_has_the_same_bits(services: Services) -> None:
    """What its rotation is given back is the whole body's: parts in processes of their own are told of it, and steps
    that begin with the correction of the one before are as if begun one by one."""
    services.wait_well()
    scene, seen = squeezed_bar(), []
    spins = scene.with_body(scene.body.model_copy(update={"spin": (4.0, 0.0, 9.0), "fixed": ()}))
    for endpoint in (None, services.endpoint):
        with softseam.open(spins.model_copy(update={"gravity": (0.0, 0.0, 0.0)}), endpoint) as sim:
            sim.reset()
            later = [sim.step(), sim.run(max_steps=6, fields=True)]
            seen.append([(o.positions.tobytes(), list(o.angular_momentum), o.step) for o in later])
    assert seen[0] == seen[1]


def test_every_step_of_a_run_is_seen(services: Services) -> None:
    """Observations that come several at a time over the bus: all of them, in order, with the bits of single steps."""
    services.wait_well()
    seen = []
    for endpoint in (None, services.endpoint):
        with softseam.open(squeezed_bar(), endpoint) as sim:
            steps: list[softseam.Observation] = []
            sim.run(steps.append, max_steps=7)
            assert sim.last is steps[-1] and sim.last.step == 7
            last = sim.run(steps.append)
            assert last.done and last.step == 60
            seen.append([(o.step, o.time, o.done, bits(o.report), [e.message for e in o.events]) for o in steps])
    assert [entry[0] for entry in seen[1]] == list(range(1, 61))
    assert seen[0] == seen[1]


def test_another_scene_in_the_same_session(services: Services) -> None:
    """Begun anew with other numbers, refused ones between: over the bus the same bits as in one process."""
    services.wait_well()
    seen = []
    for endpoint in (None, services.endpoint):
        with softseam.open(squeezed_bar(), endpoint) as sim:
            sim.reset()
            sim.step(SQUEEZE, count=2)
            sim.reset(settings=["body.material.young=5e4", "tools.front.friction=0.2"])
            softer = [bits(sim.step(SQUEEZE).report) for _ in range(4)]
            unstable = ["regions={default: pbd}", "models.pbd.method=leapfrog", "models.pbd.substeps=1", "tools={}"]
            with pytest.raises(softseam.SceneRefused, match="leapfrog is unstable"):
                sim.reset(settings=[*unstable, "motion=[]", "duration=1", "quantities=[]"])
            with pytest.raises(softseam.NotReset):
                sim.step(SQUEEZE)
            sim.reset(settings=())
            seen.append((softer, [bits(sim.step(SQUEEZE).report) for _ in range(4)]))
    assert seen[0] == seen[1]
    assert seen[0][0] != seen[0][1]


def test_snapshot_travels(services: Services) -> None:
    """A snapshot taken over the bus continues in this process, bit for bit, and the other way round."""
    services.wait_well()
    with softseam.open(squeezed_bar(), services.endpoint) as far, softseam.open(squeezed_bar()) as here:
        far.reset()
        here.reset()
        far.step(SQUEEZE, count=4)
        here.restore(far.snapshot())
        assert here.last.step == far.last.step == 4
        assert here.step(SQUEEZE).positions.tobytes() == far.step(SQUEEZE).positions.tobytes()
        far.restore(here.snapshot())
        assert here.step(SQUEEZE).positions.tobytes() == far.step(SQUEEZE).positions.tobytes()


def test_bad_input_changes_nothing(services: Services) -> None:
    services.wait_well()
    with softseam.open(squeezed_bar(), services.endpoint) as sim:
        with pytest.raises(softseam.NotReset):
            sim.step()
        sim.reset()
        with pytest.raises(softseam.BadSnapshot):
            sim.restore(b"words")
        with pytest.raises(softseam.UnknownTool):
            sim.step({"side": [0.0, 0.0, 0.0]})
        assert sim.step(SQUEEZE).step == 1
    with pytest.raises(softseam.SessionClosed):
        sim.step(SQUEEZE)


def test_other_schema_version(services: Services, monkeypatch: pytest.MonkeyPatch) -> None:
    """A client of another version is told so by name."""
    services.wait_well()
    monkeypatch.setattr(connected, "SCHEMA_VERSION", 99)
    with pytest.raises(softseam.SchemaMismatch, match="99"):
        softseam.open(squeezed_bar(), services.endpoint)


def test_nobody_behind_the_router() -> None:
    """A router without an orchestrator: one error that says what to start."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with Router(endpoint), pytest.raises(softseam.NoConnection, match="softseam up"):
        softseam.open(squeezed_bar(), endpoint, timeout=2.0)


@pytest.mark.slow
def test_run_connected(services: Services, tmp_path: Path) -> None:
    """`softseam run --connect` writes the report here and brings the recorder's file."""
    services.wait_well()
    scene = tmp_path / "bar.yaml"
    scene.write_text(scene_json(squeezed_bar()))
    command = [sys.executable, "-m", "softseam.cli", "run", str(scene), "--connect", services.endpoint]
    done = subprocess.run(
        [*command, "--record", str(tmp_path / "bar.mcap"), "--report", str(tmp_path / "bar.json")],
        env={**os.environ, "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "bar.json").read_text())
    assert report["steps"] == 60
    assert report["claims"]["settled"] and report["claims"]["sibling"]["settings"][0] == "step=0.02"
    assert f"± {report['claims']['quantities']['grip_force']['end']['absolute']:.2g} N" in done.stdout
    assert report["recording"]["lost_messages"] == 0
    recording = Recording(tmp_path / "bar.mcap")
    assert recording.note is None
    assert recording.counts["StepReport"] == 60
