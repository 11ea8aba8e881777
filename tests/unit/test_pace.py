"""How finely steps are cut: finer where they fail, coarser again where that settles, with growing patience."""

from __future__ import annotations

from softseam_services.orchestrator.subdivided_step import FINEST, Subdivision


def run(pace: Subdivision, needed: list[int]) -> tuple[list[int], int]:
    """Parts that each step ends with, where it settles in `needed` parts or more; and how often one failed."""
    parts, failed = [], 0
    for least in needed:
        pace.begin()
        while pace.parts < min(least, FINEST):
            pace.cut()
            failed += 1
        pace.end()
        parts.append(pace.parts)
    return parts, failed


def test_one_bad_step_costs_only_itself() -> None:
    assert run(Subdivision(), [1, 1, 4, 1, 1]) == ([1, 1, 4, 1, 1], 1)


def test_a_run_of_bad_steps_soon_stays_cut() -> None:
    parts, failed = run(Subdivision(), [16] * 200)
    assert parts == [16] * 200
    assert failed < 12  # three to get there, then a coarser one every 1, 3, 7 ... 64 steps


def test_it_comes_back_to_whole_steps() -> None:
    pace = Subdivision()
    run(pace, [32] * 10)
    parts, failed = run(pace, [1] * 20)
    assert failed == 0
    assert parts[-1] == 1


def test_nothing_is_cut_finer_than_the_finest() -> None:
    assert run(Subdivision(), [10**9])[0] == [FINEST]


def test_it_goes_on_from_a_snapshot() -> None:
    needed = [8, 1, 8, 8, 2, 1, 8, 8, 8, 1]
    whole, again = Subdivision(), Subdivision()
    run(whole, needed[:5])
    again.take(whole.to_list())
    assert run(again, needed[5:]) == run(whole, needed[5:])
