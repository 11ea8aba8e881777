"""The demo, as `make demo` runs it: real processes, and every file that it promises."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from softseam.recording import Recording


@pytest.mark.slow
def test_demo_leaves_everything(tmp_path: Path) -> None:
    """Recording, .rrd, report and pictures are in the folder it names; progress shows RTF and ETA; no process stays."""
    out = tmp_path / "out"
    done = subprocess.run(
        [sys.executable, "-m", "softseam.cli", "demo", "--out", str(out)],
        cwd=tmp_path,
        env={**os.environ, "NO_COLOR": "1", "COLUMNS": "150"},
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert re.search(r"RTF \d+\.\d+  ETA \d+\.\d s", done.stdout)
    assert "everything is in" in done.stdout and str(out) in done.stdout.replace("\n", "")
    assert sorted(p.name for p in out.iterdir()) == [
        "curves.png",
        "report.json",
        "run.mcap",
        "run.rrd",
        "snapshots.png",
        "time.png",
    ]
    for picture in out.glob("*.png"):
        assert picture.read_bytes().startswith(b"\x89PNG")
    report = json.loads((out / "report.json").read_text())
    assert report["verdict"]["outcome"] == "lifted"
    assert report["model"] == "hybrid"
    assert report["recording"]["lost_messages"] == 0
    recording = Recording(out / "run.mcap")
    assert recording.note is None
    assert recording.counts["StepReport"] == report["steps"]
    for pid in re.findall(r"\(pid (\d+),", done.stdout):
        assert not Path(f"/proc/{pid}").exists()
