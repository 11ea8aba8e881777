"""Runs one configuration after another, cheapest first, or several at a time; each is stored as soon as it is done."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack

from softseam.scenes import bundle_of, bundle_with
from softseam_protocol.messages.participant import Bundle
from softseam_studies.study.configurations import Configuration
from softseam_studies.study.measure import RUNS, Outcome, Told
from softseam_studies.study.store import Store
from softseam_studies.study.study import Study
from softseam_studies.study.workers import Here, Measuring, OnCluster, Processes, Runners

SLACK = 3.0
"""a run may take this many times what it was foreseen to, where the budget has it [1]"""
LONGEST = 0.25
"""share of the budget that a single run may take [1]"""

Watch = Callable[[Configuration, float], Told]
"""receives which configuration runs now and its foreseen seconds; returns what hears of its progress"""


def finished(store: Store, wanted: Sequence[Configuration]) -> dict[str, Outcome]:
    """Outcomes stored by an earlier sweep, by key. Raises BadInput, naming a corrupt or foreign file."""
    found = {one.key: store.outcome(one.key) for one in wanted}
    return {key: outcome for key, outcome in found.items() if outcome is not None}


def sweep(
    study: Study,
    wanted: Sequence[Configuration],
    store: Store,
    budget: float,
    watch: Watch,
    runs: int = RUNS,
    jobs: int = 1,
    ray: str | None = None,
    lost: Callable[[str], None] = print,
) -> dict[str, Outcome]:
    """Outcome of every configuration, by key; what is not run for its cost is an outcome with that reason.

    budget  wall time of the runs, without compiling [s]; what was stored before costs nothing
    runs    timed runs of a configuration
    jobs    processes that run configurations side by side
    ray     address of a Ray cluster that runs them in place of this machine, see `Workers`
    lost    hears of each of its workers that is lost
    """
    outcomes, pace, spent = finished(store, wanted), dict[str, float](), 0.0
    for one in wanted:
        if one.key in outcomes:
            learn(pace, one, outcomes[one.key])

    def done(one: Configuration, outcome: Outcome) -> None:
        nonlocal spent
        outcomes[one.key] = outcome
        if outcome.status != "stopped":
            store.write(one.key, outcome.as_json())
        spent += outcome.spent
        learn(pace, one, outcome)

    with ExitStack() as stack:
        there = study.name if ray is None else _whole(study)
        runners = _runners(Measuring(there, study.names(), runs, study.frame.length), jobs, ray, lost, stack)
        budget *= runners.size
        for one in wanted:
            if one.key in outcomes:
                continue
            for earlier, outcome in runners.ended(runners.size - 1):
                done(earlier, outcome)
            once, left = one.seconds * pace.get(one.method, 1.0), budget - spent
            if once > min(left, LONGEST * budget):
                outcomes[one.key] = Outcome("left out", f"a run would take some {once:.2g} s: give more --minutes")
                continue
            report = watch(one, (1 + runs) * once)
            limit = min(left, max(SLACK * once, LONGEST * budget))
            runners.begin(one, ((*study.settings, *one.settings), limit), report)
        for one, outcome in runners.ended(0):
            done(one, outcome)
    return outcomes


def _runners(
    measuring: Measuring, jobs: int, ray: str | None, lost: Callable[[str], None], stack: ExitStack
) -> Runners:
    if ray is not None:
        return OnCluster(measuring, ray, lost, stack)
    return Processes(measuring, jobs, stack) if jobs > 1 else Here(measuring)


def learn(pace: dict[str, float], configuration: Configuration, outcome: Outcome) -> None:
    """Note how this machine's time compares with the rough estimate, by method; updated in place."""
    if outcome.status == "done" and outcome.walls:
        found = outcome.seconds / configuration.seconds
        pace[configuration.method] = 0.5 * (pace.get(configuration.method, found) + found)


def _whole(study: Study) -> Bundle:
    """The scene as it is given, with its files and those that settings name: what another machine needs."""
    bundle = bundle_of(study.name)[1]
    return Bundle(bundle.scene, bundle.files | bundle_with(study.scene, bundle, study.name, study.settings).files)
