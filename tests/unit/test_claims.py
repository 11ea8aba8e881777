"""What the difference of two runs claims."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from claimed_block import sibling, write_block

from softseam.claims.claim import (
    BESIDE,
    BEYOND,
    BEYOND_OTHERWISE,
    FINER,
    LEAST,
    LEAST_OTHERWISE,
    OF_BLOWS,
    OF_CURVE,
    OF_MEAN,
    OF_MOTION,
    OF_REST,
    OF_SLIP,
    OF_STRESS,
    SLIDES,
    SMALL,
    Scale,
    claims,
    difference,
    in_a_step,
    motion_taken,
)
from softseam.claims.estimate import compared
from softseam.claims.sibling import Sibling
from softseam.scenes import bundle_of
from softseam_protocol.scene.file import scene_json
from softseam_protocol.scene.scene import Scene


@pytest.fixture
def block(tmp_path: Path) -> str:
    return write_block(tmp_path)


def entry(time: Any, values: Any) -> dict[str, list[float | None]]:
    """As a report has it of a quantity."""
    plain = [float(value) if np.isfinite(value) else None for value in values]
    return {"time": np.asarray(time).tolist(), "values": plain}


def test_a_claim_is_the_norm_of_the_difference_over_time() -> None:
    """Of sin t and 1.1 sin t over whole periods: 0.1/sqrt(2), whatever the steps; a gap in a column is left out."""
    time = np.linspace(0.0, 4.0 * np.pi, 401)[1:]
    coarse = time[1::2]
    missing = np.where(np.arange(len(time)) % 5, 1.1 * np.sin(time), np.nan)
    found = claims(
        {"sag": entry(time, np.sin(time)), "grip_force": entry(time, missing), "lift_height": entry(time, 0.0 * time)},
        {name: entry(coarse, size * np.sin(coarse)) for name, size in (("sag", 1.1), ("grip_force", 1.0))}
        | {"lift_height": entry(coarse, 0.0 * coarse)},
        Scale(alike=True, taken=0.0),
    )
    share = SMALL * (0.05 + BEYOND * 0.05) + LEAST
    assert found["sag"]["share"] == pytest.approx(share, rel=5e-3)
    assert found["sag"]["absolute"] == pytest.approx(share / np.sqrt(2.0), rel=5e-3)
    assert found["grip_force"]["share"] == pytest.approx(SMALL * (0.05 + BEYOND * (0.1 / 1.1 - 0.05)) + LEAST, rel=0.02)
    assert found["lift_height"]["absolute"] == 0.0 and found["lift_height"]["share"] is None


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
    forces = (SMALL if held else OF_BLOWS) * small + LEAST_OTHERWISE
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


def grip(until: dict[str, float], force: float | None = None) -> Scene:
    """Tofu that is gripped so."""
    close = {"tools": ["left", "right"], "close": 0.02, "until": until, **({"force": force} if force else {})}
    return Scene.model_validate(
        {**json.loads(scene_json(bundle_of("tofu_grasp")[0])), "motion": [close, {"hold": 0.1}]}
    )


@pytest.mark.parametrize(
    ("until", "force", "timed"),
    [({"compression": 0.1}, None, False), ({"time": 0.1}, 2.0, True), ({"force": 1.0}, None, True)],
)
def test_forces_time_motion_where_they_end_a_phase_or_are_kept(
    until: dict[str, float], force: float | None, timed: bool
) -> None:
    """Of a grip: one that it waits for, and its own."""
    scene = grip(until, force)
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


PLAIN = Scale(alike=True, taken=0.0)
NUMBER = replace(PLAIN, least=LEAST_OTHERWISE)
"""of what is read off a curve"""
TIME = np.linspace(0.1, 1.0, 10)


def claimed(name: str, run: Any, sibling: Any, scale: Scale = PLAIN) -> dict[str, Any]:
    """Of a quantity with these values at TIME."""
    return claims({name: entry(TIME, run)}, {name: entry(TIME, sibling)}, scale)[name]


def test_what_stands_at_the_end_is_claimed_by_the_end() -> None:
    """A body that tools let go of ends at 0 N in both runs, however they differ while it is held."""
    held = np.where(TIME < 0.7, 10.0, 0.0)
    found = claimed("grip_force", held, 1.2 * held)
    assert found["absolute"] > 1.0
    assert found["end"]["absolute"] < 0.1 * found["absolute"] and found["end"]["why"] == ""
    apart = claimed("grip_force", held, held + np.where(TIME < 0.9, 0.0, 2.0))
    assert apart["end"]["absolute"] is None and apart["end"]["why"] == (
        "not settled: 0 N here, 2 N with longer cells and steps"
    )


def test_a_peak_is_claimed_by_the_peaks_of_both_runs() -> None:
    """A blow that both runs end alike after; a swing downwards has its peak below."""
    blow = np.where(np.arange(10) == 4, 1.0, 0.0) + 1.0
    found = claimed("grip_force", blow, np.where(blow > 1.5, 1.6, 1.0))
    own, over = abs(2.0 - 1.6), OF_CURVE * difference(entry(TIME, blow), entry(TIME, np.minimum(blow, 1.6)))[0]
    rule = NUMBER.claim(max(own, over), 2.0, 0.0) + BESIDE * 1.0
    assert found["peak"]["absolute"] == pytest.approx(rule)
    assert found["end"]["absolute"] < 0.6 * found["peak"]["absolute"]
    squeeze = np.minimum(TIME, 0.45)
    assert claimed("compression", squeeze, squeeze)["peak"]["share"] == pytest.approx(LEAST)  # tools stop within a step
    swing = claimed("tip_deflection", -TIME, -0.9 * TIME)
    assert swing["peak"]["value"] == -1.0 and swing["mean"]["value"] == pytest.approx(-0.55)
    assert swing["peak"]["absolute"] > swing["mean"]["absolute"] > 0.0


def test_a_peak_that_a_force_ends_is_known_to_a_step() -> None:
    """It is passed at the end of a step: by a grip's force, and by the compression that takes."""
    timed = Scale.of(grip({"force": 1.0}), report(), finer=False)
    rising = np.minimum(TIME, 0.5)
    for name in ("grip_force", "compression"):
        found = claimed(name, rising, rising, timed)["peak"]
        assert found["absolute"] == pytest.approx(0.1 + LEAST_OTHERWISE * found["value"])


