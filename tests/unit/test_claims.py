"""Claims: which sibling a scene has, what the difference of two runs claims, and what `softseam run` says of it."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from softseam.claims.beside import Beside, Lost
from softseam.claims.claim import (
    BEYOND,
    BEYOND_OTHERWISE,
    FINER,
    LEAST,
    LEAST_OF_TOOLS,
    OF_BLOWS,
    OF_MOTION,
    SMALL,
    Scale,
    claims,
    difference,
    motion_taken,
)
from softseam.claims.estimate import compared
from softseam.claims.sibling import NoSibling, Sibling, sibling_of
from softseam.running import Wishes, run
from softseam.scenes import bundle_of
from softseam.session import open_as_given
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import scene_json
from softseam_protocol.scene.scene import Scene

BLOCK = """\
softseam: 1
name: cube
gravity: [0, 0, 0]
step: 0.01
body:
  shape: {kind: block, size: [0.04, 0.04, 0.02]}
  cell: 0.01
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
tools:
  left: {kind: box, size: [0.01, 0.05, 0.03], position: [-0.0252, 0, 0.01], friction: 0.6}
  right: {kind: box, size: [0.01, 0.05, 0.03], position: [0.0252, 0, 0.01], friction: 0.6}
motion:
  - {tools: [left, right], close: 0.02, until: {compression: 0.06}}
regions: {default: fem}
quantities: [grip_force, compression]
"""
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
    path = tmp_path / "cube.yaml"
    path.write_text(BLOCK)
    return str(path)


def sibling(scene: str | Path | Scene, *settings: str) -> Sibling:
    with open_as_given(scene, settings=settings) as session:
        session.reset()
        return sibling_of(session.scene, session.last.frames)


def ran(scene: str, *settings: str, **wishes: Any) -> tuple[dict[str, Any], str]:
    """The report of `softseam run`, and what it printed."""
    said = StringIO()
    report = run(Wishes(scene, settings=settings, **wishes), Console(file=said, width=400))
    return report, said.getvalue()


def entry(time: Any, values: Any) -> dict[str, list[float | None]]:
    """As a report has it of a quantity."""
    plain = [float(value) if np.isfinite(value) else None for value in values]
    return {"time": np.asarray(time).tolist(), "values": plain}


# ---- the sibling


def test_cells_and_steps_are_twice_as_long(block: str) -> None:
    """And nothing else differs; its settings make it of the scene at the command line."""
    found = sibling(block)
    assert not found.finer and found.scene.step == 0.02
    assert found.settings == ("step=0.02", "regions={default: fem}", "body.cell=[0.02, 0.02, 0.02]")
    assert found.scene.tools == bundle_of(block)[0].tools and found.scene.motion == bundle_of(block)[0].motion
    assert found.share < 0.2


def test_a_run_of_another_model_has_a_sibling_of_fem(block: str) -> None:
    """So that what the model errs by is in the difference."""
    assert sibling(block, "regions={default: pbd}").scene.regions.default == "fem"
    assert sibling("tofu_pads").scene.regions.near is None


def test_a_scene_that_names_no_model_is_foreseen_as_what_it_gets(block: str) -> None:
    """Small bodies get FEM; who sets what is XPBD's alone gets that, of which a sibling of FEM is a larger share."""
    open_ = Path(block).read_text().replace("regions: {default: fem}\n", "")
    Path(block).write_text(open_)
    assert sibling(block).share == sibling(block, "regions={default: fem}").share
    of_pbd = sibling(block, "models.pbd.sweeps=2").share
    assert of_pbd == sibling(block, "regions={default: pbd}").share != sibling(block).share


def test_a_body_of_one_cell_has_a_finer_sibling(block: str) -> None:
    """Which takes longer than the run, and is told to."""
    found = sibling(block, "body.cell=0.04")
    assert found.finer and found.settings[0] == "step=0.005" and found.settings[-1] == "body.cell=[0.02, 0.02, 0.01]"
    assert found.share > 1.0


def test_cells_of_a_mesh_are_told_by_its_nodes() -> None:
    """The default edge, which no scene file says."""
    with open_as_given("sausage", settings=("body.cell=null",)) as session:
        nodes = session.reset().frames["body"].x
        found = sibling_of(session.scene, session.last.frames)
    with open_as_given("sausage", settings=found.settings) as session:
        other = session.reset().frames["body"].x
    assert len(other) < 0.4 * len(nodes)
    np.testing.assert_allclose(np.ptp(other, axis=0), np.ptp(nodes, axis=0), rtol=1e-9)


