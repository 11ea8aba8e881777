"""Counts of the house do not rise, and each fits what it counts."""

from __future__ import annotations

import house
import pytest


@pytest.fixture(scope="module")
def product() -> house.Sources:
    return house.product()


@pytest.mark.parametrize("row", house.COUNTS, ids=lambda row: row.name)
def test_a_count_is_within_its_budget(row: house.Count, product: house.Sources) -> None:
    """A count that falls lowers its budget: one that is a tenth above its count was forgotten."""
    now = row.count(product)
    assert now <= row.budget, "it rose: lower it again, in tests/house.py is what it counts"
    assert row.budget <= max(1.1 * now, now + 3), "it fell: lower its budget in tests/house.py"


def test_counts_see_what_they_count() -> None:
    """A file in which each is once."""
    text = (
        "import os\n"
        "from softseam_services.fem.solver import FemSolver\n"
        "BOUND = 0.5\n"
        'PAIR = (1.5, "fem")\n'
        "def told(scene, sides):\n"
        "    seam_rows: int\n"
        "    return sides.near, scene.body, isinstance(scene.one, BodySpec)\n"
        "    seam_nodes: int\n"
    )
    path = "services/softseam_services/orchestrator/messages/one.py"
    counted = {row.name: row.count({path: text}) for row in house.COUNTS}
    assert counted["lines of the product"] == 8
    assert counted["lines that name a model"] == counted["places that take .near or .far"] == 1
    assert counted["lines that ask for a kind of body"] == counted["lines that take the only body"] == 1
    assert counted["fields of messages that are called seam"] == 2
    assert counted["imports of solvers in the orchestrator"] == 1
    assert counted["tuned constants"] == 2
    assert counted["lines with tell or told"] == 1
    assert counted["imports in percent of lines"] == 25.0
