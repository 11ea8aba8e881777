"""A chart made again: with other settings, by other code, after an interruption, and beside what is spoilt."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from softseam.errors import BadInput
from softseam_studies.cli_studies import Chart as Wishes
from softseam_studies.study import chart_command as command
from softseam_studies.study.chart_command import chart
from softseam_studies.study.configurations import Configuration, Fem
from softseam_studies.study.frame import Frame

pytestmark = pytest.mark.kernels

SCENE = """\
softseam: 1
name: jelly
step: 0.01
duration: 0.06
body:
  shape: {kind: block, size: [0.02, 0.02, 0.02]}
  cell: 0.01
  material: {kind: neo_hookean, young: 1.0e3, poisson: 0.40, density: 1000}
  fixed: [{min: [-1, -1, -1], max: [1, 1, 0]}]
quantities: [sag]
"""


def few(frame: Frame) -> list[Configuration]:
    """A sweep of two configurations: what is kept of them is looked at, not how many there are."""
    return [Fem(frame, (1, 1, 1), step).configuration() for step in (0.02, 0.01)]


@pytest.fixture
def wishes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Wishes:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(command, "configurations", few)
    monkeypatch.setattr(command, "classic_configurations", lambda _: [])
    scene = tmp_path / "jelly.yaml"
    scene.write_text(SCENE)
    return Wishes(str(scene), out=tmp_path / "out", minutes=0.02)


def made(wishes: Wishes) -> str:
    """Make the chart; returns the hash of the scene that it is of."""
    assert wishes.out is not None
    chart(wishes, Console(quiet=True))
    return str(json.loads((wishes.out / "chart.json").read_text())["scene"]["hash"])


def stored(folder: Path) -> dict[Path, int]:
    """Finished runs and levels below a folder, and when they were written [ns]."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.json") if path.parent != folder}


def test_other_settings_have_runs_of_their_own(wishes: Wishes, monkeypatch: pytest.MonkeyPatch) -> None:
    """A softer body is charted beside the first, whose runs are taken as they are when it is asked for again; so are
    those of the code as it was before an upgrade, and a folder of an earlier version is let be."""
    assert wishes.out is not None
    (wishes.out / "runs").mkdir(parents=True)
    (wishes.out / "runs" / "fem-hex27-implicit_euler-1x1x1-10.json").write_text("of an earlier version")
    first = made(wishes)
    runs = stored(wishes.out)
    assert made(replace(wishes, settings=("body.material.young=5e2",))) != first
    assert made(wishes) == first
    assert runs.items() <= stored(wishes.out).items(), "finished runs were run again"
    monkeypatch.setattr("softseam_studies.study.study.solver_digest", lambda: "upgraded")
    assert made(wishes) == first
    assert len(stored(wishes.out)) == 1 + 3 * 2, "three charts of two runs each, and the old file"


def test_a_spoilt_run_is_told_before_the_reference_is_made(wishes: Wishes, monkeypatch: pytest.MonkeyPatch) -> None:
    assert wishes.out is not None
    made(wishes)
    next(path for path in stored(wishes.out)).write_text("{")

    monkeypatch.setattr(command, "reference_of", lambda *_: pytest.fail("the reference was made"))
    with pytest.raises(BadInput, match=r"corrupt.*--fresh"):
        made(wishes)
