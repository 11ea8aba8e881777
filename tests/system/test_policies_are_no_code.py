"""What stable-baselines3 pickles beside a policy's weights is never read: it is code, of whoever made the file.

Needs stable-baselines3, and Ray for one test, which continuous integration installs: pip install 'softseam[learn,ray]'.
"""

from __future__ import annotations

import base64
import json
import os
import pickle
import zipfile
from dataclasses import replace
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from softseam.errors import BadInput
from softseam_studies.cli_learning import Evaluate, Train
from softseam_studies.learn import policy as saving
from softseam_studies.learn import train as training
from softseam_studies.learn.evaluate import evaluate
from softseam_studies.learn.policy import POLICY, Algorithm, Training, read_training
from softseam_studies.learn.tasks import TASKS
from softseam_studies.learn.train import load_learner, new_learner, train, vectorised

pytestmark = pytest.mark.skipif(
    find_spec("stable_baselines3") is None and not os.environ.get("CI"), reason="pip install 'softseam[learn]'"
)


class Touch:
    """Unpickled, it is a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch '{self.path}'",)


def saved(folder: Path, algorithm: Algorithm = "ppo") -> Training:
    """A policy that was never trained."""
    known = Training("TofuLift", algorithm, 0, 2, 1, done=0, model="xpbd")
    vector = vectorised(known)
    new_learner(known, vector).save(folder / POLICY)
    vector.close()
    known.write(folder)
    return known


def poisoned(path: Path, mark: Path) -> None:
    """A value beside those of the zip's `data` touches `mark` where it is unpickled."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    code = base64.b64encode(pickle.dumps(Touch(mark))).decode()
    data = json.loads(members["data"])
    members["data"] = json.dumps(data | {"more": {":type:": "x", ":serialized:": code}}).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)


@pytest.mark.slow
@pytest.mark.parametrize(
    "ray",
    [
        None,
        pytest.param(
            "local",
            marks=pytest.mark.skipif(
                find_spec("ray") is None and not os.environ.get("CI"), reason="pip install 'softseam[ray]'"
            ),
        ),
    ],
)
def test_judging_a_policy_runs_nothing_of_its_file(ray: str | None, tmp_path: Path) -> None:
    """A stranger's policy is judged, as the same without what is poisoned in it is."""
    saved(tmp_path)
    wishes = Evaluate(tmp_path, pieces=1, step=0.04, ray=ray)
    clean = evaluate(replace(wishes, ray=None), Console(quiet=True)) if ray is None else None
    mark = tmp_path / "was here"
    poisoned(tmp_path / POLICY, mark)
    judged = evaluate(wishes, Console(quiet=True))
    assert not mark.exists() and len(judged) > 1
    if clean is not None:
        for name, each in clean.items():
            np.testing.assert_array_equal(each.hardship, judged[name].hardship)


@pytest.mark.slow
def test_going_on_from_a_policy_runs_nothing_of_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`train --resume`."""
    monkeypatch.setitem(TASKS, "TofuLift", replace(TASKS["TofuLift"], rollout=16))
    saved(tmp_path)
    mark = tmp_path / "was here"
    poisoned(tmp_path / POLICY, mark)
    train(Train(out=tmp_path, resume=True, steps=16, check=False), Console(quiet=True))
    assert not mark.exists() and read_training(tmp_path).done >= 16


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_what_was_learned_is_all_there_again(algorithm: Algorithm, tmp_path: Path) -> None:
    """Weights, the optimisers' memory, the entropy's coefficient: what stable-baselines3 itself reads, bit for bit."""
    task = replace(TASKS["TofuLift"], rollout=64)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(TASKS, "TofuLift", task)
        wishes = Train(algorithm=algorithm, environments=4, steps=160, out=tmp_path, check=False)
        train(wishes, Console(quiet=True))
        known = read_training(tmp_path)
        vector = vectorised(known)
        ours, theirs = (
            load_learner(known, tmp_path / POLICY, vector),
            training.algorithm(algorithm).load(tmp_path / POLICY, env=vector, device="cpu"),
        )
        vector.close()
    assert ours.num_timesteps == theirs.num_timesteps == known.done > 0
    assert alike(ours.get_parameters(), theirs.get_parameters())
    if algorithm == "sac":
        assert ours.log_ent_coef.item() == theirs.log_ent_coef.item() != 0.0


def alike(a: Any, b: Any) -> bool:
    if isinstance(a, dict):
        return bool(a.keys() == b.keys() and all(alike(a[key], b[key]) for key in a))
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(alike, a, b))
    return bool((a == b).all()) if hasattr(a, "all") else bool(a == b)


def test_a_policy_that_unpacks_to_more_than_any_has_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before it is unpacked: a small file may hold terabytes of zeros."""
    known = Training("TofuLift", "ppo", 0, 2, 1, model="xpbd")
    known.write(tmp_path)
    monkeypatch.setattr(saving, "MOST", 1000)
    with zipfile.ZipFile(file := BytesIO(), "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("data", b"{}")
        archive.writestr("policy.pth", bytes(2000))
    (tmp_path / POLICY).write_bytes(file.getvalue())
    with pytest.raises(BadInput, match="unpacks to"):
        read_training(tmp_path)