def test_curves_that_meet_are_known_to_a_share_of_their_difference() -> None:
    """Numbers that differ by more are to that; of a mean errors at both signs are less."""
    crossing = TIME + 0.08 * np.cos(np.pi * TIME / 2.0)
    (off, size), found = difference(entry(TIME, TIME), entry(TIME, crossing)), claimed("sag", TIME, crossing)
    assert found["end"]["absolute"] == pytest.approx(NUMBER.claim(OF_CURVE * off, 1.0, 0.0))
    mean = float(np.trapezoid(crossing - TIME, TIME) / np.ptp(TIME))
    assert mean > OF_CURVE * off
    assert found["mean"]["absolute"] == pytest.approx(OF_MEAN * NUMBER.claim(mean, size, 0.0))


def test_what_a_mesh_differs_by_counts_more(tmp_path: Path) -> None:
    """Its surface lies otherwise in other cells; stress is of a lower order, and more of what is large counts."""
    mesh = Scale.of(bundle_of("dumpling")[0], report(), finer=False)
    assert mesh.claim(0.3, 1.0, 0.0) == pytest.approx(rule(0.3, mesh.taken, BEYOND_OTHERWISE) + LEAST)
    for scale in (mesh, PLAIN):
        stress = scale.at("von_mises_p99")
        assert stress.claim(0.3, 1.0, 0.0) == pytest.approx(
            rule(0.3, scale.taken, OF_STRESS * BEYOND) + LEAST_OTHERWISE
        )
    by_xpbd = replace(PLAIN, alike=False).at("von_mises_p99")
    others = rule(0.3, PLAIN.taken, OF_STRESS * BEYOND_OTHERWISE)
    assert by_xpbd.claim(0.3, 1.0, 0.0) == pytest.approx(others + LEAST_OTHERWISE)


@pytest.mark.parametrize(("size", "free"), [(0.5, True), (2.0, True), (0.5, False)])
def test_where_a_body_comes_to_rest_its_last_hops_are_claimed(size: float, free: bool) -> None:
    """Steps take them, in both runs alike; of what moves by less than a fifth of a cell, and nothing holds."""
    scale = Scale(alike=True, taken=0.2, free=free, cell=SLIDES**-1).at("top.displacement")
    hops = OF_REST * 0.2 * size if size < 1.0 and free else 0.0
    assert scale.claim(0.0, size, 0.0) == pytest.approx(LEAST * size + hops)


def test_factors_are_told_by_what_they_are_of() -> None:
    """Slip's was given as that of tools' forces."""
    still = {"kinetic": [0.0, 0.0], "dissipation": [0.0, 0.0]}
    run = report() | {"energy": {"ledger": still, "largest": 1.0}}
    run["quantities"] = {name: entry([0.1, 0.2], [1.0, 2.0]) for name in ("grip_force", "slip", "ground.force")}
    found = compared(run, run | {"outcome": "lifted", "seconds": 0.25}, Sibling(grip({"time": 1.0}), (), False, 0.2))
    assert "± is 2 times the difference (of tools' forces 2.4, of slip 3), less" in found["text"]
    del run["quantities"]["slip"]
    found = compared(run, run | {"outcome": "lifted", "seconds": 0.25}, Sibling(grip({"time": 1.0}), (), False, 0.2))
    assert "± is 2 times the difference (of tools' forces 2.4), less" in found["text"]


