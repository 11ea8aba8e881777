"""A chart's progress tells no more time than its budget has left, and none past it."""

from __future__ import annotations

import re
from io import StringIO

import pytest
from rich.console import Console

from softseam_studies.study.configurations import configurations
from softseam_studies.study.progress import ChartProgress
from softseam_studies.study.study import study_of

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("budget", [5.0, 60.0, 1e-9])
@pytest.mark.parametrize("at", [0, 20, -1])
def test_time_left(budget: float, at: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("softseam.bar.LINE", 0.0)
    said, wanted = StringIO(), configurations(study_of("stiff_inclusion").frame)
    with ChartProgress(Console(file=said, width=200)) as progress:
        progress.expect(wanted, budget)
        told = progress.configuration(wanted[at], 1.0)
        for done in (0.1, 0.5, 1.0):
            told(done)
    lines = said.getvalue().splitlines()
    assert len(lines) == 4 and all(wanted[at].label in line for line in lines)
    left = [int(found[1]) for line in lines if (found := re.search(r"ETA (\d+) s", line))]
    assert len(left) == (4 if budget > 1.0 else 0) and all(0 <= seconds <= budget for seconds in left)
