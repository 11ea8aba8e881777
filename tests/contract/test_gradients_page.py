"""docs/guide/gradients.md: its programs run, and its mass on a spring has the derivative that the page says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from softseam.losses import Loss, Run

PAGE = (Path(__file__).parents[2] / "docs" / "guide" / "gradients.md").read_text(encoding="utf-8")
PROGRAMS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def _run(number: int) -> dict[str, object]:
    names: dict[str, object] = {"__name__": "gradients_page"}
    exec(compile(PROGRAMS[number], "gradients.md", "exec"), names)
    return names


@pytest.mark.kernels
@pytest.mark.slow
def test_the_session_s_program_runs(capsys: pytest.CaptureFixture[str]) -> None:
    _run(0)
    value, _, rows, *_ = capsys.readouterr().out.replace("(", "").replace(",", "").split()
    assert float(value) != 0.0 and int(rows) > 40


def test_the_loss_s_slope_is_its_derivative() -> None:
    hardest = _run(1)["hardest"]
    force = np.random.default_rng(0).standard_normal((6, 3))

    def of(moved: np.ndarray) -> tuple[float, np.ndarray]:
        loss: Loss = hardest  # type: ignore[assignment]
        value, slope = loss(Run(np.arange(6.0), {"left": moved}, np.zeros((6, 1, 3)), np.zeros((1, 3)), {}))
        return value, slope.force["left"]

    for step, axis in ((0, 1), (3, 2)):
        change = np.zeros_like(force)
        change[step, axis] = 1e-6
        difference = (of(force + change)[0] - of(force - change)[0]) / 2e-6
        assert of(force)[1][step, axis] == pytest.approx(difference, rel=1e-6, abs=1e-9)


def test_the_spring_s_adjoint_is_the_difference(capsys: pytest.CaptureFixture[str]) -> None:
    _run(2)
    found, difference = map(float, capsys.readouterr().out.split())
    assert found == pytest.approx(difference, rel=1e-8)
    assert len(PROGRAMS) == 3