@pytest.mark.parametrize("grows", [1.2, 8.0])
def test_what_differs_by_more_than_itself_is_not_settled(grows: float) -> None:
    """No number stands beside it, but what the other run found; twice as much is a number."""
    found = claimed("sag", TIME, (1.0 + grows) * TIME)
    told = [found, found["end"], found["peak"], found["mean"]]
    if grows < 3.0:
        assert all(0.0 < each["share"] <= 1.0 and not each["why"] for each in told)
        return
    assert all(each["absolute"] is None and each["share"] is None for each in told)
    assert all(each["why"].startswith("not settled: ") for each in told)
    assert found["end"]["why"].startswith("not settled: 1000 mm here, 9000 mm with")
    nothing = claimed("lift_height", 0.0 * TIME, 0.0 * TIME)
    assert nothing["end"]["absolute"] == 0.0 and nothing["end"]["why"] == ""
    blow = np.where(TIME < 0.25, 9.0, 0.4)
    alike = claimed("table.force", blow, np.where(TIME < 0.25, 2.0, 0.4))["end"]["why"]
    assert "0.4 N here, 0.4 N with" in alike and "steps, and it differs by 77 % on the way" in alike


def test_every_quantity_has_a_claim_or_says_why_it_has_none() -> None:
    """A residual is this run's alone, a probe is the run's, and a NaN was never measured."""
    time, here, there = [0.1, 0.2], [1.0, 2.0], [1.1, 2.1]
    run = {name: entry(time, here) for name in ("sag", "constraint_residual", "core.von_mises", "von_mises_p99")}
    sibling = {name: entry(time, there) for name in ("sag", "constraint_residual")}
    sibling["von_mises_p99"] = entry(time, [np.nan, np.nan])
    found = claims(run, sibling, PLAIN)
    assert found["sag"]["absolute"] > 0.0 and found["sag"]["end"]["absolute"] > 0.0
    for name, words in (
        ("constraint_residual", "an estimate itself"),
        ("core.von_mises", "none: the run to compare with"),
        ("von_mises_p99", "none: never measured"),
    ):
        for told in (found[name], found[name]["end"], found[name]["peak"], found[name]["mean"]):
            assert told["absolute"] is None and told["why"].startswith(words)


@pytest.mark.parametrize("largest", [0.001, 0.004])
def test_slip_is_claimed_where_the_body_slides(largest: float) -> None:
    """And not where points creep by less than a fifth of a cell, of which cells twice as long tell nothing. What
    slides claims all of a large difference."""
    scale = Scale(alike=True, taken=0.0, cell=0.01)
    found = claimed("slip", largest * TIME, 1.3 * largest * TIME, scale)
    if largest < SLIDES * scale.cell:
        assert found["absolute"] is None and found["end"]["why"].startswith("creeps: ")
        slid = claimed("slip", largest * TIME, 40.0 * largest * TIME, scale)
        assert slid["end"]["absolute"] is None and slid["end"]["why"].startswith("not settled: ")
    else:
        run = entry(TIME, largest * TIME)
        late = in_a_step(run) / difference(run, run)[1]
        assert found["share"] == pytest.approx(2.0 * late + OF_SLIP * max(0.0, 0.3 - 2.0 * late) + LEAST)


@pytest.mark.kernels
def test_outcomes_that_differ_are_not_settled(block: str) -> None:
    """No number stands beside a body that one run lifts and the other drops."""
    other = {"outcome": "dropped", "quantities": report()["quantities"], "seconds": 0.25}
    found = compared(report(), other, sibling(block))
    assert found["settled"] is False and found["quantities"]["grip_force"]["absolute"] is None
    assert found["quantities"]["grip_force"]["end"]["why"].startswith("not settled: the outcome")
    assert "not settled" in found["text"] and "'dropped'" in found["text"] and "shorten body.cell" in found["text"]
    same = compared(report("dropped"), other, sibling(block))
    assert same["settled"] is True and same["quantities"]["grip_force"]["share"] == pytest.approx(LEAST)
    assert same["sibling"]["share"] == 0.25


@pytest.mark.kernels
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
    told = {name: each["absolute"] is not None for name, each in claimed["quantities"].items()}
    assert told == {"grip_force": True, "peak_von_mises": False, "jelly.peak_von_mises": True}
    assert claimed["quantities"]["peak_von_mises"]["peak"]["why"].startswith("grows: 1.3 times")
    turned = compared(mine | other, mine | {"outcome": "lifted", "seconds": 0.25}, replace(found, finer=True))
    assert turned["growing"] == {"peak_von_mises": pytest.approx(1.3)}
