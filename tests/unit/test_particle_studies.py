"""Plans of bodies of particles: their reference is the limit of ever shorter substeps, for no other model has them."""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.console import Console

from softseam_studies.study.plan_command import Wishes, find
from softseam_studies.study.study import reference_of, study_of

pytestmark = pytest.mark.kernels

SHORT = ("motion=[{tools: [left, right], grip: 0.0}, {hold: 0.2}]", "quantities=[sag]")


def test_a_rope_is_planned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Longer substeps let it sag more: the limit is approached one way, and the plan is as near as asked for."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    study = study_of("rope", SHORT)
    levels = study.levels(("sag",))
    reference = reference_of(levels, 30.0, lambda text, seconds: lambda done: None)
    finest = levels.series((1, min(level.step for level in reference.levels)))
    assert len(reference.levels) > 3 and reference.parts["sag"].order_steps >= 1.0
    assert 0.0 < reference.uncertainty < 0.05
    off = finest.at("sag", reference.time)[-1] / reference.truth["sag"].values[-1] - 1.0
    assert abs(off) <= 2.0 * reference.uncertainty
    plan = find(Wishes("rope", SHORT, 0.1), Console(quiet=True))
    assert plan.choice.error is not None and plan.choice.error <= 0.1
    assert any("substeps" in setting for setting in plan.choice.settings)
