"""What `softseam run` claims and says of it, and the process of the sibling beside it."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from claimed_block import BLOCK, write_block
from rich.console import Console

from softseam.claims.beside import Beside, Lost
from softseam.claims.claim import FINER, LEAST, SMALL, Scale, claims, difference
from softseam.running import Wishes, run
from softseam.scenes import bundle_of
from softseam_protocol.messages.participant import Bundle

pytestmark = pytest.mark.kernels

BEAM = """\
softseam: 1
name: beam
gravity: [0, 0, -9.81]
step: 0.01
duration: 0.2
body:
  shape: {kind: block, size: [0.12, 0.04, 0.04]}
  cell: [0.02, 0.02, 0.02]
  material: {kind: neo_hookean, young: 5.0e4, poisson: 0.4, density: 1000}
  fixed:
    - {min: [-1, -1, -1], max: [-0.06, 1, 1]}
regions: {default: fem}
quantities: [tip_deflection]
"""


@pytest.fixture
def block(tmp_path: Path) -> str:
    return write_block(tmp_path)


def ran(scene: str, *settings: str, **wishes: Any) -> tuple[dict[str, Any], str]:
    """The report of `softseam run`, and what it printed."""
    said = StringIO()
    report = run(Wishes(scene, settings=settings, **wishes), Console(file=said, width=400))
    return report, said.getvalue()


def value(of: Mapping[str, Any], name: str = "grip_force") -> Any:
    return of["claims"]["quantities"][name]


@pytest.mark.slow
def test_a_run_claims(block: str) -> None:
    """By a process beside it: what two runs one after the other claim, bit for bit."""
    first, said = ran(block)
    claimed = first["claims"]
    scale = Scale.of(bundle_of(block)[0], first, finer=False, cell=0.01)
    assert claimed["settled"] and claimed["factor"] == scale.factor > SMALL
    longer, _ = ran(block, *claimed["sibling"]["settings"], estimate=False)
    assert claimed["quantities"] == claims(first["quantities"], longer["quantities"], scale)
    force = value(first)["end"]["absolute"]
    assert force > 0.0 and f"± {force:.2g} N" in said and claimed["text"] in said
    assert value(first, "compression")["share"] < 1.5 * LEAST  # which is what was asked for


def off(run: Mapping[str, Any], other: Mapping[str, Any], name: str = "grip_force") -> float:
    """The difference of two reports."""
    return difference(run["quantities"][name], other["quantities"][name])[0]


@pytest.mark.slow
def test_the_claim_holds_for_a_known_error(tmp_path: Path) -> None:
    """A beam that swings down: at least what shorter cells and steps change, and at most five times that."""
    path = tmp_path / "beam.yaml"
    path.write_text(BEAM)
    claimed, said = ran(str(path))
    fine, _ = ran(str(path), "step=0.0025", "body.cell=[0.01, 0.02, 0.02]", estimate=False)
    error = off(fine, claimed, "tip_deflection")
    assert error < value(claimed, "tip_deflection")["absolute"] < 5.0 * error
    assert claimed["claims"]["growing"]["peak_von_mises"] > 1.3  # at the clamp
    assert " grows " in said and "peak von Mises: grows: 1." in said


@pytest.mark.slow
def test_the_claim_of_xpbd_sees_the_model(block: str) -> None:
    """At nu 0.495 XPBD locks: its claim covers what FEM on the same cells differs by."""
    poisson = "body.material.poisson=0.495"
    claimed, _ = ran(block, poisson, "regions={default: pbd}")
    fem, _ = ran(block, poisson, estimate=False)
    assert off(claimed, fem) > 0.03 * value(claimed)["absolute"] / value(claimed)["share"]
    assert value(claimed)["absolute"] > off(claimed, fem)


def test_a_goal_is_told_beside_the_claims(block: str) -> None:
    report, told = ran(block, "regions={default: fem, goal: grip_force}", estimate=False)
    assert report["estimated_error"]["goal"] == "grip_force"
    assert "grip_force: some" in " ".join(told.split())
    assert "estimated error" not in ran(block, estimate=False)[1]


def test_no_estimate(block: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Says what is lost, and starts nothing."""
    monkeypatch.setattr(Beside, "__enter__", lambda self: pytest.fail("a process was started"))
    found, said = ran(block, estimate=False)
    assert found["claims"]["settled"] is None and "not known" in said and "±" not in said


@pytest.mark.slow
def test_a_sibling_that_costs_much_is_run_where_it_is_asked_for(block: str) -> None:
    found, said = ran(block, "body.cell=0.04")
    assert found["claims"]["sibling"] is None and "--estimate" in said
    asked, _ = ran(block, "body.cell=0.04", estimate=True)
    assert asked["claims"]["factor"] == FINER and value(asked)["absolute"] > 0.0


def test_a_sibling_that_dies_harms_nothing(block: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is told in a line."""
    begin = Beside.begin

    def killed(self: Beside, bundle: Any) -> None:
        begin(self, bundle)
        os.kill(self.child.process.pid, signal.SIGKILL)

    monkeypatch.setattr(Beside, "begin", killed)
    found, said = ran(block)
    assert found["verdict"]["outcome"] == "finished" and found["claims"]["quantities"] == {}
    assert "no claims: the run to compare with failed: its process was ended by SIGKILL" in said
    json.dumps(found)


@pytest.mark.slow
def test_a_process_that_is_given_no_scene_is_lost() -> None:
    with Beside() as beside:
        beside.begin(Bundle(scene="{}", files={}))
        assert beside.ended(120.0)
        with pytest.raises(Lost, match="softseam"):
            beside.result()


@pytest.mark.slow
def test_a_sibling_ends_with_the_run_that_is_killed(block: str) -> None:
    """Its input ends: nothing is left, in the middle of a run of hours."""
    code = (
        "import os, signal, sys; from softseam.claims.beside import Beside; from softseam.scenes import bundle_of; "
        "beside = Beside().__enter__(); beside.begin(bundle_of(sys.argv[1])[1]); assert beside.begun(300.0); "
        "print(beside.child.process.pid, flush=True); os.kill(os.getpid(), signal.SIGKILL)"
    )
    Path(block).write_text(BLOCK.replace("motion:", "duration: 10000.0\nmotion:"))
    command = [sys.executable, "-c", code, block]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=400, check=False)
    assert done.returncode == -signal.SIGKILL
    try:
        left = os.pidfd_open(int(done.stdout))
    except ProcessLookupError:
        return
    try:
        assert select.select([left], [], [], 60.0)[0], "it still runs"
    finally:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(left, signal.SIGKILL)
        os.close(left)
