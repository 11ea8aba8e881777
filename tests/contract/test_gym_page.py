"""Pages on learning: their programs run, and tables have every method to override and every environment."""

from __future__ import annotations

import re
from pathlib import Path

import gymnasium
import pytest

from softseam.gym import SceneEnv
from softseam.gym.push_gentle import SEEN as PUSH
from softseam.gym.sight import SEEN as LIFT
from softseam.gym.towel_fold import SEEN as FOLD

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "guide" / "own-task.md").read_text(encoding="utf-8")
TRAINING = (DOCS / "start" / "training.md").read_text(encoding="utf-8")
ENVIRONMENTS = (DOCS / "guide" / "environments.md").read_text(encoding="utf-8")
PROGRAMS = re.findall(r"```python\n(.*?)```", TRAINING + PAGE + ENVIRONMENTS, re.DOTALL)


@pytest.mark.kernels
@pytest.mark.slow
@pytest.mark.parametrize("number", range(11))
def test_a_program_runs(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "gym_page"}
    exec(compile(PROGRAMS[number], "page.md", "exec"), names)
    printed = capsys.readouterr().out
    if number == 0:
        assert re.match(r"True \d{4}\.\d+ 3\.", printed)  # lifted, at so many pascals
    if number == 1:
        assert int(printed) > 50
    if number == 3:
        assert "'plate.fx'" in printed and printed.endswith("(3,)\n")
        assert (tmp_path / "episodes" / "episode-000001.mcap").is_file()
        info = names["info"]
        assert isinstance(info, dict) and info["time"] == pytest.approx(0.2)
    if number >= 8:
        assert printed == ("(360, 480, 3)\n", "(15,) (64, 3)\n", "(64, 64) True True\n")[number - 8]
    elif number >= 5:
        assert re.match(("lifted", "reached", "folded")[number - 5] + r" [\d.]+\n$", printed)


def test_there_is_no_other_program() -> None:
    assert len(PROGRAMS) == 11


def test_all_environments_are_on_their_page() -> None:
    """With as many numbers of an action and of what is seen as they have."""
    ours = {name.partition("/")[2] for name in gymnasium.registry if name.startswith("softseam/")}
    registered = ours - {"TofuGrasp-v0"}  # which only says what took its place
    assert set(re.findall(r"^\| `softseam/([\w-]+)`", ENVIRONMENTS, re.MULTILINE)) == registered
    for name, seen in (("TofuLift", LIFT), ("SliceLift", LIFT), ("PushGentle", PUSH), ("TowelFold", FOLD)):
        assert re.search(rf"^\| `softseam/{name}-v0` \|.*\| {len(seen)} \|", ENVIRONMENTS, re.MULTILINE)


def test_what_a_subclass_may_say_is_in_the_table() -> None:
    rows = set(re.findall(r"^\| `(\w+)\(", PAGE, re.MULTILINE))
    own = {name for name, what in vars(SceneEnv).items() if callable(what) and not name.startswith("_")}
    assert rows == own - {"reset", "step", "render", "close"}
