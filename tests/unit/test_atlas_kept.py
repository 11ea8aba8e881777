"""What `softseam atlas` keeps: tables of all maps of the same code, and only what was asked for is forgotten."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from benchmarks import atlas as template
from rich.console import Console

from softseam.errors import BadInput
from softseam_studies.atlas import atlas as registry
from softseam_studies.atlas import command, long_run, pitfalls
from softseam_studies.atlas.command import Found, atlas
from softseam_studies.atlas.draw import MARKS, inside
from softseam_studies.atlas.grid import Cell, Map, Panel
from softseam_studies.atlas.trace import Trace
from softseam_studies.atlas.verdicts import Verdict, judge
from softseam_studies.cli_studies import Atlas as Wishes

NAMES = ("step", "squeeze")
Tables = Callable[..., tuple[dict[str, Any], list[dict[str, str]]]]


def quick(name: str, runs: list[str]) -> Map:
    """A map of two runs that simulate nothing, and say in `runs` that they ran."""

    def run() -> Verdict:
        runs.append(name)
        return Verdict("accurate", "made up", 0.01)

    cells = (Cell(0, 0, 0, "first", run), Cell(0, 1, 0, "second", run))
    return Map(name, name.title(), "Made up.", (Panel("panel", "x", "y", ("1", "2"), ("row",)),), cells)


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The registry holds two quick maps and a quick pitfall; what has run, in its order."""
    ran: list[str] = []

    def measured() -> tuple[str, str, bool, str]:
        ran.append("pitfalls")
        return "fails", "holds", True, "test.py"

    maps = {name: partial(quick, name, ran) for name in NAMES}
    monkeypatch.setattr(command, "MAPS", maps)
    monkeypatch.setattr(pitfalls, "PITFALLS", {"Locking": measured})
    return ran


@pytest.fixture
def tables(tmp_path: Path, runs: list[str]) -> Tables:
    """Asks for maps, and reads atlas.json and atlas.csv."""

    def ask(*names: str, fresh: bool = False) -> tuple[dict[str, Any], list[dict[str, str]]]:
        runs.clear()
        atlas(Wishes(names, tmp_path, fresh=fresh), Console(quiet=True))
        return json.loads((tmp_path / "atlas.json").read_text()), list(csv.DictReader((tmp_path / "atlas.csv").open()))

    return ask


@pytest.mark.kernels
def test_one_map_leaves_the_others_in_the_tables(tables: Tables, runs: list[str], tmp_path: Path) -> None:
    whole = tables()
    assert runs == ["step", "step", "squeeze", "squeeze", "pitfalls"]
    (tmp_path / "overview.png").unlink()
    assert tables("step") == whole and runs == []
    assert (tmp_path / "overview.png").exists(), "the overview is of what the tables hold"
    assert [row["map"] for row in whole[1]] == ["step", "step", "squeeze", "squeeze"]


@pytest.mark.kernels
def test_what_was_not_computed_is_marked(tables: Tables, runs: list[str]) -> None:
    document, rows = tables("pitfalls")
    assert runs == ["pitfalls"] and len(document["pitfalls"]) == 1
    assert [(row["map"], row["kind"]) for row in rows] == [(name, "not computed") for name in NAMES]
    document, rows = tables("squeeze")
    assert [(one["name"], one["computed"]) for one in document["maps"]] == [("step", False), ("squeeze", True)]
    assert [row["kind"] for row in rows] == ["not computed", "accurate", "accurate"]
    assert len(document["pitfalls"]) == 1, "kept from before"


@pytest.mark.kernels
def test_maps_of_other_code_are_not_mixed_in(tables: Tables, monkeypatch: pytest.MonkeyPatch) -> None:
    tables()
    monkeypatch.setattr(registry, "solver_digest", lambda: "other code")
    document, _ = tables("step", fresh=True)
    assert [(one["name"], one["computed"]) for one in document["maps"]] == [("step", True), ("squeeze", False)]
    assert document["pitfalls"] == []


@pytest.mark.kernels
def test_only_what_is_asked_for_is_run_anew(tables: Tables, runs: list[str], tmp_path: Path) -> None:
    tables()
    held = tmp_path / "runs" / "long-fem-100000.json"
    held.write_text("{}")
    tables("step", fresh=True)
    assert runs == ["step", "step"]
    tables("pitfalls", fresh=True)
    assert runs == ["pitfalls"]
    tables(fresh=True)
    assert len(runs) == 5 and held.exists(), "the long run is no map"


@pytest.mark.kernels
def test_a_fresh_long_run_keeps_the_maps(
    tables: Tables, runs: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables()
    held = tmp_path / "runs" / "long-fem-100000.json"
    held.write_text("{}")
    monkeypatch.setattr(long_run, "long_run", lambda *_: [])
    atlas(Wishes((), tmp_path, long=True, fresh=True), Console(quiet=True))
    assert not held.exists()
    tables()
    assert runs == []


def test_maps_beside_the_long_run_are_refused(runs: list[str], tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"--long .* leave out step, or --long"):
        atlas(Wishes(("step",), tmp_path, long=True), Console(quiet=True))
    assert runs == []


@pytest.mark.kernels
def test_a_kept_run_of_another_atlas_is_called_so(tables: Tables, monkeypatch: pytest.MonkeyPatch) -> None:
    tables()
    monkeypatch.setattr(registry, "_own_digest", lambda: "other sources")
    with pytest.raises(BadInput, match=r"step-0-0-0\.json belongs to another version of the atlas: .*--fresh"):
        tables("step")


def marks() -> set[str]:
    """What stands in a cell of every kind, with errors of every size or none; 0.3 for any number."""
    verdicts = [Verdict("refused", "cannot"), Verdict("inaccurate", "other bits"), Verdict("unstable", "torn", 2.0)]
    verdicts += [judge(Trace(value=1.0 + error), 1.0, 0.05, "force") for error in (0.0, 3e-3, 0.3, 50.0)]
    verdicts += [Verdict("recovered", "saved", error, ("guard",)) for error in (0.0, 3e-3)]
    return {re.sub(r"^\d[\d.]*\d|^[1-9]", "0.3", inside(verdict)) for verdict in verdicts}


@pytest.mark.kernels
def test_page_and_legend_explain_every_mark(tmp_path: Path) -> None:
    assert marks() == set(MARKS)
    page = template.page(Found((registry.Filled(quick("step", []), {}),), ()), tmp_path / "long.json")
    for mark, meaning in MARKS.items():
        assert f"- {template.marked(mark)}: {meaning}" in page
    assert re.search(r"Machine: .*; solvers' digest [0-9a-f]{8}\.$", page, re.MULTILINE)
