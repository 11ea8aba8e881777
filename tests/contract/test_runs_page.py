"""docs/guide/run-outputs.md: its program reads a recording, and its outcomes are those that there are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from squeeze import Squeeze

from softseam.pictures import draw_pictures
from softseam.verdict import Verdict
from softseam_services.recorder.recorder import McapRecorder

PAGE = (Path(__file__).parents[2] / "docs" / "guide" / "run-outputs.md").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where run.mcap lies."""
    run = Squeeze(20, cell=0.025)
    with McapRecorder(tmp_path / "run.mcap", run.begin) as recorder:
        for message in run.messages():
            recorder.write(message)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.kernels
@pytest.mark.usefixtures("folder")
def test_the_program_reads_a_recording(capsys: pytest.CaptureFixture[str]) -> None:
    found = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert found
    exec(compile(found[1], "runs.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("squeeze 7 ") and lines[0].endswith(" None")
    assert sum(line.startswith("(") for line in lines) == 20 and lines[-1] == "lifted 13.1"
    assert float(next(line for line in reversed(lines) if "'grip_force'" in line).split()[0]) == pytest.approx(0.2)


def test_every_outcome_is_explained_and_no_other() -> None:
    rows = PAGE.partition("## What became")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| `(.*?)` \|", rows, re.MULTILINE)) == set(re.findall(r"'(.*?)'", Verdict.__doc__ or ""))


@pytest.mark.kernels
def test_every_picture_is_explained(folder: Path) -> None:
    assert all(f"- `{path.name}`: " in PAGE for path in draw_pictures(folder / "run.mcap", folder))
