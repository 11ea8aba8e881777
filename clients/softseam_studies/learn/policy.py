"""A policy on disk: what stable-baselines3 saves, and beside it what it is a policy of and how it was learned."""

import json
import zipfile
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

from softseam.errors import BadInput
from softseam.gym.lift_scene import BY_FEM, LiftModel
from softseam.report import write_json
from softseam_studies.learn.check import Check
from softseam_studies.learn.tasks import TASKS, VERSION, Stage

Algorithm = Literal["ppo", "sac"]

POLICY, TRAINING = "policy.zip", "training.json"
MOST = 64 << 20
"""what a policy may unpack to, a hundred times what one does [B]"""
_FORMAT = 1


@dataclass(frozen=True)
class Training:
    """How far learning got."""

    task: str
    algorithm: Algorithm
    seed: int
    environments: int
    steps: int
    """wanted"""
    done: int = 0
    """taken"""
    curve: tuple[tuple[int, float, float, float], ...] = ()
    """after so many steps: return, part that succeeded and mean of what bodies suffered, of the last 100 episodes"""
    model: LiftModel = BY_FEM
    """that it learned in"""
    shape: str | None = None
    """of the body, where the task has one of the user's: None is the task's own"""
    settings: tuple[str, ...] = ()
    seconds: float = 0.0
    """wall time that it took"""
    checks: tuple[Check, ...] = ()
    """of its episodes, by FEM"""
    stages: tuple[Stage, ...] = ()
    """one after the other; none: cells are the scene's"""
    begun: tuple[int, ...] = ()
    """after so many steps each stage but the first"""
    version: int = field(default=VERSION)

    @property
    def options(self) -> dict[str, Any]:
        """Of the environment, whoever learns in it or judges."""
        return {"settings": self.settings} | ({} if self.shape is None else {"shape": self.shape})

    @property
    def stage(self) -> Stage | None:
        """That it is in."""
        return self.stages[len(self.begun)] if self.stages else None

    def write(self, folder: Path) -> None:
        """Raises OSError."""
        write_json({"softseam_training": _FORMAT, **asdict(self)}, folder / TRAINING)


def read_training(folder: Path) -> Training:
    """How the policy in a folder was learned. Raises BadInput where there is none, or it cannot be used."""
    path = folder / TRAINING
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        known = document.pop("softseam_training") == _FORMAT
        curve = tuple((int(a), float(b), float(c), float(d)) for a, b, c, d in document.pop("curve"))
        checks = tuple(Check.read(row) for row in document.pop("checks", ()))
        stages = tuple(Stage(**row) for row in document.pop("stages", ()))
        begun = tuple(int(steps) for steps in document.pop("begun", ()))
        if len(begun) >= max(len(stages), 1):
            raise ValueError("more stages have begun than there are")
        training = Training(**document, curve=curve, checks=checks, stages=stages, begun=begun)
        training = replace(training, settings=tuple(training.settings))
    except FileNotFoundError:
        raise BadInput(f"{folder} holds no policy: there is no {TRAINING}; softseam train TofuLift makes one") from None
    except OSError as error:
        raise BadInput(f"cannot read {path}: {error.strerror}") from None
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise BadInput(f"{path} is corrupt ({type(error).__name__}): train anew") from None
    if not known:
        raise BadInput(f"{path} is of another version of softseam: train anew")
    if training.task not in TASKS:
        raise BadInput(f"{path}: no task is called {training.task!r} (there are: {', '.join(TASKS)})")
    if training.version != VERSION:
        raise BadInput(
            f"{path}: a policy of version {training.version} of {training.task}, which is {VERSION}: train anew"
        )
    if training.algorithm not in get_args(Algorithm):
        raise BadInput(f"{path}: nothing learns by {training.algorithm!r} ({' or '.join(get_args(Algorithm))})")
    _check_saved(folder / POLICY)
    return training


def _check_saved(path: Path) -> None:
    """Raises BadInput where what stable-baselines3 saved is not all there."""
    if not path.exists():
        raise BadInput(f"{path} is missing: train anew")
    try:
        with zipfile.ZipFile(path) as saved:
            size = sum(each.file_size for each in saved.infolist())
            # a policy holds archives of its own: the end of one is found where the file's is missing
            whole = size > MOST or (saved.testzip() is None and "policy.pth" in saved.namelist())
    except (zipfile.BadZipFile, OSError, EOFError, ValueError):
        size, whole = 0, False
    if size > MOST:
        raise BadInput(f"{path} unpacks to {size:,} B, more than any policy ({MOST:,} B): train anew")
    if not whole:
        raise BadInput(f"{path} is cut short or damaged: train anew")
