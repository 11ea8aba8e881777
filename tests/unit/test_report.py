"""The report: complete, plain JSON, and honest about a body that was dropped."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from squeeze import Squeeze

from softseam.recording import Recording
from softseam.report import ReportBuilder, write_report
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import scene_hash
from softseam_services.recorder.recorder import McapRecorder

pytestmark = pytest.mark.kernels

KEYS = {
    "report_version": int,
    "schema_version": int,
    "scene": {"name": str, "hash": str, "step": float},
    "versions": {"softseam": str, "numpy": str, "numba": str, "python": str},
    "machine": {"machine": str, "cores": str},
    "model": str,
    "verdict": {"outcome": str, "text": str, "done": bool},
    "estimated_error": type(None),
    "steps": int,
    "simulated_seconds": float,
    "parts": {
        name: {
            "model": str,
            "n_nodes": {"min": float, "mean": float, "max": float},
            "n_elements": {"min": float, "mean": float, "max": float},
        }
        for name in ("body.near", "body.far")
    },
    "seam": {
        "worst_gap": {"value": float, "unit": str},
        "largest_multiplier": {"value": float, "unit": str},
        "work": {"value": float, "unit": str},
    },
    "exchanges": {"min": float, "mean": float, "max": float},
    "wall": {
        name: float
        for name in (
            "fem",
            "pbd",
            "coupling",
            "bus",
            "record",
            "total",
            "setup",
            "step_median",
            "rtf",
            "rtf_median_step",
        )
    },
    "quantities": {"grip_force": {"unit": str, "time": list, "values": list, "final": float, "max": float}},
    "energy": {
        "unit": str,
        "time": list,
        "ledger": {"kinetic": list, "tool_work": list},
        "balance_error": float,
        "damped": float,
        "largest": float,
    },
    "penetration": {"worst": float, "unit": str},
    "slip": {"worst": float, "unit": str},
    "momentum": {"unit": str, "values": list},
    "angular_momentum": {"unit": str, "values": list},
    "events": list,
    "recording": {"path": type(None), "lost_messages": int, "note": type(None)},
}


def check(found: Any, wanted: Any, where: str = "report") -> None:
    if isinstance(wanted, dict):
        for key, inner in wanted.items():
            assert key in found, f"{where}.{key} is missing"
            check(found[key], inner, f"{where}.{key}")
    else:
        assert isinstance(found, wanted), f"{where} is {found!r}"


def build(run: Squeeze, **options: Any) -> dict[str, Any]:
    builder = ReportBuilder(run.bundle, facts=run.begin.facts)
    for message in run.messages():
        builder.add(message)
    return builder.build(**options)


def test_it_says_everything_that_it_promises() -> None:
    run = Squeeze(30)
    report = build(run, setup_seconds=2.5)
    check(report, KEYS)
    assert report["scene"]["hash"] == scene_hash(run.bundle)
    assert report["model"] == "hybrid" and report["steps"] == 30
    assert report["parts"]["body.near"]["n_elements"] == {"min": 32.0, "mean": 32.0, "max": 32.0}
    assert_allclose(report["quantities"]["grip_force"]["max"], 13.1)
    assert len(report["quantities"]["lift_height"]["values"]) == len(report["energy"]["time"]) == 30
    assert [event["kind"] for event in report["events"]] == ["tools", "regions", "tools"]
    assert_allclose(report["exchanges"]["mean"], np.mean([1 + k % 3 for k in range(1, 31)]))


def test_what_steps_damp_and_make_of_energy_is_told_apart() -> None:
    builder = ReportBuilder(Squeeze(3).bundle)
    steps = [message for message in Squeeze(3).messages() if isinstance(message, StepReport)]
    for message, dissipation in zip(steps, (3e-3, -1e-6, 2e-3), strict=True):
        builder.add(
            replace(message, energy={**message.energy, "kinetic": 0.5, "strain": 1.0, "dissipation": dissipation})
        )
    energy = builder.build()["energy"]
    assert_allclose([energy["damped"], energy["balance_error"], energy["largest"]], [5e-3, 1e-6, 1.5])


@pytest.mark.parametrize("push", [(0.3, 0.0, -0.4), (0.0, 0.0, 2.0), (-1.2, 0.5, 0.0)])
def test_forces_of_tools_are_quantities_but_of_a_grips(push: tuple[float, float, float]) -> None:
    """Of each tool that is not one of two that close, its size; the grip's own force tells of those."""
    builder = ReportBuilder(Squeeze(3).bundle)
    for message in Squeeze(3).messages():
        if isinstance(message, StepReport):
            wrench = message.wrench.copy()
            wrench[3] = (*push, 7.0, 7.0, 7.0)
            message = replace(message, wrench=wrench)
        builder.add(message)
    found = builder.build()["quantities"]
    assert {name for name in found if name.endswith(".force")} == {"ground.force", "ball.force"}
    ball = found["ball.force"]
    assert_allclose(ball["values"], np.linalg.norm(push))
    assert (ball["unit"], ball["asked"], ball["measured"]) == ("N", False, 3)
    assert found["ground.force"]["max"] == 0.0


