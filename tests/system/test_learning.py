"""`softseam train` and `softseam evaluate`: a short training is kept, goes on and is judged; what is spoilt is refused.

Needs stable-baselines3, which continuous integration installs; elsewhere: pip install 'softseam[learn]'.
"""

from __future__ import annotations

import json
import os
import signal
import threading
import time
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib.util import find_spec
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from softseam.errors import BadInput
from softseam.gym.batch_env import BatchEnv
from softseam.recording import Recording
from softseam_studies.cli_learning import Evaluate as Judgement
from softseam_studies.cli_learning import Train as Wishes
from softseam_studies.learn import train as training
from softseam_studies.learn.check import Beside
from softseam_studies.learn.evaluate import evaluate
from softseam_studies.learn.policy import POLICY, TRAINING, read_training
from softseam_studies.learn.tasks import TASKS, Stage
from softseam_studies.learn.train import train

learns = pytest.mark.skipif(
    find_spec("stable_baselines3") is None and not os.environ.get("CI"), reason="pip install 'softseam[learn]'"
)
DOCUMENT = {
    "softseam_training": 1,
    "task": "TofuLift",
    "algorithm": "ppo",
    "seed": 0,
    "environments": 2,
    "steps": 9,
    "curve": [],
}
"""of a training that was never begun"""


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """After one rollout, of eight pieces."""
    folder = tmp_path_factory.mktemp("trained") / "policy"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "ROW", 200)
        said = Console(file=StringIO())
        train(Wishes(steps=400, environments=8, out=folder), said)
    assert isinstance(said.file, StringIO)
    assert "softseam evaluate" in said.file.getvalue() and "replayed by FEM" in said.file.getvalue()
    return folder


@learns
@pytest.mark.slow
def test_a_training_is_kept_and_goes_on(trained: Path) -> None:
    """With its own count of steps, which the weight of stress grows with."""
    found = read_training(trained)
    assert found.done == 2048 and found.task == "TofuLift" and found.seconds > 0.0
    assert (trained / "curve.png").stat().st_size > 10_000
    with pytest.raises(BadInput, match="--resume"):
        train(Wishes(out=trained), Console(quiet=True))
    with pytest.raises(BadInput, match="2048 steps already"):
        train(Wishes(out=trained, resume=True), Console(quiet=True))
    assert found.checks and 0 < found.checks[0].steps <= 2048
    train(Wishes(out=trained, steps=2100, resume=True, check=False), Console(quiet=True))
    more = read_training(trained)
    assert more.checks == found.checks  # kept, and none without asking
    spread = training.algorithm("ppo").load(trained / POLICY).policy.log_std.detach().numpy()
    assert spread == pytest.approx(TASKS["TofuLift"].spread[1], abs=0.15)  # 2048 of 2100 steps
    assert more.done == 4096 and more.seconds > found.seconds and more.curve[: len(found.curve)] == found.curve


@learns
@pytest.mark.slow
def test_a_training_goes_from_stage_to_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """When a part of it is over, and enough succeed; resumed, in the stage that it was in. FEM follows."""
    batches: list[str] = []

    class Seen(BatchEnv):
        def __init__(self, *given: Any, settings: Sequence[str], **named: Any) -> None:
            super().__init__(*given, settings=settings, **named)
            batches.append(settings[0])

    stages = (Stage(0.025, part=0.5), Stage(0.05))
    monkeypatch.setitem(TASKS, "TofuLift", replace(TASKS["TofuLift"], batch=Seen, stages=stages))
    wishes = Wishes(environments=8, steps=2000, out=tmp_path, check=False)
    train(wishes, Console(quiet=True))
    found = read_training(tmp_path)
    assert found.done == 2048 and found.stages == stages and found.begun == ()
    said = Console(file=StringIO())
    train(replace(wishes, steps=4000, resume=True, check=True), said)
    found = read_training(tmp_path)
    assert isinstance(said.file, StringIO) and "cells of 50 mm from 2,048 steps on" in said.file.getvalue()
    assert found.done == 4096 and found.begun == (2048,) and found.checks[0].steps > 2048
    training.vectorised(found).close()
    replace(found, stages=(replace(stages[0], success=1.1), stages[1]), begun=()).write(tmp_path)
    train(replace(wishes, steps=4200, resume=True), Console(quiet=True))
    assert read_training(tmp_path).begun == ()
    coarse, fine = (f"body.cell=[{cell}, {cell}, {cell}]" for cell in (0.025, 0.05))
    assert batches == [coarse, coarse, fine, fine, coarse]


