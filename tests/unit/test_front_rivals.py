"""Rows of other simulators on the page of several bodies are made again without those of others, and ours."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from benchmarks import front_rivals
from benchmarks.front_rivals_page import rivals_section
from benchmarks.front_tray import Tray
from rich.console import Console

ASIDE = {"momentum": None, "version": None}


def row(label: str, own: bool, error: float = 0.1) -> dict[str, Any]:
    """Of a run that came to its end."""
    found = {"force": [1.0, 1.0], "seconds": 2.0, "floor": None, "under": None, "deepest": 0.0, "error": error}
    return {"label": label, "own": own, "stopped": None, **ASIDE, **found}


@pytest.fixture
def kept() -> dict[str, Any]:
    first, last = front_rivals.SETTINGS[0].label, front_rivals.SETTINGS[-1].label
    rows = [row("ours", True), row(last, False), row(first, False)]
    return {"force": [2.0, 1.0], "known": 0.01, "cubes": 9, "rows": rows}


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A folder with a tray; runs of rivals are stopped ones, and looked at by nobody."""

    def stopped(tray: object, settings: Any, out: Path, console: Console) -> Iterator[tuple[str, dict[str, Any]]]:
        for setting in settings:
            yield setting.label, {"stopped": "diverged at 0.1 s", "version": "PyBullet 1"}

    monkeypatch.setattr(front_rivals, "measured", stopped)
    fields = Tray.__dataclass_fields__
    (tmp_path / "tray.json").write_text(json.dumps(dict.fromkeys(fields, 0.0)))
    return tmp_path


def test_rows_of_a_rival_are_made_again_and_all_others_stay(kept: dict[str, Any], measured: Path) -> None:
    """In the order of the settings, ours first."""
    found = front_rivals.added(kept, measured, ["pybullet"], Console(quiet=True))
    again = [setting.label for setting in front_rivals.SETTINGS if setting.rival == "pybullet"]
    assert [each["label"] for each in found["rows"]] == ["ours", front_rivals.SETTINGS[0].label, *again]
    assert found["rows"][:2] == [kept["rows"][0], kept["rows"][2]]
    assert all(each["stopped"] == "diverged at 0.1 s" for each in found["rows"][2:])
    assert {name: found[name] for name in ("force", "known", "cubes")} == {
        name: kept[name] for name in ("force", "known", "cubes")
    }


def test_a_rival_that_is_none_is_refused(kept: dict[str, Any], measured: Path) -> None:
    with pytest.raises(ValueError, match="bullet: no such rival"):
        front_rivals.added(kept, measured, ["bullet"], Console(quiet=True))


def test_the_section_says_versions_and_why_a_run_was_stopped(kept: dict[str, Any], measured: Path) -> None:
    found = front_rivals.added(kept, measured, ["pybullet"], Console(quiet=True))
    section = rivals_section(found)
    assert "PyBullet 1" in section and "| diverged at 0.1 s |" in section
