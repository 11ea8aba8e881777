"""`softseam plan`: what it shows of what was tried, whether a kept plan will do, and how fast a plan has to be."""

from __future__ import annotations

import io
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
from rich.console import Console

import softseam
from softseam_studies.study import plan_command as command
from softseam_studies.study.measure import Status
from softseam_studies.study.plan import Goal, Plan, Tried
from softseam_studies.study.plan_command import Wishes, find, listed, show
from softseam_studies.study.plan_watch import PlanWatch

WISHES = Wishes("tofu_grasp", tolerance=0.05)


def tried(label: str, rtf: float, error: float) -> Tried:
    return Tried(label=label, settings=(f"name={label}",), rtf=rtf, error=error, differs=error, decided_by="grip_force")


def ended(label: str, status: Status) -> Tried:
    return Tried(label=label, settings=(f"name={label}",), decided_by=f"{status}: why", status=status)


CHOICE = tried("accurate", 10.0, 0.03)
FASTER = tuple(tried(f"wrong {i}", 100.0 - i, 0.5) for i in range(30))
SLOWER = tuple(tried(f"slow {i}", 5.0 - 0.1 * i, 0.01) for i in range(8))
LATE, STOPPED = ended("late", "left out"), ended("begun", "stopped")
REFUSED, FAILED = ended("refused", "refused"), ended("failed", "failed")


def plan(*others: Tried, choice: Tried = CHOICE) -> Plan:
    return Plan(goal=Goal(tolerance=0.05), choice=choice, tried=(*others, choice), truth="ships with it", minutes=5.0)


