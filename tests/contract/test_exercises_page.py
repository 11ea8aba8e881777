"""docs/exercises.md: each program runs, and prints the numbers that the page and the chapter have."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "exercises.md").read_text(encoding="utf-8")
PROGRAMS = re.findall(r"## 9\.(\d).*?```python\n(.*?)```", PAGE, re.DOTALL)
EXPECTED = {
    "1": [*np.eye(3).ravel(), 1.0, 1.1, 0.6],
    "2": [1.3, 2.3, 1.9],
    "3": [38.46, 57.69, 83.33, 367, 196],
    "4": [10.0, 100.0, 10.0, 100.0, 1.70],
    "6": [36.7, 136.0],
}


@pytest.mark.kernels
@pytest.mark.parametrize(("number", "program"), PROGRAMS, ids=[f"9.{number}" for number, _ in PROGRAMS])
def test_a_program_prints_its_answer(number: str, program: str, capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(program, f"exercise 9.{number}", "exec"), {"__name__": "exercises_page"})
    found = [float(text) for text in re.findall(r"-?\d+\.?\d*", capsys.readouterr().out)]
    if number == "5":
        rows = np.array(found).reshape(-1, 3)
        assert len(rows) == 5
        np.testing.assert_allclose(rows[:, 1], rows[:, 2], rtol=2e-3, atol=0.1)
    else:
        assert found == pytest.approx(EXPECTED[number], rel=2e-3, abs=1e-9)


def test_all_six_are_there() -> None:
    assert [number for number, _ in PROGRAMS] == list("123456")