@pytest.mark.parametrize(
    ("wishes", "stages"),
    [
        (Wishes(), TASKS["TofuLift"].stages),
        (Wishes(stages=False), ()),
        (Wishes(model="fem"), ()),
        (Wishes(settings=("body.cell=[0.01, 0.01, 0.01]",)), ()),
    ],
)
def test_cells_that_are_asked_for_have_no_stages(wishes: Wishes, stages: tuple[Stage, ...]) -> None:
    assert training.stages_of(wishes) == stages


@learns
@pytest.mark.slow
def test_sac_learns_from_the_batch_too(tmp_path: Path) -> None:
    """Short of learning anything: its network moves from where it began."""
    moved = []
    for steps in (80, 600):  # it begins after 100
        folder = tmp_path / str(steps)
        train(Wishes(algorithm="sac", environments=4, steps=steps, out=folder, check=False), Console(quiet=True))
        assert read_training(folder).done == steps
        learner = training.algorithm("sac").load(folder / POLICY)
        moved.append(learner.policy.state_dict()["actor.mu.bias"].numpy())
    assert abs(moved[1] - moved[0]).max() > 1e-4


@learns
@pytest.mark.slow
@pytest.mark.parametrize(
    ("sent", "steps", "told"),
    [
        (signal.SIGKILL, 80, "none, as its process ended by itself, with code -9; evaluate judges the policy by FEM"),
        (None, 80, "none, as no episode of the first environment was over that it could replay"),
        (signal.SIGSTOP, 1000, "none, as its process still compiled, or replayed the first"),
    ],
)
def test_a_training_without_checks_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sent: signal.Signals | None, steps: int, told: str
) -> None:
    """The process is killed; has nothing to do; is as slow as where it compiles all that training takes."""

    class Sent(Beside):
        def __init__(self, *given: Any) -> None:
            super().__init__(*given)
            if sent is not None:
                self.child.process.send_signal(sent)
            if sent is signal.SIGKILL:
                self.child.process.wait()

    monkeypatch.setattr(training, "Beside", Sent)
    monkeypatch.setattr(training, "WAIT", 0.1)
    said = Console(file=StringIO(), width=120)
    train(Wishes(algorithm="sac", environments=4, steps=steps, out=tmp_path / "out"), said)
    assert isinstance(said.file, StringIO)
    assert f"episodes checked by FEM: {told}" in said.file.getvalue()
    assert read_training(tmp_path / "out").done == steps


@learns
@pytest.mark.slow
def test_a_policy_is_judged_beside_rules(trained: Path, tmp_path: Path) -> None:
    """On pieces of its own; the rule that presses by 2 N lifts them all, and an episode can be replayed."""
    said = Console(file=StringIO(), width=120)
    found = evaluate(Judgement(trained, pieces=3, step=0.04, record=tmp_path / "episodes"), said)
    assert list(found) == ["the policy", "close to 1 N", "close to 2 N", "squeeze by 15 %"]
    assert (found["close to 2 N"].ending == "lifted").all()
    assert 500.0 < found["close to 2 N"].hardship.mean() < found["squeeze by 15 %"].hardship.mean()
    assert isinstance(said.file, StringIO)
    told = said.file.getvalue()
    assert "100.0%" in told and "softseam replay" in told and "TofuLift, judged: 12 of 12 episodes" in told
    recorded = sorted((tmp_path / "episodes").glob("*.mcap"))
    assert recorded and Recording(recorded[0]).counts["StepReport"] > 5


