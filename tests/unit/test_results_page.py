"""docs/results/results.md quotes what the other pages say, as they say it."""

from __future__ import annotations

import pytest
from benchmarks import quoted
from benchmarks.results import ROOT

PAGE = (ROOT / "docs" / "results" / "results.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("page", "section", "begins"),
    [
        ("chart.md", "tofu_grasp", "What was asked for"),
        ("chart.md", "tofu_grasp", "Other simulators"),
        ("chart.md", "cantilever", "Other simulators"),
        ("chart.md", "tofu_pads", "Local stress"),
        ("chart.md", "tofu_slab", "Local stress"),
        ("plans.md", "", "| tolerance | plans"),
        ("atlas.md", "", "| map"),
        ("atlas.md", "A hundred thousand steps", "|"),
    ],
)
def test_a_table_is_on_both_pages(page: str, section: str, begins: str) -> None:
    """A page that was made anew without the other is found here: `make results` makes both."""
    assert quoted.table(page, section, begins) in PAGE


def test_a_table_that_is_not_there_is_missed() -> None:
    with pytest.raises(SystemExit, match="make that page first"):
        quoted.table("chart.md", "tofu_pads", "Other simulators")
    with pytest.raises(SystemExit, match="no table in 'nothing'"):
        quoted.table("chart.md", "nothing")


def test_the_machine_is_named() -> None:
    assert "cores" in quoted.machine_of("results.md") and "cores" in quoted.machine_of("plans.md")
