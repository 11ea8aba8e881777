"""The gap at which two tools press with a force that is wanted, from forces that steps come to."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from softseam_services.orchestrator.force_search import MOST, NEAR_ENOUGH, ForceSearch

WANTED, TOUCH = 4.0, 10e-3


def _searched(law: Callable[[float, float], float], step: float) -> tuple[list[float], ForceSearch]:
    """Forces from the first that is nearly the one that is wanted, and the search as it ended.

    law   force of the gaps after a step and before it [m]
    step  the way of a step at full speed [m]
    """
    gap, forces = TOUCH + 0.5 * step, list[float]()
    search = ForceSearch(gap)
    while True:
        way = 0.0 if search.stands else gap - search.to(WANTED)
        before, gap = gap, gap - min(step, max(-step, way))
        force = law(gap, before)
        forces = [*forces, force] if forces or search.after(gap, force, WANTED).passed else forces
        if search.ended(force, WANTED):
            return forces, search
        search = search.after(gap, force, WANTED)
        assert len(forces) < 100


def _spring(power: float) -> Callable[[float], float]:
    return lambda gap: WANTED * (max(0.0, TOUCH - gap) / 2.2e-3) ** power


@pytest.mark.parametrize("power", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("step", [0.3e-3, 3e-3, 9e-3])
def test_a_force_is_found_whatever_a_step_passes_it_by(power: float, step: float) -> None:
    forces, search = _searched(lambda gap, before: _spring(power)(gap), step)
    assert forces[-1] == pytest.approx(WANTED, rel=NEAR_ENOUGH)
    assert search.tries < MOST


@pytest.mark.parametrize("step", [0.3e-3, 1e-3])
def test_tools_that_touch_do_not_press_by_far_more_than_is_wanted(step: float) -> None:
    forces, _ = _searched(lambda gap, before: _spring(1.5)(gap), step)
    assert max(forces) < 1.2 * WANTED < _spring(1.5)(TOUCH - 2.2e-3 - 0.5e-3)


@pytest.mark.parametrize("step", [0.3e-3, 3e-3])
def test_a_force_that_is_a_mean_over_the_step_is_found(step: float) -> None:
    """As PBD tells it: half a step behind where tools move."""
    spring = _spring(1.5)
    forces, search = _searched(lambda gap, before: 0.5 * (spring(gap) + spring(before)), step)
    assert forces[-1] == pytest.approx(WANTED, rel=NEAR_ENOUGH)
    assert search.tries < MOST


def test_a_force_that_jumps_is_not_looked_for_without_end() -> None:
    _, search = _searched(lambda gap, before: 9.0 if gap < 8e-3 else 1.0, 3e-3)
    assert search.tries == MOST


def test_a_force_that_is_near_enough_is_looked_at_once_more_and_ends_it() -> None:
    forces, _ = _searched(lambda gap, before: 1.01 * WANTED if gap < TOUCH else 0.0, 1e-3)
    assert len(forces) == 2


def test_what_is_saved_goes_on() -> None:
    search = ForceSearch(9e-3, 1.0).after(7e-3, 6.0, WANTED)
    assert search.passed and ForceSearch.from_list(search.to_list()) == search
    assert not ForceSearch.from_list([]).passed