@pytest.fixture
def interruptible() -> Iterator[None]:
    """A process that a shell has put into the background ignores interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@learns
@pytest.mark.slow
@pytest.mark.usefixtures("interruptible")
def test_an_interrupted_training_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By Ctrl-C in the middle of a step of the environments."""
    monkeypatch.setattr(training, "SAVE", 100)
    folder, said = tmp_path / "policy", Console(file=StringIO())

    def interrupt() -> None:
        end = time.monotonic() + 240.0
        while not (folder / TRAINING).exists() and time.monotonic() < end:
            time.sleep(0.05)  # nothing announces a file
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    other = threading.Thread(target=interrupt)
    other.start()
    with pytest.raises(KeyboardInterrupt):
        train(Wishes(environments=2, steps=4000, out=folder), said)
    other.join()
    assert isinstance(said.file, StringIO) and "go on with: softseam train --resume" in said.file.getvalue()
    assert read_training(folder).done >= 100


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda document: document | {"task": "TofuThrow"}, "no task is called 'TofuThrow'"),
        (lambda document: document | {"version": 99}, "a policy of version 99"),
        (lambda document: document | {"algorithm": "td3"}, r"nothing learns by 'td3' \(ppo or sac\)"),
        (lambda document: document | {"softseam_training": 2}, "another version of softseam"),
        (lambda document: {"softseam_training": 1}, "is corrupt"),
        (lambda document: document | {"checks": [{"steps": 5, "xpbd": [], "fem": []}]}, "is corrupt"),
        (lambda document: document | {"stages": [{"cells": 3}]}, "is corrupt"),
        (lambda document: document | {"stages": [{"cell": 0.01}], "begun": [5]}, "is corrupt"),
        (lambda document: [], "is corrupt"),
    ],
)
def test_a_spoilt_training_is_refused(spoil: Any, why: str, tmp_path: Path) -> None:
    (tmp_path / TRAINING).write_text(json.dumps(spoil(DOCUMENT)))
    with pytest.raises(BadInput, match=why):
        read_training(tmp_path)


def test_a_policy_that_is_cut_short_or_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"holds no policy.*softseam train"):
        read_training(tmp_path)
    (tmp_path / TRAINING).write_text(json.dumps(DOCUMENT))
    with pytest.raises(BadInput, match=f"{POLICY} is missing"):
        read_training(tmp_path)
    (tmp_path / POLICY).write_bytes(b"PK\x03\x04 cut short")
    with pytest.raises(BadInput, match="cut short"):
        read_training(tmp_path)


def _archive(**members: bytes) -> bytes:
    """As stable-baselines3 saves one: members as they are."""
    with zipfile.ZipFile(file := BytesIO(), "w") as archive:
        for name, content in members.items():
            archive.writestr(name.replace("_", "."), content)
    return file.getvalue()


def test_a_policy_that_lacks_its_end_or_a_part_is_refused(tmp_path: Path) -> None:
    """Its members are archives, too: the end of the last is still there where the file's own is not."""
    (tmp_path / TRAINING).write_text(json.dumps(DOCUMENT))
    inner = _archive(weights=bytes(range(200)))
    saved = _archive(data=b"{}", policy_pth=inner)
    (tmp_path / POLICY).write_bytes(saved)
    assert read_training(tmp_path).task == "TofuLift"
    cut = saved[: saved.index(inner) + len(inner) + 1]
    assert zipfile.is_zipfile(BytesIO(cut))
    damaged = saved.replace(bytes(range(50, 60)), bytes(10))
    for spoilt in (cut, damaged, _archive(data=b"{}")):
        (tmp_path / POLICY).write_bytes(spoilt)
        with pytest.raises(BadInput, match="cut short or damaged: train anew"):
            read_training(tmp_path)


@learns
@pytest.mark.slow
def test_a_policy_of_another_task_or_learner_is_refused(trained: Path, tmp_path: Path) -> None:
    """Where its training.json says what it is not."""
    for change, why in (
        ({"task": "PushGentle"}, r"sees \(16,\) and gives \(2,\), and PushGentle shows \(15,\)"),
        ({"algorithm": "sac"}, "no policy that sac learned"),
    ):
        document = json.loads((trained / TRAINING).read_text()) | change
        (tmp_path / TRAINING).write_text(json.dumps(document))
        (tmp_path / POLICY).write_bytes((trained / POLICY).read_bytes())
        with pytest.raises(BadInput, match=why):
            evaluate(Judgement(tmp_path, pieces=1), Console(quiet=True))
    with pytest.raises(BadInput, match="no policy that sac learned"):
        train(Wishes(out=tmp_path, steps=9999, resume=True), Console(quiet=True))
    assert (tmp_path / POLICY).read_bytes() == (trained / POLICY).read_bytes()


@pytest.mark.parametrize(
    ("wishes", "why"),
    [
        (Wishes(task="TofuThrow"), "no task is called 'TofuThrow'"),
        (Wishes(steps=0), "1 or more"),
        (Wishes(environments=0), "1 or more"),
    ],
)
def test_what_cannot_be_learned_is_refused(wishes: Wishes, why: str) -> None:
    with pytest.raises(BadInput, match=why):
        train(wishes, Console(quiet=True))
