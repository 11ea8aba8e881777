"""docs/chapter.md: what it names is there, and the checklist has its sixty points."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.main import get_command

from softseam.app import app

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "chapter.md").read_text(encoding="utf-8")
NAMED = re.findall(r"`([^`]+)`", PAGE)
PATHS = sorted({name for name in NAMED if re.fullmatch(r"[\w./-]+", name) and ("/" in name or name.endswith(".md"))})


@pytest.mark.parametrize("path", [path for path in PATHS if "..." not in path])
def test_a_path_is_there(path: str) -> None:
    assert (ROOT / path).exists()


def test_commands_and_targets_are_there() -> None:
    commands = {name.split()[1] for name in NAMED if name.startswith("softseam ")}
    targets = {name.split()[1] for name in NAMED if name.startswith("make ")}
    assert commands <= set(get_command(app).commands)  # type: ignore[attr-defined]
    assert all(re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE) for target in targets)
    assert len(commands) > 5 and len(targets) > 2


def test_every_row_works_is_mended_or_names_its_gap() -> None:
    """No row is a part of something: it says what is here, or what a task would have to add."""
    lines = [line for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith("| item")]
    for row in ([cell.strip() for cell in line[1:-1].split("|")] for line in lines):
        assert len(row) == 4, row
        state = row[3]
        assert re.match(r"works\b|mended\b|gap: \w", state), row
        assert "`" in row[1] + row[2] or state.startswith("gap"), row


def test_the_checklist_has_sixty_points() -> None:
    part = PAGE.partition("## 9.12")[2]
    assert sum(line.startswith("| ") and not line.startswith("| item") for line in part.splitlines()) == 60
    assert len(re.findall(r"^\| 9\.\d ", PAGE.partition("## 9.10")[2].partition("## 9.11")[0], re.MULTILINE)) >= 7