def test_planes_of_symmetry_are_left_out() -> None:
    """For longer cells may lie across one; all of several bodies have longer cells, and FEM."""
    found = sibling("tofu_grasp", "symmetry=[y]", "regions={default: fem}")
    assert "symmetry=[]" in found.settings and found.scene.symmetry == ()


def test_every_body_has_longer_cells(block: str) -> None:
    document = json.loads(scene_json(bundle_of(block)[0]))
    body = document.pop("body") | {"regions": {"default": "pbd"}}
    document |= {"bodies": {"one": body, "two": body | {"cell": 0.02, "position": [0, 0.2, 0]}}}
    document |= {"motion": [], "duration": 0.02}
    found = sibling(Scene.model_validate(document))
    cells = {name: getattr(each, "cell", None) for name, each in found.scene.bodies.items()}
    assert cells == {"one": pytest.approx((0.02, 0.02, 0.02)), "two": pytest.approx((0.04, 0.04, 0.02))}
    assert all(found.scene.of(name).regions.default == "fem" for name in cells)


def test_particles_have_none() -> None:
    with pytest.raises(NoSibling, match="particles"):
        sibling("rope")


@pytest.mark.parametrize("turn", [0.26, 0.34, 0.49])
def test_a_tool_may_turn_too_far_in_a_step_twice_as_long(block: str, turn: float) -> None:
    """Then there is none, and what is told names the key and no setting that nobody made."""
    document = json.loads(scene_json(bundle_of(block)[0]))
    tool, step = next(iter(document["tools"])), document["step"]
    motion = [{"tools": [tool], "turn": [0, 0, 1.0], "speed": turn / step, "about": [0, 0, 0]}]
    with pytest.raises(NoSibling, match=r"twice as long the scene would be wrong: motion\.0\.speed: .* rad a step"):
        sibling(Scene.model_validate(document | {"motion": motion}))


# ---- what the difference claims


def test_a_claim_is_the_norm_of_the_difference_over_time() -> None:
    """Of sin t and 1.1 sin t over whole periods: 0.1/sqrt(2), whatever the steps; a gap in a column is left out."""
    time = np.linspace(0.0, 4.0 * np.pi, 401)[1:]
    coarse = time[1::2]
    missing = np.where(np.arange(len(time)) % 5, 1.1 * np.sin(time), np.nan)
    found = claims(
        {"sag": entry(time, np.sin(time)), "slip": entry(time, missing), "lift_height": entry(time, 0.0 * time)},
        {name: entry(coarse, size * np.sin(coarse)) for name, size in (("sag", 1.1), ("slip", 1.0))}
        | {"lift_height": entry(coarse, 0.0 * coarse)},
        Scale(alike=True, taken=0.0),
    )
    share = SMALL * (0.05 + BEYOND * 0.05) + LEAST
    assert found["sag"]["share"] == pytest.approx(share, rel=5e-3)
    assert found["sag"]["absolute"] == pytest.approx(share / np.sqrt(2.0), rel=5e-3)
    assert found["slip"]["share"] == pytest.approx(SMALL * (0.05 + BEYOND * (0.1 / 1.1 - 0.05)) + LEAST, rel=0.02)
    assert found["lift_height"] == {"absolute": 0.0, "share": None}


