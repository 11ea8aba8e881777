"""`softseam chart` from scene to page: killed in mid-sweep, resumed, refused where its files are spoilt."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest

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


def command(folder: Path, *more: str) -> list[str]:
    scene = folder / "jelly.yaml"
    scene.write_text(SCENE)
    arguments = ["chart", str(scene), "--out", str(folder / "out"), "--minutes", "0.25", *more]
    return [sys.executable, "-m", "softseam.cli", *arguments]


def environment(folder: Path) -> dict[str, str]:
    return os.environ | {"XDG_CACHE_HOME": str(folder / "cache"), "COLUMNS": "200"}


@pytest.fixture(scope="session")  # a test that draws comes long after the others of this file
def charted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, set[str], str]:
    """A chart whose first attempt was killed outright; the folder, what that attempt had finished, and the output."""
    folder = tmp_path_factory.mktemp("chart")
    runs = folder / "out" / "runs"
    process = subprocess.Popen(command(folder), env=environment(folder), stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 240.0
    while len(list(runs.rglob("*.json"))) < 5:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)  # nothing announces a file
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    finished = {path: path.stat().st_mtime_ns for path in runs.rglob("*.json")}
    done = subprocess.run(
        command(folder), env=environment(folder), capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 0, done.stderr
    assert {path: path.stat().st_mtime_ns for path in finished} == finished, "finished runs were run again"
    return folder, {path.name for path in finished}, done.stdout


@pytest.mark.slow
def test_a_killed_sweep_goes_on(charted: tuple[Path, set[str], str]) -> None:
    folder, finished, _ = charted
    document = json.loads((folder / "out" / "chart.json").read_text())
    done = [row for row in document["rows"] if row["status"] == "done"]
    assert len(done) > len(finished) >= 5
    assert all(row["rtf"] > 0.0 and row["runs"] >= 1 and row["error"] > 0.0 for row in done)
    lines = (folder / "out" / "chart.csv").read_text().splitlines()
    assert len(lines) == 1 + len(document["rows"])


@pytest.mark.slow
def test_the_reference_is_the_beam_s_own_limit(charted: tuple[Path, set[str], str]) -> None:
    """Finer is better, the reference is refined in both, and its uncertainty is stored and told."""
    folder, _, told = charted
    document = json.loads((folder / "out" / "chart.json").read_text())
    reference = document["reference"]
    assert reference["integrator"] == "bdf2" and len(reference["levels"]) >= 4
    assert 0.0 < reference["uncertainty"] < 0.05
    assert "reference" in told and "nothing is both faster and more accurate" in told
    error = {row["key"]: row["error"] for row in document["rows"]}
    steps = [error[f"fem-hex27-implicit_euler-2x2x2-{step}"] for step in ("20", "10", "5")]
    assert steps == sorted(steps, reverse=True), "implicit Euler improves with shorter steps"
    assert error["fem-hex27-bdf2-2x2x2-10"] < error["fem-hex27-implicit_euler-2x2x2-10"]


@pytest.mark.slow
def test_a_spoilt_run_and_a_spoilt_reference_are_refused_by_name(
    charted: tuple[Path, set[str], str], tmp_path: Path
) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(charted[0], folder)
    for pattern in ("out/runs/*/xpbd-*.json", "cache/softseam/references/*/level-2-*.json"):
        path = sorted(folder.glob(pattern))[0]
        whole = path.read_text()
        path.write_text(whole[:-40])
        spoilt = subprocess.run(
            command(folder), env=environment(folder), capture_output=True, text=True, timeout=120, check=False
        )
        assert spoilt.returncode == 2
        assert (
            path.name in spoilt.stderr.replace("\n", "") and "corrupt" in spoilt.stderr and "--fresh" in spoilt.stderr
        )
        path.write_text(whole)


@pytest.mark.slow
def test_the_page_tells_of_every_mark_and_run(charted: tuple[Path, set[str], str]) -> None:
    """Without a network or a script: a mark's own title, and a table."""
    document = json.loads((charted[0] / "out" / "chart.json").read_text())
    page = ElementTree.fromstring((charted[0] / "out" / "chart.html").read_text().replace("<!doctype html>", ""))
    marks = {each.get("id"): each.findtext("{*}title") for each in page.iter("{http://www.w3.org/2000/svg}g")}
    drawn = [row for row in document["rows"] if row["rtf"] and row["status"] in ("done", "failed")]
    assert drawn and all(row["label"] in str(marks[f"run-{row['key']}"]) for row in drawn)
    assert len(list(page.iter("tr"))) == 1 + len(document["rows"]) and not list(page.iter("script"))


def test_minutes_that_nothing_ends_in_draw_nothing_and_spoil_nothing(tmp_path: Path) -> None:
    """What was drawn before stays as it is."""
    arguments = ["chart", "cantilever", "--out", str(tmp_path), "--minutes", "1e-5"]
    (tmp_path / "chart.json").write_text("drawn before")
    done = subprocess.run(
        [sys.executable, "-m", "softseam.cli", *arguments], capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 1 and "ran to its end" in done.stderr and "give more --minutes" in done.stderr
    assert (tmp_path / "chart.json").read_text() == "drawn before" and not (tmp_path / "chart.png").exists()
