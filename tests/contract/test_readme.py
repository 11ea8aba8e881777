"""The README tells the truth: its scene is one, its program runs, its commands exist."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

import softseam
from softseam.app import app
from softseam.duration import expected_duration
from softseam_protocol.scene.file import parse_scene

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", README, re.DOTALL)
    assert found
    return found[1]


def test_scene_is_valid() -> None:
    scene = parse_scene(block("yaml"), "README.md")
    assert scene.regions.near is not None


@pytest.mark.kernels
@pytest.mark.slow
def test_program_runs(capsys: pytest.CaptureFixture[str]) -> None:
    """The program as printed: a tool driven by hand still ends when the scene's motion would."""
    exec(compile(block("python"), "README.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    duration = expected_duration(softseam.load_scene("tofu_grasp"))
    assert duration is not None and len(lines) == math.ceil(duration / 0.01 - 1e-6)
    assert float(lines[-1].split()[1]) > 3.0  # it grips [N]
    assert max(float(line.split()[3]) for line in lines) > 0.0, "there is no seam whose gap it could print"


def test_the_first_picture_s_caption_gives_its_command() -> None:
    """It shows both models, which `softseam run` of a scene so small has only where it is told so."""
    caption = README.partition("docs/pictures/tofu_grasp.png)")[2].partition("\n#")[0]
    assert "softseam run tofu_grasp --model hybrid --pictures" in caption


def test_commands_exist() -> None:
    known = {command.name or getattr(command.callback, "__name__", "") for command in app.registered_commands}
    assert set(re.findall(r"^    softseam ([a-z]+)", README, re.MULTILINE)) <= known
