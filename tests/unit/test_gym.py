"""A scene as an environment of Gymnasium: what agents see and do, where episodes end, and what differs in them."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Discrete
from gymnasium.utils.env_checker import check_env

import softseam
from softseam.gym import SceneEnv, TofuLift
from softseam.observation import Observation
from softseam.recording import Recording

NAME = "softseam.gym:softseam/TofuLift-v0"


class Lift(SceneEnv):
    """Nothing but the way up is rewarded."""

    def reward(self, before: Observation, after: Observation) -> float:
        return after.lift_height - before.lift_height


@pytest.fixture(scope="module")
def tofu() -> Iterator[TofuLift]:
    env = TofuLift(randomise=None)
    yield env
    env.close()


@pytest.mark.kernels
def test_gymnasium_finds_nothing_to_object(tofu: TofuLift) -> None:
    """Its own checks: spaces, seeds, determinism, what `reset` and `step` return."""
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        check_env(tofu, skip_close_check=True)
    told = [str(warning.message) for warning in warned if "render modes" not in str(warning.message)]
    assert not told


@pytest.mark.kernels
def test_bad_actions_are_refused_and_change_nothing(tofu: TofuLift) -> None:
    tofu.reset(seed=0)
    seen, *_ = tofu.step([0.4, 0.0])
    before = tofu.session.last
    bad: list[Any] = [[0.4], [[0.4, 0.0]], "close", None]
    for action in bad:
        with pytest.raises(softseam.BadInput, match="2"):
            tofu.step(action)
    with pytest.raises(softseam.BadInput, match="not finite"):
        tofu.step([0.4, np.nan])
    assert tofu.session.last is before
    far, *_ = tofu.step([40.0, 0.0])
    moved = 0.02 * (far[0] - seen[0])
    assert moved == pytest.approx(0.05 * 0.04, rel=1e-4)  # the border of the action space


@pytest.mark.kernels
@pytest.mark.parametrize("mode", ["sync", "async"])
def test_several_at_once(mode: str) -> None:
    """As Gymnasium runs them, in this process and in others: each sees what it sees alone."""
    several = gymnasium.make_vec(NAME, num_envs=2, vectorization_mode=mode, randomise=None)
    actions = np.array([[0.4, 0.0], [0.8, 0.1]], np.float32)
    several.reset(seed=0)
    seen = [several.step(actions)[0] for _ in range(10)][-1]
    several.close()
    alone = TofuLift(randomise=None)
    for row, action in zip(seen, actions, strict=True):
        alone.reset(seed=0)
        ours = [alone.step(action)[0] for _ in range(10)][-1]
        assert np.array_equal(row, ours)
    alone.close()


@pytest.mark.kernels
def test_any_scene_is_an_environment(tmp_path: Path) -> None:
    """Its moved tools, its quantities and probes; what is repeated is one step; each episode leaves a recording."""
    small = ("body.cell=0.03", "step=0.02", "duration=0.4", "probes.middle=[0, 0, 0.02]")
    env = Lift("tofu_push", settings=small, model="fem", repeat=5, record=tmp_path / "episodes")
    assert env.tools == ("plate",) and "middle.von_mises" in env.names
    assert env.action_space.shape == (3,)
    for _ in range(2):
        seen, info = env.reset(seed=1)
        assert seen.shape == (len(env.names),) and not seen[:3].any()
        over: list[bool] = []
        while not (over and over[-1]):
            seen, _, terminated, truncated, info = env.step([-1.0, 0.0, 0.0])
            over.append(truncated)
            assert not terminated
        assert len(over) == 4 and info["time"] == pytest.approx(0.4)
        assert seen[0] == pytest.approx(-0.05 * 0.4, rel=1e-4)
    env.close()
    files = sorted((tmp_path / "episodes").iterdir())
    assert [file.name for file in files] == ["episode-000001.mcap", "episode-000002.mcap"]
    assert all(Recording(file).counts["StepReport"] == 20 for file in files)
    again = Lift("tofu_push", settings=small, model="fem", record=tmp_path / "episodes")
    again.reset()
    again.close()
    assert (tmp_path / "episodes" / "episode-000003.mcap").is_file(), "another training keeps those that are there"
    assert Recording(files[0]).counts["StepReport"] == 20


@pytest.mark.kernels
def test_actions_may_be_choices() -> None:
    """A subclass with another space says what each of its actions does."""

    class Choices(Lift):
        def act(self, action: Any) -> dict[str, list[float]]:
            return {"left": [0.0, 0.0, (0.0, 0.05)[int(action)]]}

    env = Choices("tofu_grasp", model="fem", settings=["body.cell=0.025"])
    env.action_space = Discrete(2)
    env.reset(seed=0)
    heights = [float(env.step(action)[0][2]) for action in (0, 1)]
    with pytest.raises(softseam.BadInput, match="no action of Discrete"):
        env.step(2)
    env.close()
    assert heights == pytest.approx([0.0, 0.05 * 0.01])


@pytest.mark.kernels
def test_a_simulation_that_cannot_go_on_truncates(monkeypatch: pytest.MonkeyPatch) -> None:
    """The training goes on with the next episode, and is told why."""
    env = Lift("tofu_grasp", model="fem", settings=("body.cell=0.025", "step=0.04"))
    env.reset(seed=0)
    action = np.zeros(6)
    seen, *_ = env.step(action)

    def fails(*_: object, **__: object) -> None:
        raise softseam.SimulationFailed("the far field is lost: shorten the step")

    monkeypatch.setattr(type(env.session), "step", fails)
    last, reward, terminated, truncated, info = env.step(action)
    assert truncated and not terminated and reward == 0.0
    assert info["failed"] == "the far field is lost: shorten the step"
    assert np.array_equal(last, seen)
    with pytest.raises(softseam.NotReset, match="reset"):
        env.step(action)
    monkeypatch.undo()
    env.reset(seed=0)
    assert np.array_equal(env.step(action)[0], seen)
    env.close()


@pytest.mark.kernels
def test_a_step_without_a_solution_truncates() -> None:
    """A block that turns 160 times in a step."""
    env = Lift("tofu_grasp", model="fem", settings=("body.cell=0.025", "body.spin=[0, 0, 1e5]", "gravity=[0, 0, 0]"))
    env.reset(seed=0)
    _, _, terminated, truncated, info = env.step(np.zeros(6))
    env.close()
    assert truncated and not terminated
    assert "step" in info["failed"]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"repeat": 0}, "repeat is 0"),
        ({"record": "episodes", "connect": "tcp/127.0.0.1:7447"}, "in this process only"),
        ({"settings": ["motion=[{tools: [left, right], close: 0.02, until: {force: 1}}]"]}, "duration"),
    ],
)
def test_what_is_no_environment_is_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(softseam.BadInput, match=told):
        Lift("tofu_grasp", **given)


def test_the_task_of_before_names_the_one_that_took_its_place() -> None:
    with pytest.raises(gymnasium.error.DeprecatedEnv, match="make softseam/TofuLift-v0"):
        gymnasium.make(NAME.replace("TofuLift", "TofuGrasp"), settings=["step=0.01"])


@pytest.mark.kernels
def test_without_gymnasium_the_remedy_is_named() -> None:
    code = "import sys; sys.modules['gymnasium'] = None\nimport softseam.gym"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert "pip install 'softseam[gym]'" in done.stderr


def test_a_subclass_says_what_is_rewarded() -> None:
    assert SceneEnv.__abstractmethods__ == {"reward"}