def test_set_up_is_no_part_of_the_real_time_factor() -> None:
    """10 ms of motion in 0.6 ms of wall time."""
    wall = build(Squeeze(10), setup_seconds=1e3)["wall"]
    assert_allclose([wall["rtf"], wall["rtf_median_step"], wall["setup"]], [0.01 / 6e-4, 0.01 / 6e-4, 1e3])


def test_it_is_built_up_step_by_step() -> None:
    """A report of half a run says so, and equals the beginning of the whole run's."""
    run = Squeeze(20)
    builder = ReportBuilder(run.bundle)
    for message in run.messages():
        if message.header.step >= 10:
            break
        builder.add(message)
    half, whole = builder.build(), build(run)
    assert half["steps"] == 10 and "ends early at 0.1 s" in half["verdict"]["text"]
    assert half["quantities"]["slip"]["values"] == whole["quantities"]["slip"]["values"][:10]


@pytest.mark.parametrize(("drop", "outcome"), [(False, "lifted"), (True, "dropped")])
def test_a_dropped_body_is_called_dropped(drop: bool, outcome: str) -> None:
    verdict = build(Squeeze(40, drop=drop))["verdict"]
    assert verdict["outcome"] == outcome and verdict["text"].startswith(outcome)


def test_a_run_without_steps_has_a_report() -> None:
    run = Squeeze(1)
    report = ReportBuilder(run.bundle).build()
    json.dumps(report, allow_nan=False)
    assert report["verdict"] == {"outcome": "unfinished", "text": "no step was taken", "done": False}
    assert report["wall"]["rtf"] is None


def test_from_a_recording_it_is_the_same_as_from_the_run(tmp_path: Path) -> None:
    run = Squeeze(15)
    with McapRecorder(tmp_path / "run.mcap", run.begin) as recorder:
        for message in run.messages():
            recorder.write(message)
    recording = Recording(tmp_path / "run.mcap")
    builder = ReportBuilder(recording.bundle, facts=recording.facts)
    for message in recording:
        builder.add(message)
    assert builder.build() == build(run)


def test_the_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    report = build(Squeeze(5))
    write_report(report, path)
    assert json.loads(path.read_text()) == report
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_report({"bad": math.nan}, path)
    assert json.loads(path.read_text()) == report, "the file that was there stays"
    assert [p.name for p in tmp_path.iterdir()] == ["report.json"]


def outcome(run: Squeeze, *, touching: bool, slip: float | None = None) -> str:
    """The verdict on a run whose tools keep pressing, or do not, and with another slip [m], gone in the last step."""
    builder = ReportBuilder(run.bundle)
    for message in run.messages():
        if isinstance(message, StepReport):
            wrench = message.wrench.copy()
            wrench[1:3, 0] = (-13.0, 13.0) if touching or message.header.step < 20 else 0.0
            wrench[1:3, 2] = 0.0
            quantities = message.quantities if slip is None else {**message.quantities, "slip": slip}
            if message.done:
                quantities = {**quantities, "slip": 0.0}
            message = replace(message, wrench=wrench, quantities=quantities)
        builder.add(message)
    return builder.verdict.outcome


def test_what_counts_as_dropped() -> None:
    """Slid down between tools that still press; or no longer pressed; but not a long body that hangs from the tools."""
    assert outcome(Squeeze(40, drop=True), touching=True) == "dropped"
    assert outcome(Squeeze(40), touching=False) == "dropped"
    assert outcome(Squeeze(40, drop=True), touching=True, slip=1e-4) == "lifted"
    assert outcome(Squeeze(40), touching=True) == "lifted"