def shown(found: Plan) -> list[str]:
    console = Console(file=io.StringIO(), width=200)
    show(found, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def test_the_choice_is_shown_however_many_faster_ones_are_not_accurate() -> None:
    lines = shown(plan(*FASTER, *SLOWER))
    (mark,) = (i for i, line in enumerate(lines) if line.startswith("  > accurate"))
    assert "wrong 29" in lines[mark - 1] and "slow 0" in lines[mark + 1]
    assert "wrong 0" in lines[1] and lines[6].split() == ["…", "22", "more"]
    assert lines[mark + 4].split() == ["…", "5", "more"] and len(lines) < 20


def test_every_one_is_shown_or_counted() -> None:
    for numbers in product(range(31), (0, 2, 8)):
        found = plan(*FASTER[: numbers[0]], *SLOWER[: numbers[1]])
        rows = listed(found)
        fastest = [row for row in rows if isinstance(row, Tried)]
        assert CHOICE in rows and len(fastest) <= command.SHOWN, numbers
        assert sum(row if isinstance(row, int) else 1 for row in rows) == len(found.tried) and 0 not in rows, numbers
        assert fastest == sorted(fastest, key=lambda one: -one.rtf), numbers
        if len(found.tried) <= command.SHOWN:
            assert fastest == rows, numbers


def test_what_was_not_run_is_not_counted_as_run_and_what_lacked_time_is_told() -> None:
    text = "\n".join(shown(plan(*FASTER[:3], FAILED, REFUSED, LATE, STOPPED)))
    assert "accurate is accurate to 5 % and the fastest of 5 run that is" in text
    assert "2 had no time: more --minutes may find a faster one" in text
    assert "--minutes" not in "\n".join(shown(plan(*FASTER[:3], FAILED, REFUSED)))


def test_a_choice_that_is_not_sure_says_so() -> None:
    unsure = tried("unsure", 20.0, 0.056).model_copy(update={"differs": 0.043, "decided_by": "sag"})
    found = plan(*SLOWER, choice=unsure)
    assert not found.is_sure and found.off == 0.043 and plan().is_sure and plan().off == CHOICE.error
    text = "\n".join(shown(found))
    assert (
        "unsure is 4.3 % off the reference, within 5 %, and the fastest of 9 run that is. The reference ships" in text
    )
    assert "it may be 5.6 % off (sag); slow 0 surely is, and takes 4 times as long" in text
    assert "nothing that was tried surely is" in "\n".join(shown(plan(*FASTER, choice=unsure)))


@pytest.mark.kernels
@pytest.mark.usefixtures("cache")
def test_a_plan_that_is_there_will_do_where_nobody_says_how_long_to_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """What `softseam plan --minutes 0.5` stored, `softseam.open` and `softseam run` take, though it lacked time."""
    searches = Searches(plan(LATE))
    monkeypatch.setattr(command, "search", searches)
    planned(replace(WISHES, minutes=0.5))
    assert planned(WISHES).minutes == 0.5 and len(searches.goals) == 1
    planned(replace(WISHES, minutes=5.0))
    assert len(searches.goals) == 2


@pytest.mark.kernels
@pytest.mark.usefixtures("cache")
def test_a_program_is_told_once_that_it_waits_for_a_plan(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """On standard error, where no terminal shows progress; not where the plan is there."""
    monkeypatch.setattr(command, "search", Searches(plan()))
    monkeypatch.setattr(PlanWatch, "begin", lambda self: self)
    for _ in range(2):
        softseam.open("tofu_grasp", settings=["tolerance=0.05"])
    told = capfd.readouterr()
    assert told.out == "" and told.err.count("\n") == 1
    for words in ("softseam: planning tofu_grasp for 5 %", "may take 1 min", "softseam plan"):
        assert words in told.err


class Searches:
    """Stands for the search, and counts how often it is asked."""

    def __init__(self, found: Plan) -> None:
        self.found, self.goals = found, list[Goal]()

    def __call__(
        self, study: object, goal: Goal, names: object, store: object, minutes: float, *rest: object, **how: object
    ) -> Plan:
        self.goals.append(goal)
        return self.found.model_copy(update={"minutes": minutes})


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def planned(wishes: Wishes) -> Plan:
    return find(wishes, Console(quiet=True))


@pytest.mark.kernels
@pytest.mark.usefixtures("cache")
@pytest.mark.parametrize(("found", "again"), [(plan(LATE), True), (plan(FAILED), False)])
def test_a_plan_that_lacked_time_is_searched_again_where_there_is_more(
    found: Plan, again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    searches = Searches(found)
    monkeypatch.setattr(command, "search", searches)
    for minutes, count in ((5.0, 1), (5.0, 1), (3.0, 1), (60.0, 1 + again), (60.0, 1 + again), (5.0, 1 + again)):
        kept = planned(replace(WISHES, minutes=minutes))
        assert len(searches.goals) == count, f"with {minutes} min"
        assert kept.tried == found.tried and kept.n_late == found.n_late
    assert kept.minutes == (60.0 if again else 5.0)


@pytest.mark.kernels
@pytest.mark.usefixtures("cache")
@pytest.mark.parametrize(
    ("asked", "rtf"),
    [({}, 7.0), ({"tolerance": 0.05}, 7.0), ({"tolerance": 0.05, "rtf": 3.0}, 3.0), ({"rtf": 0.0}, 0.0)],
)
def test_the_scenes_budget_holds_unless_a_speed_is_asked_for(
    asked: dict[str, float], rtf: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    searches = Searches(plan())
    monkeypatch.setattr(command, "search", searches)
    wishes = Wishes("tofu_grasp", ("tolerance=0.2", "budget={rtf: 7}"), asked.get("tolerance"), asked.get("rtf"))
    planned(wishes)
    assert [goal.rtf for goal in searches.goals] == [rtf]


@pytest.mark.kernels
def test_a_plan_that_cannot_be_kept_is_found_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "taken").write_text("a file")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "taken"))
    monkeypatch.setattr(command, "search", Searches(plan()))
    console = Console(file=io.StringIO(), width=400)
    assert find(WISHES, console).choice == CHOICE
    assert isinstance(console.file, io.StringIO)
    assert "the plan is not stored: cannot write" in console.file.getvalue()
    assert "set XDG_CACHE_HOME to a folder that can be written to" in console.file.getvalue()
