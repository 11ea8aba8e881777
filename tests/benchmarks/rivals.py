"""Other simulators on our scenes, as marks of our charts: `make rivals`, or `python tests/benchmarks/rivals.py`.

Charts the scenes with softseam, makes a scratch environment for each rival (from the package index, so no part of any
test), runs the rivals one after the other on the same scenes on this machine right afterwards, compares their curves
with the charts' references by the same norm, writes out/rivals.json, and draws the charts again with the rivals' marks.

A rival's error is the worst of the quantities that it can report: force, lift and sag in tofu_grasp (not its slip).
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import venv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from softseam_studies.cli_studies import Chart as Wishes
from softseam_studies.study.chart_command import chart
from softseam_studies.study.errors import errors
from softseam_studies.study.reference import Reference
from softseam_studies.study.series import Series

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
RIVALS = {"mujoco": ("mujoco==4.0.0",), "newton": ("newton==1.8.0", "warp-lang==1.19.0")}
"""what is installed for each; the module benchmarks.rival_NAME runs it"""
SCENES = {"tofu_grasp": 10.0, "cantilever": 1.5}
"""minutes of softseam's own charts, as `make chart` takes them"""


def environment(folder: Path, packages: Sequence[str]) -> Path:
    """Python of an environment with a rival in it, made where there is none."""
    python = folder / "bin" / "python"
    if not (folder / "ready").exists():
        venv.create(folder, with_pip=True, clear=True)
        command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages]
        subprocess.run(command, check=True, timeout=1200)
        (folder / "ready").touch()
    return python


def measured(rival: str, scenes: Sequence[str], out: Path) -> list[dict[str, Any]]:
    """The rows that a rival's own program leaves, run in its environment on one thread."""
    python, raw = environment(out / f"rival-{rival}", RIVALS[rival]), out / f"rival-{rival}.json"
    alone = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(HERE.parent)}
    command = [str(python), "-m", f"benchmarks.rival_{rival}", str(raw), *scenes]
    subprocess.run(command, check=True, timeout=3600, env=alone)
    rows: list[dict[str, Any]] = json.loads(raw.read_text())
    return rows


def compared(row: Mapping[str, Any], reference: Reference) -> dict[str, Any]:
    """A rival's run as a mark of the chart."""
    curves = {name: np.array(values) for name, values in row["curves"].items()}
    time = curves.pop("time")
    names = [name for name in reference.counted if name in curves]
    found = errors(
        Series(time, np.zeros_like(time), curves), reference.time, {name: reference.truth[name] for name in names}
    )
    worst = max(found, key=lambda name: found[name].value)
    walls = row["walls"]
    return {
        "scene": row["scene"],
        "label": row["label"],
        # as for our own runs: what other work took is left out
        "rtf": float(f"{row['simulated'] / min(statistics.median(walls), row['cpu']):.4g}"),
        "error": float(f"{found[worst].value:.4g}"),
        "source": f"{row['version']} on this machine, timed runs: {len(walls)}; worst is {worst} of {', '.join(names)}",
        "errors": {name: float(f"{error.value:.4g}") for name, error in found.items()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--rivals", nargs="+", choices=list(RIVALS), default=list(RIVALS))
    given = parser.parse_args()
    out, console = ROOT / "out", Console()
    references = {}
    for scene in given.scenes:
        _, references[scene] = chart(Wishes(scene, out=out / f"chart-{scene}", minutes=SCENES[scene]), console)
    rows = []
    for row in (row for rival in given.rivals for row in measured(rival, given.scenes, out)):
        if "failed" in row:
            console.print(f"{row['version']}, {row['label']}: {row['failed']}", highlight=False)
        else:
            rows.append(compared(row, references[row["scene"]]))
    rivals = out / "rivals.json"
    rivals.write_text(json.dumps({"rivals": rows}, indent=1) + "\n")
    for row in rows:
        sys.stdout.write(f"{row['scene']:12s} {row['label']:34s} {row['rtf']:8.3g}x  {100 * row['error']:.3g} %\n")
    for scene in given.scenes:
        wishes = Wishes(scene, out=out / f"chart-{scene}", minutes=SCENES[scene], rivals=rivals)
        chart(wishes, Console(quiet=True))
    console.print(f"{rivals}, and the charts in {out}", highlight=False)


if __name__ == "__main__":
    main()
