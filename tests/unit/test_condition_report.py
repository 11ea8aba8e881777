"""Condition numbers in a run's report and closing table: told where they are asked for, and what they mean."""

from __future__ import annotations

import json
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from softseam.recording import Recording
from softseam.running import Wishes, run
from softseam_services.pbd.condition import sentence

SHORT = ("motion=[]", "duration=0.05")
BLOCK = (
    "body={kind: tet_mesh, size: [0.05, 0.05, 0.05], divisions: [2, 2, 2], density: 1000, young: 20e3, poisson: 0.3}"
)


def told(scene: str, *settings: str, **wishes: object) -> tuple[dict, str]:  # type: ignore[type-arg]
    """The report of a short run with condition numbers, and what was printed."""
    said = StringIO()
    asked = Wishes(scene, settings=(*SHORT, *settings), condition=True, estimate=False, **wishes)  # type: ignore[arg-type]
    return run(asked, Console(file=said, width=1000)), said.getvalue()


@pytest.mark.kernels
def test_a_rope_s_number_is_in_the_report_and_in_the_table(tmp_path: Path) -> None:
    """At the start of what check tells, at the end of what stands then; the recording is that of any run."""
    files = {"report": tmp_path / "a.json", "record": tmp_path / "a.mcap"}
    pulled = "motion=[{tools: [left, right], grip: 0.0}, {tools: [left, right], close: 0.4, until: {time: 0.05}}]"
    report, said = told("rope", pulled, **files)
    found = report["condition"]["body"]
    assert found["start"] == pytest.approx(94.2, abs=0.1) and found["end"] != found["start"]
    assert (found["substeps"], found["sweeps"]) == (38, 1) and found["sweeps_for_a_tenth"] > 20
    assert found["text"] in said and json.loads(files["report"].read_text())["condition"]["body"] == found
    assert report["recording"]["lost_messages"] == 0
    assert sum(type(message).__name__ == "StepReport" for message in Recording(files["record"])) == 5


@pytest.mark.kernels
def test_numbers_of_blocks_and_of_tetrahedra() -> None:
    blocks, _ = told("tofu_grasp", "regions={default: pbd}", "body.cell=0.025")
    solids, _ = told("tofu_grasp", "regions={default: pbd}", BLOCK, "tools={}", "quantities=[sag]")
    for report in (blocks, solids):
        assert report["condition"]["body"]["start"] > 1.0


@pytest.mark.kernels
def test_what_has_no_number_is_said_to_have_none() -> None:
    report, said = told("tofu_grasp", "regions={default: fem}")
    assert report["condition"] == {} and "no condition number: XPBD moves no body" in said
    silent = StringIO()
    plain = run(Wishes("rope", settings=("motion=[]", "duration=0.02"), estimate=False), Console(file=silent))
    assert plain["condition"] is None and "condition number" not in silent.getvalue()


def test_the_sentence_says_whether_more_sweeps_are_wanted() -> None:
    found = {"start": None, "end": 16.0, "sweeps": 1, "sweeps_for_a_tenth": 6, "substeps": 87}
    assert sentence(found) == (
        "condition number of XPBD's system: none at the start, which is FEM's, 16 at the end, in 87 substeps a step. "
        "The slowest part of an error falls to a tenth in some 6 sweeps; a substep takes 1 sweep, and leaves the rest "
        "to the next: shorter substeps need fewer"
    )
    assert sentence({**found, "sweeps_for_a_tenth": 1}).endswith("in some 1 sweep; a substep takes 1 sweep")