@pytest.mark.parametrize("taken", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("off", [0.0, 0.01, 0.05, 0.8])
@pytest.mark.parametrize("alike", [True, False])
def test_a_large_difference_counts_less_and_lost_motion_more(alike: bool, off: float, taken: float) -> None:
    """What exceeds a twentieth counts BEYOND times; all of it OF_MOTION times what the steps took of motion."""
    right = rule(off, taken, BEYOND if alike else BEYOND_OTHERWISE)
    assert Scale(alike, taken).claim(3.0 * off, 3.0, 7.0) == pytest.approx(3.0 * (right + LEAST))
    assert Scale(alike, taken, finer=True).claim(off, 1.0, 0.3) == pytest.approx(FINER * off + LEAST)


@pytest.mark.parametrize("off", [0.0, 0.09, 0.1, 0.12, 0.8])
def test_what_a_force_times_is_known_to_a_step(off: float) -> None:
    """Which is claimed, and of the difference what it has beyond that."""
    timed = Scale(alike=True, taken=0.2, timed=True)
    beyond = max(0.0, off - 0.1)
    assert timed.claim(off, 1.0, 0.1) == pytest.approx(0.1 + LEAST + rule(beyond, 0.2))
    assert replace(timed, finer=True).claim(off, 1.0, 0.1) == pytest.approx(0.1 + LEAST + FINER * beyond)


@pytest.mark.parametrize("off", [0.01, 0.04, 0.3])
@pytest.mark.parametrize("held", [False, True])
def test_forces_of_tools_on_what_nothing_holds_claim_more(block: str, off: float, held: bool) -> None:
    """Those that stop its fall; a rod that presses on what is fixed, and all else, is claimed as ever."""
    document = json.loads(scene_json(bundle_of(block)[0]))
    document["body"]["fixed"] = [{"min": [-1, -1, -1], "max": [1, 1, 0.001]}] if held else []
    scale = Scale.of(Scene.model_validate(document), report(), finer=False)
    run, other = (
        {name: entry([0.1, 0.2, 0.3], 3 * [size]) for name in ("table.force", "sag")} for size in (1.0, 1.0 + off)
    )
    found = claims(run, other, scale)
    shares = [float(found[name]["share"] or 0.0) - OF_MOTION * scale.taken * off for name in found]
    small = min(off, 0.05) + BEYOND * max(0.0, off - 0.05)
    forces = (SMALL if held else OF_BLOWS) * small + LEAST_OF_TOOLS
    assert shares == pytest.approx([forces, SMALL * small + LEAST])


def rule(off: float, taken: float, beyond: float = BEYOND) -> float:
    """What a difference adds to the claim of a quantity of size 1."""
    small = min(off, 0.05)
    return SMALL * (small + beyond * (off - small)) + OF_MOTION * taken * off


def test_a_lift_that_begins_late_is_covered_by_what_it_does_in_a_step() -> None:
    """The run begins it one of its steps late, the sibling one of its own, which are twice as long."""
    fine = np.linspace(0.0, 1.0, 401)
    lifts = [np.clip(fine - 0.3 - late, 0.0, 0.4) for late in (0.0, 0.02, 0.04)]
    run, sibling = entry(fine[::8], lifts[1][::8]), entry(fine[::16], lifts[2][::16])
    claimed = claims({"lift_height": run}, {"lift_height": sibling}, Scale(alike=True, taken=0.0, timed=True))
    error, size = difference(run, entry(fine, lifts[0]))
    assert error < float(claimed["lift_height"]["absolute"] or 0.0) < 1.2 * error + LEAST * size


def test_steps_take_no_more_motion_than_there_was() -> None:
    """Of two steps that take .3 J each, where .1 J move after the first and .8 J before the second: .1 and .3 of 2 J.

    A step that creates energy takes none; nothing is taken where nothing is.
    """
    energy = ledger([0.0, 0.1, 0.8, 0.0, 0.0], [0.3, 0.3, -0.1, 0.3, 0.3])
    assert motion_taken(energy) == pytest.approx((0.1 + 0.3) / 2.0)
    assert motion_taken(energy | {"largest": 0.01}) == 1.0
    assert motion_taken(energy | {"largest": 0.0}) == 0.0


def ledger(kinetic: list[float], dissipation: list[float]) -> dict[str, Any]:
    """As a report has it of a run whose largest energy is 2 J."""
    return {"ledger": {"kinetic": kinetic, "dissipation": dissipation}, "largest": 2.0}


@pytest.mark.parametrize(
    ("until", "force", "timed"),
    [({"compression": 0.1}, None, False), ({"time": 0.1}, 2.0, True), ({"force": 1.0}, None, True)],
)
def test_forces_time_motion_where_they_end_a_phase_or_are_kept(
    until: dict[str, float], force: float | None, timed: bool
) -> None:
    """Of a grip: one that it waits for, and its own."""
    grip = {"tools": ["left", "right"], "close": 0.02, "until": until, **({"force": force} if force else {})}
    scene = Scene.model_validate(
        {**json.loads(scene_json(bundle_of("tofu_grasp")[0])), "motion": [grip, {"hold": 0.1}]}
    )
    scale = Scale.of(scene, report(), finer=False)
    assert (scale.alike, scale.timed) == (True, timed) and scale.taken == pytest.approx(0.1)
    told = compared(report(), report() | {"outcome": "lifted", "seconds": 0.25}, Sibling(scene, (), False, 0.2))["text"]
    assert ("a force times the motion" in told) == timed
    rising = {"grip_force": entry([0.1, 0.2, 0.3], [1.0, 1.2, 1.4])}
    same = claims(rising, rising, scale)["grip_force"]["absolute"]
    assert same == pytest.approx(LEAST * 1.2 + (0.2 if timed else 0.0), rel=0.02)


def report(outcome: str = "lifted") -> dict[str, Any]:
    """A tenth of its largest energy was motion that its steps took."""
    grip = entry([0.1, 0.2, 0.3], [1.0, 1.0, 1.0])
    lasted = {"wall": {"total": 2.0, "cpu": 1.0}, "model": "fem"}
    lasted["energy"] = ledger([1.0, 1.0, 1.0], [0.0, 0.2, 0.0])
    return {"verdict": {"outcome": outcome}, "quantities": {"grip_force": grip}, **lasted}


def test_nothing_is_claimed_of_what_a_run_says_of_its_own_errors() -> None:
    """A residual is this run's alone; the sag beside it is claimed."""
    here, there = ({"time": [0.1, 0.2], "values": values} for values in ([1.0, 2.0], [1.1, 2.1]))
    run, sibling = ({"sag": entry, "constraint_residual": entry} for entry in (here, there))
    assert set(claims(run, sibling, Scale(alike=True, taken=0.0))) == {"sag"}


def test_outcomes_that_differ_are_not_settled(block: str) -> None:
    """No number stands beside a body that one run lifts and the other drops."""
    other = {"outcome": "dropped", "quantities": report()["quantities"], "seconds": 0.25}
    found = compared(report(), other, sibling(block))
    assert found["settled"] is False and found["quantities"] == {}
    assert "not settled" in found["text"] and "'dropped'" in found["text"] and "shorten body.cell" in found["text"]
    same = compared(report("dropped"), other, sibling(block))
    assert same["settled"] is True and same["quantities"]["grip_force"]["share"] == pytest.approx(LEAST)
    assert same["sibling"]["share"] == 0.25


def test_a_peak_that_grows_as_cells_shrink_is_claimed_nothing_of(block: str) -> None:
    """Which of both has the shorter cells depends; what settles may differ as much, and the table says so."""
    found = sibling(block)
    mine: dict[str, Any] = report()
    other: dict[str, Any] = {"outcome": "lifted", "seconds": 0.25, "quantities": {}}
    for name, ratio in (("grip_force", 1.3), ("peak_von_mises", 1.3), ("jelly.peak_von_mises", 1.05)):
        mine["quantities"][name] = entry([0.1, 0.2], [ratio, ratio])
        other["quantities"][name] = entry([0.1, 0.2], [1.0, 1.0])
    claimed = compared(mine, other, found)
    assert claimed["growing"] == {"peak_von_mises": pytest.approx(1.3)}
    assert set(claimed["quantities"]) == {"grip_force", "jelly.peak_von_mises"}
    turned = compared(mine | other, mine | {"outcome": "lifted", "seconds": 0.25}, replace(found, finer=True))
    assert turned["growing"] == {"peak_von_mises": pytest.approx(1.3)}


# ---- `softseam run`


def value(of: Mapping[str, Any], name: str = "grip_force") -> Any:
    return of["claims"]["quantities"][name]


@pytest.mark.slow
def test_a_run_claims(block: str) -> None:
    """By a process beside it: what two runs one after the other claim, bit for bit."""
    first, said = ran(block)
    claimed = first["claims"]
    scale = Scale.of(bundle_of(block)[0], first, finer=False)
    assert claimed["settled"] and claimed["factor"] == scale.factor > SMALL
    longer, _ = ran(block, *claimed["sibling"]["settings"], estimate=False)
    assert claimed["quantities"] == claims(first["quantities"], longer["quantities"], scale)
    force = value(first)["absolute"]
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
    assert " grows " in said and "peak von Mises grew 1." in said


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
        os.kill(self.process.pid, signal.SIGKILL)

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
        "print(beside.process.pid, flush=True); os.kill(os.getpid(), signal.SIGKILL)"
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
