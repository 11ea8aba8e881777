"""The page of charts, docs/results/chart.md: what its tables and sentences say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks import chart as document

from softseam.scenes import load_scene
from softseam_studies.study.classic import classic_configurations
from softseam_studies.study.configurations import METHODS, Configuration, configurations
from softseam_studies.study.errors import Error, Truth
from softseam_studies.study.frame import Frame
from softseam_studies.study.landmarks import Landmark
from softseam_studies.study.measure import Outcome
from softseam_studies.study.reference import Part, Reference
from softseam_studies.study.series import Series
from softseam_studies.study.table import Row

KNOWN = Reference(
    np.array([0.1, 0.2]),
    {name: Truth(np.ones(2), 1.0, 0.01) for name in ("sag", "upper.von_mises")},
    {name: Part(0.005, 0.005, 1.0, 1.0, 0.01) for name in ("sag", "upper.von_mises")},
    (),
    "bdf2",
    True,
)


def charted(scene: str, **errors: float) -> document.Charted:
    """A chart of one configuration with these errors [1]."""
    names = {name: Error(value, False, value) for name, value in {"sag": 0.1, "upper.von_mises": 0.2, **errors}.items()}
    outcome = Outcome("done", walls=(0.01,), simulated=1.0)
    row = Row(Configuration("a", "XPBD", "one", (), 1.0), outcome, names, names["sag"], True)
    return document.Charted(scene, [row], KNOWN, [Landmark("rival", 0.5, 0.3, "somebody; worst is sag of sag")])


def test_what_is_next_to_nothing_is_told_as_0() -> None:
    assert document.percent(Error(2.9e-12, True, 0.0)) == "0" == document.percent(Error(9.9e-6, False, 0.0))
    assert (
        document.percent(Error(1.1e-5, False, 0.0)) == "0.0011" and document.percent(Error(0.02, True, 0.0)) == "<= 2"
    )
    assert document.percent(Error(4.97, False, 0.0)) == "497" and document.percent(Error(0.99, False, 0.0)) == "99"
    assert "| one | 100 | 0 | 0 |" in document.section(charted("cantilever", sag=3e-12))


def test_a_scene_s_probes_are_told_where_they_are() -> None:
    """Those of tofu_slab are 4 mm from the inner edges of fingertips; only tofu_pads has one under a pad."""
    assert "under" not in document.section(charted("tofu_slab")).partition("Local stress")[2].partition("|")[0]
    assert "5 mm under its middle" in document.section(charted("tofu_pads"))
    for scene in ("tofu_slab", "tofu_pads"):
        assert load_scene(scene).probes and scene in document.PROBES


def test_the_table_of_rivals_says_what_its_columns_are() -> None:
    text = document.section(charted("cantilever"))
    head = next(line for line in text.splitlines() if line.startswith("| simulator"))
    assert head.endswith("| measured with; worst of |")
    assert head.count("|") == next(line for line in text.splitlines() if line.startswith("| rival")).count("|")


def test_classic_pbd_s_force_stands_beside_the_reference_s() -> None:
    """A row for each run of it that was done; a chart without grip_force, or without such runs, has no such table."""
    series = Series(np.array([0.1, 0.2]), np.zeros(2), {"grip_force": np.array([1.0, 3.5])})
    outcome = Outcome("done", walls=(0.01,), simulated=1.0, series=series)
    error = Error(0.4, False, 0.4)
    rows = [
        Row(Configuration("b", "PBD", "PBD 2x2x2", (), 1.0), outcome, {"grip_force": error}, error),
        Row(Configuration("c", "PBD", "PBD 4x4x4", (), 1.0), Outcome("failed", "why"), {}, None),
    ]
    truth = {"grip_force": Truth(np.array([1.0, 8.5]), 1.0, 0.01)}
    text = document.section(document.Charted("cantilever", rows, replace(KNOWN, truth=truth), []))
    assert "| the reference | | | 8.5 |\n| PBD 2x2x2 | 100 | 40 | 3.5 |\n" in text and "PBD 4x4x4" not in text
    assert "Classic PBD" not in document.section(
        document.Charted("cantilever", rows, replace(KNOWN, truth={"sag": KNOWN.truth["sag"]}), [])
    )
    assert (Path(document.ROOT) / "docs" / "results" / document.CHOSEN).is_file()


def test_missing_rivals_are_warned_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(document, "RIVALS_FILE", tmp_path / "rivals.json")
    assert document.rivals_file() is None and "tests/benchmarks/rivals.py" in capsys.readouterr().err
    (tmp_path / "rivals.json").write_text("{}")
    assert document.rivals_file() == tmp_path / "rivals.json" and not capsys.readouterr().err


def test_every_word_in_a_configuration_s_name_is_explained() -> None:
    """Whatever a sweep of these scenes tries; numbers differ."""
    key = document.PAGE.partition("| in a name |")[2].partition("{sections}")[0]
    words: set[str] = set()
    for name, extent in (("tofu_grasp", 0.05), ("cantilever", 0.05), ("tofu_pads", 0.05), ("stiff_inclusion", 0.05)):
        frame = Frame(load_scene(name), np.full(3, extent))
        for one in (*configurations(frame), *classic_configurations(frame)):
            words |= {word.strip(",") for word in one.label.split() if word[0].isalpha()}
            assert one.method in METHODS
    elements = {word for word in words if word.startswith(("hex", "tet"))}
    assert not {word for word in words - elements if word not in key}
    listed = (Path(document.ROOT) / "docs" / "reference" / "elements.md").read_text()
    assert not {element for element in elements if f"`{element}`" not in listed}
