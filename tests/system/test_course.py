"""Every lesson of docs/course/ runs to its end, asserts what it says, and leaves its picture."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LESSONS = sorted((ROOT / "docs" / "course").glob("*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_a_lesson_holds(lesson: Path, tmp_path: Path) -> None:
    picture = tmp_path / "lesson.png"
    done = subprocess.run([sys.executable, str(lesson), str(picture)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip(), "a lesson says what came of it"
    assert picture.stat().st_size > 10_000


def test_the_course_has_six_lessons() -> None:
    text = (ROOT / "docs" / "course" / "README.md").read_text()
    assert len(LESSONS) == 6
    assert all(f"]({lesson.name})" in text for lesson in LESSONS)
