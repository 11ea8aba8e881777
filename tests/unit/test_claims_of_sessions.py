"""One voice: what a session claims is what `softseam run` claims, in its table, its report and its event."""

from __future__ import annotations

import json
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from claimed_block import write_block
from rich.console import Console

import softseam
from softseam.claims.repeated import resampled
from softseam.claims.sibling import NoSibling
from softseam.claims.voice import sentence
from softseam.running import Wishes, run
from softseam_protocol.messages.outcomes import TOO_FAR_OFF

CLOSE = {"left": [0.02, 0.0, 0.0], "right": [-0.02, 0.0, 0.0]}
COARSE = ("body.cell=[0.02, 0.02, 0.01]", "quantities=[grip_force, sag]")


@pytest.fixture
def block(tmp_path: Path) -> str:
    return write_block(tmp_path)


@pytest.mark.kernels
@pytest.mark.slow
def test_sessions_tables_and_events_tell_one_claim(block: str) -> None:
    said = StringIO()
    report = run(Wishes(block, settings=COARSE, estimate=True), Console(file=said, width=400))
    with softseam.open(block, settings=COARSE) as session:
        session.run()
        claims = session.claims()
        estimate = session.estimate_errors()
    assert claims["quantities"] == report["claims"]["quantities"]
    force = claims["quantities"]["grip_force"]
    worse = max(force["end"], force["peak"], key=lambda each: each["share"])
    (event,) = (event for event in report["events"] if event["kind"] == "accuracy")
    assert worse["share"] > TOO_FAR_OFF and f"± {worse['absolute']:.2g} N" in said.getvalue()
    assert f"± {worse['absolute']:.2g} N ({100.0 * worse['share']:.2g} %)" in event["message"]
    assert event["message"] == sentence(report, claims) and "make body.cell and step 0." in event["message"]
    assert estimate is not None and "forces" not in estimate.text and "energy norm" in estimate.text


@pytest.mark.kernels
@pytest.mark.slow
def test_a_session_that_is_stepped_by_hand_claims(block: str) -> None:
    """Alike whether its tools follow the scene's motion or are driven along the same way."""
    with softseam.open(block) as session:
        session.reset()
        with pytest.raises(softseam.BadInput, match=r"no step was taken"):
            session.claims()
        session.step(CLOSE, count=6, fields=False)
        kept = session.snapshot()
        by_hand = session.claims()["quantities"]["grip_force"]
        session.reset()
        session.run(max_steps=6)
        alone = session.claims()["quantities"]["grip_force"]
        assert by_hand["end"]["absolute"] == pytest.approx(alone["end"]["absolute"], rel=1e-3)
        session.restore(kept)
        with pytest.raises(softseam.BadInput, match=r"before restore\(\)"):
            session.claims()


@pytest.mark.kernels
def test_what_steps_damp_of_a_bounce_stands_beside_the_claims(tmp_path: Path) -> None:
    """An event each, with what to do."""
    material = {"kind": "neo_hookean", "young": 1e5, "poisson": 0.3, "density": 1000.0}
    body = {
        "shape": {"kind": "block", "size": [0.04] * 3},
        "cell": 0.02,
        "material": material,
        "position": [0, 0, 0.02],
    }
    tools = {"ground": {"kind": "plane"}}
    scene: dict[str, Any] = {"softseam": 1, "name": "falls", "duration": 0.2, "body": body, "tools": tools}
    file = tmp_path / "falls.yaml"
    file.write_text(json.dumps(scene | {"regions": {"default": "fem"}, "quantities": ["sag"]}))
    report = run(Wishes(str(file), estimate=True), Console(file=StringIO()))
    (bounce,) = (event["message"] for event in report["events"] if event["kind"] == "damped")
    assert report["claims"]["settled"] and "bounces too little; shorten the step" in bounce


def test_what_is_known_well_is_no_event() -> None:
    """And neither is stress, which is told of in the energy norm, nor what nobody asks for; what is not settled is."""
    good: dict[str, Any] = {"absolute": 0.01, "share": 0.01, "why": ""}
    bad: dict[str, Any] = {"absolute": None, "share": None, "why": "not settled: so"}
    large: dict[str, Any] = {"absolute": 0.4, "share": 0.4, "why": ""}
    creeps = bad | {"why": "creeps: it does"}
    cases = {
        "grip_force": (good, large, "N", True),
        "sag": (good, good, "m", True),
        "slip": (creeps, creeps, "m", True),
        "lift_height": (large, large, "m", False),
        "peak_von_mises": (large, large, "Pa", True),
    }
    claims: dict[str, Any] = {
        name: {"end": {"value": 1.0} | end, "peak": {"value": 2.0} | peak} for name, (end, peak, _, _) in cases.items()
    }
    report = {"quantities": {name: {"unit": unit, "asked": asked} for name, (_, _, unit, asked) in cases.items()}}
    told = sentence(report, {"settled": True, "quantities": claims})
    assert told == "grip force at its peak ± 0.4 N (40 %): make body.cell and step 0.35 times as long"
    assert sentence(report, {"settled": None, "quantities": {}}) == ""
    claims["sag"]["end"] = bad | {"value": 0.1}  # next to nothing
    assert sentence(report, {"settled": True, "quantities": claims}) == told
    claims["sag"]["end"]["value"] = 1.0
    assert "sag at the end not settled: so: make body.cell and step 0.25" in sentence(
        report, {"settled": True, "quantities": claims}
    )


def test_commands_of_two_steps_are_those_of_one_twice_as_long() -> None:
    """Which ends at the same place; what a tool holds is of the second; turns and moves of one tool go together."""
    first, then = (
        {"a": np.array([1.0, 0, 0])},
        {"a": np.array([0.0, 0, 0, 0, 2.0, 0, 1.0]), "b": np.array([2.0, 0, 0])},
    )
    (mean,) = resampled([first, then, first], finer=False)
    assert mean is not None
    assert mean["a"].tolist() == [0.5, 0, 0, 0, 1.0, 0, 1.0] and mean["b"].tolist() == [1.0, 0, 0]
    assert resampled([None, None], finer=False) == [None] and resampled([None], finer=True) == [None, None]
    with pytest.raises(NoSibling, match="by hand"):
        resampled([None, first], finer=False)
