"""`softseam chart` from scene to page: killed in mid-sweep, resumed, refused where its files are spoilt."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from chromium import browse

from softseam.study.page import write_page

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
    arguments = ["chart", str(scene), "--out", str(folder / "out"), "--minutes", "0.2", *more]
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


@pytest.mark.viewer
def test_chromium_shows_the_page(charted: tuple[Path, set[str], str], tmp_path: Path) -> None:
    """The page draws every run without a network, and pointing at a mark tells what it is."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    assert chromium is not None
    page_file = charted[0] / "out" / "chart.html"
    assert "http://" not in page_file.read_text().replace("http://www.w3.org/2000/svg", "")
    look = """(() => {
      const marks = [...document.querySelectorAll('#chart .point[data-key]')];
      if (!marks.length) return JSON.stringify({marks: 0});
      marks[0].dispatchEvent(new PointerEvent('pointerenter'));
      const tip = document.getElementById('tip');
      return JSON.stringify({marks: marks.length, rows: document.querySelectorAll('#rows tbody tr').length,
        tip: tip.style.display + ' ' + tip.textContent});
    })()"""
    document = json.loads((charted[0] / "out" / "chart.json").read_text())
    with browse(chromium, page_file.as_uri(), tmp_path / "profile") as page:
        deadline = time.monotonic() + 60.0
        seen = {"marks": 0}
        while not seen["marks"]:
            assert time.monotonic() < deadline
            if page.call("Runtime.evaluate", expression="document.readyState")["result"]["value"] == "complete":
                seen = json.loads(page.call("Runtime.evaluate", expression=look)["result"]["value"])
    drawn = [row for row in document["rows"] if row["rtf"] and row["status"] in ("done", "failed")]
    assert seen["marks"] == len(drawn) and seen["rows"] == len(document["rows"])
    assert str(seen["tip"]).startswith("block") and "real-time factor" in str(seen["tip"])


def test_minutes_that_nothing_ends_in_draw_nothing_and_spoil_nothing(tmp_path: Path) -> None:
    """What was drawn before stays as it is."""
    arguments = ["chart", "cantilever", "--out", str(tmp_path), "--minutes", "1e-5"]
    (tmp_path / "chart.json").write_text("drawn before")
    done = subprocess.run(
        [sys.executable, "-m", "softseam.cli", *arguments], capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 1 and "ran to its end" in done.stderr and "give more --minutes" in done.stderr
    assert (tmp_path / "chart.json").read_text() == "drawn before" and not (tmp_path / "chart.png").exists()


@pytest.mark.viewer
def test_the_page_names_marks_plainly(tmp_path: Path) -> None:
    """On a crowded front each name has its mark nearest or a line to it; stopped runs are in the table only, and
    a rival off by more than 100 % is a triangle."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    assert chromium is not None
    front = [(423, 0.26), (249, 0.029), (203, 0.0285), (193, 0.026), (188, 0.024), (168, 0.023), (127, 0.021)]
    rows = [plain(f"hex27_reduced 3x1x2, {rtf} ms", rtf, error) for rtf, error in front]
    rows += [plain(f"other {rtf}", rtf, 0.03) for rtf in (100, 150, 240)]
    rows.append(plain("slow", 0.1, None) | {"status": "stopped", "reason": "stopped after 9 s"})
    mark = {"label": "rival", "rtf": 0.5, "error": 1.48, "source": "me"}
    file = write_page(tmp_path / "chart.html", "crowded", page_document(rows, [mark]))
    look = """(() => {
      const box = e => { const b = e.getBBox(); return [b.x, b.y, b.x + b.width, b.y + b.height]; };
      const marks = [...document.querySelectorAll('#chart .point[data-key]')].map(g => [g.dataset.key,
        +g.lastChild.getAttribute('cx'), +g.lastChild.getAttribute('cy')]);
      return JSON.stringify({marks, rows: document.querySelectorAll('#rows tbody tr').length,
        names: [...document.querySelectorAll('#chart .named')].map(t =>
          [[...t.children].map(c => c.textContent), box(t)]),
        leads: [...document.querySelectorAll('#chart .lead')].map(p =>
          p.getAttribute('d').match(/[-0-9.]+/g).map(Number)),
        triangles: [...document.querySelectorAll('#chart .point path')].filter(p => p.getAttribute('fill') ===
          'transparent').length});
    })()"""
    with browse(chromium, file.as_uri(), tmp_path / "profile") as page:
        deadline = time.monotonic() + 60.0
        seen: dict[str, Any] = {"rows": 0}
        while not seen["rows"]:
            assert time.monotonic() < deadline
            if page.call("Runtime.evaluate", expression="document.readyState")["result"]["value"] == "complete":
                seen = json.loads(page.call("Runtime.evaluate", expression=look)["result"]["value"])
    assert seen["rows"] == len(rows) and len(seen["marks"]) == len(rows) - 1 and seen["triangles"] == 1
    assert sum(len(names) for names, _ in seen["names"]) == len(front)
    for names, (left, top, right, bottom) in seen["names"]:
        gaps = {
            key: math.hypot(max(left - x, 0, x - right), max(top - y, 0, y - bottom)) for key, x, y in seen["marks"]
        }
        at = next((x, y) for key, x, y in seen["marks"] if key == names[0])
        led = any(
            math.dist(at, line[:2]) < 12.0 and left - 2 <= line[2] <= right + 2 and top - 2 <= line[3] <= bottom + 2
            for line in seen["leads"]
        )
        assert led or min(gaps, key=lambda key: gaps[key]) in names, f"{names} reads as another's"


def plain(label: str, rtf: float, error: float | None) -> dict[str, Any]:
    """A row as chart.json has it."""
    off = {} if error is None else {"sag": {"value": error, "at_most": False}}
    row: dict[str, Any] = {
        "key": label,
        "method": "XPBD",
        "label": label,
        "settings": [],
        "status": "done",
        "reason": "",
        "rtf": rtf,
    }
    row |= {"rtf_least": rtf, "rtf_greatest": rtf, "runs": 3, "error": error, "at_most": False, "errors": off}
    return row | {"n_cells": 1, "n_nodes": 27, "steps": 1, "compile_seconds": 0.0, "setup_seconds": 0.0}


def page_document(rows: list[dict[str, Any]], rivals: list[dict[str, Any]]) -> dict[str, Any]:
    """What chart.json has of a reference that counts one quantity."""
    quantity: dict[str, Any] = {
        "uncertainty": 0.01,
        "uncertainty_cells": 0.01,
        "uncertainty_steps": 0.0,
        "order_cells": 2.0,
    }
    quantity |= {"order_steps": 1.0, "left_out": "", "counts": True}
    reference: dict[str, Any] = {
        "uncertainty": 0.01,
        "complete": True,
        "shipped": False,
        "origin": "was made",
        "integrator": "bdf2",
    }
    reference |= {"levels": [], "quantities": {"sag": quantity}}
    return {"machine": "a machine", "rows": rows, "asked": [], "rivals": rivals, "reference": reference}
