"""The atlas's verdicts on made-up outcomes, its pictures, its controls that need no run, and bad requests."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest
from rich.console import Console

from softseam.errors import BadInput
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import Detail, EventKind
from softseam_protocol.messages.session import Event
from softseam_studies.atlas import pitfalls
from softseam_studies.atlas.atlas import Filled, write_csv
from softseam_studies.atlas.command import atlas
from softseam_studies.atlas.draw import draw_map, draw_overview, inside
from softseam_studies.atlas.grid import Cell, Map, Panel
from softseam_studies.atlas.scenes import force_share, press, pressed
from softseam_studies.atlas.trace import (
    CRUSHED,
    CUT,
    MORE_SWEEPS,
    PARTS,
    RESTORED,
    RETRIED,
    SHORTER,
    Trace,
    follow,
    guard_of,
    told_by,
)
from softseam_studies.atlas.verdicts import KINDS, Kind, Verdict, judge, percent
from softseam_studies.cli_studies import Atlas as Wishes


@pytest.mark.parametrize(
    ("trace", "kind", "silent"),
    [
        (Trace(value=1.01), "accurate", False),
        (Trace(value=1.01, safeguards={CUT: 2}), "recovered", False),
        (Trace(value=1.2), "inaccurate", True),
        (Trace(value=1.2, safeguards={CUT: 2}), "inaccurate", True),
        (Trace(value=1.2, warned=("a gap at the seam was kept",)), "inaccurate", False),
        (Trace(value=math.nan, finite=False, broke=0.1), "unstable", True),
        (Trace(value=1.0, finite=False, broke=0.1), "unstable", True),
        (Trace(value=1.01, created=0.2), "unstable", True),
        (Trace(value=1.01, created=0.2, warned=("alarm: energy from nowhere",)), "unstable", False),
        (Trace(value=1.01, gap=2.0), "unstable", True),
        (Trace(failed="step 3, near (fem): Newton's method did not converge"), "unstable", False),
        (Trace(refused="newmark cannot meet tools"), "refused", False),
    ],
)
def test_each_outcome_has_its_verdict(trace: Trace, kind: Kind, silent: bool) -> None:
    verdict = judge(trace, 1.0, 0.05, "force")
    assert (verdict.kind, verdict.silent) == (kind, silent)
    assert verdict.why
    assert Verdict.from_json(verdict.as_json()).as_json() == verdict.as_json()


def test_no_verdict_goes_without_an_explanation() -> None:
    with pytest.raises(ValueError, match="explanation"):
        Verdict("accurate", "")


def _event(kind: EventKind, *details: Detail, text: str = "") -> Event:
    return Event(Header(SCHEMA_VERSION, "s", "", 0, 3, 0, 0.0), kind, text, list(details))


def test_events_name_the_safeguards() -> None:
    """By kind and details: whatever the text says, it changes nothing."""
    assert guard_of(_event(EventKind.SEAM, Detail.PARTS, Detail.GAP_KEPT)) == PARTS
    assert guard_of(_event(EventKind.CELLS)) == CRUSHED
    assert guard_of(_event(EventKind.STEP)) == CUT
    assert guard_of(_event(EventKind.MONITOR, Detail.REPEATED, Detail.UNCONVERGED)) == RETRIED
    assert guard_of(_event(EventKind.MONITOR, Detail.SWEEPS)) == MORE_SWEEPS
    assert guard_of(_event(EventKind.MONITOR, Detail.SHORTER)) == SHORTER
    assert guard_of(_event(EventKind.MONITOR, Detail.UNCONVERGED, text="repeated with more sweeps, taken in")) is None
    assert guard_of(_event(EventKind.PARTICIPANT_RESTORED)) == RESTORED
    assert guard_of(_event(EventKind.REGIONS)) is None


def test_an_alarm_counts_where_the_whole_run_confirms_it() -> None:
    """At a first touch the ledger compares with next to nothing."""
    alarm = _event(EventKind.ENERGY, Detail.CREATED)
    assert told_by(Trace(events=(alarm,), created=1e-5)) == []
    assert told_by(Trace(events=(alarm,), created=1e-2)) == ["alarm: energy from nowhere"]
    kept = _event(EventKind.SEAM, Detail.GAP_KEPT)
    assert told_by(Trace(events=(kept, _event(EventKind.SOLVER)))) == [
        "a gap at the seam was kept",
        "a step was kept that had not converged",
    ]
    coarse = _event(EventKind.ACCURACY)
    assert told_by(Trace(events=(coarse,))) == ["event: the estimated error is too large"]


@pytest.mark.parametrize(
    ("share", "text"), [(8.9e-5, "0.0089 %"), (0.0223, "2.2 %"), (54.0, "5400 %"), (1e9, "1e+11 %")]
)
def test_shares_are_read_without_powers_of_ten(share: float, text: str) -> None:
    assert percent(share) == text


def test_the_press_s_closed_form() -> None:
    """Without lateral effect P = E/2 (1/a^2 - a); a tenth at nu 0.3 from an independent root of the same equations."""
    assert pressed(0.1, 0.0) == pytest.approx(0.5 * (1 / 0.9 - 0.9), rel=1e-12)
    assert pressed(0.1) == pytest.approx(0.108722, abs=1e-6)
    assert pressed(1e-6) == pytest.approx(1e-6, rel=1e-5)


def test_a_refused_scene_says_why_in_a_sentence() -> None:
    trace = follow(press(2e4, 0.01, "fem", fem={"integrator": "newmark"}), force_share(2e4))
    verdict = judge(trace, 1.0, 0.05, "force")
    assert verdict.kind == "refused" and "newmark cannot meet tools" in verdict.why and "\n" not in verdict.why


@pytest.mark.parametrize(
    "measure", [pitfalls.hourglass, pitfalls.constraint_order, pitfalls.closed_cycle], ids=lambda f: f.__name__
)
def test_controls_fail_and_remedies_hold(measure: object) -> None:
    assert callable(measure)
    control, remedy, holds, test = measure()
    assert holds, (control, remedy)
    assert test.endswith((".py", "modes", "derivatives")) or "::" in test


def made_up() -> Filled:
    """A map with one cell of each kind, the inaccurate one silent."""
    verdicts = {
        "accurate": Verdict("accurate", "off by little", 0.001),
        "recovered": Verdict("recovered", CUT, 0.01, (CUT,)),
        "inaccurate": Verdict("inaccurate", "off by much", 0.3),
        "unstable": Verdict("unstable", "torn", None, (), ("alarm",)),
        "refused": Verdict("refused", "cannot"),
    }

    def never() -> Verdict:
        raise AssertionError

    cells = tuple(Cell(0, i, 0, kind, never) for i, kind in enumerate(KINDS))
    panel = Panel("panel", "x", "y", KINDS, ("row",))
    of = Map("made-up", "Made up", "One of each. " * 30, (panel,), cells)
    return Filled(of, {of.key(cell): verdicts[kind] for cell, kind in zip(cells, KINDS, strict=True)})


def test_pictures_and_table_hold_every_cell(tmp_path: Path) -> None:
    filled = made_up()
    assert filled.count() == dict.fromkeys(KINDS, 1)
    assert [cell.label for cell, _ in filled.silent] == ["inaccurate"]
    assert [inside(filled.verdicts[filled.map.key(cell)]) for cell in filled.map.cells] == [
        "0.1",
        "1.0 R",
        "30",
        "U",
        "-",
    ]
    for path in (
        draw_map(tmp_path / "map.png", filled, "a machine"),
        draw_overview(tmp_path / "all.png", [filled], "m"),
    ):
        assert path.read_bytes()[:4] == b"\x89PNG"
    write_csv([filled], tmp_path / "atlas.csv")
    rows = list(csv.DictReader((tmp_path / "atlas.csv").open()))
    assert [row["kind"] for row in rows] == list(KINDS)
    assert [row["silent"] for row in rows] == ["false", "false", "true", "false", "false"]
    assert all(row["why"] for row in rows)


def test_an_unknown_map_is_refused_with_a_hint(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="did you mean 'poisson'"):
        atlas(Wishes(("poison",), tmp_path), Console(quiet=True))
