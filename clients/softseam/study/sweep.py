"""Runs one configuration after another, cheapest first; each is kept as soon as it is done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from softseam.study.configurations import Configuration
from softseam.study.frame import Frame
from softseam.study.measure import RUNS, Outcome, Told, measure
from softseam.study.store import Store

SLACK = 3.0
"""a run may take this many times what it was foreseen to, where the budget has it [1]"""
LONGEST = 0.25
"""share of the budget that a single run may take [1]"""

Watch = Callable[[Configuration, float], Told]
"""told which configuration runs now and its foreseen seconds; returns what is told of its progress"""


def finished(store: Store, wanted: Sequence[Configuration]) -> dict[str, Outcome]:
    """Outcomes kept by an earlier sweep, by key. Raises BadInput, naming a corrupt or foreign file."""
    found = {}
    for configuration in wanted:
        data = store.read(configuration.key)
        if data is None:
            continue
        try:
            found[configuration.key] = Outcome.from_json(data)
        except (KeyError, TypeError, ValueError) as error:
            raise store.refused(configuration.key, f"is corrupt ({error})") from None
    return found


def sweep(
    scene: str | Path,
    settings: Sequence[str],
    frame: Frame,
    names: tuple[str, ...],
    wanted: Sequence[Configuration],
    store: Store,
    budget: float,
    watch: Watch,
    runs: int = RUNS,
) -> dict[str, Outcome]:
    """Outcome of every configuration, by key; what is not run for its cost is an outcome with that reason.

    budget  own time of the runs, without compiling [s]; what was kept before costs nothing
    runs    timed runs of a configuration
    """
    outcomes = finished(store, wanted)
    pace: dict[str, float] = {}
    spent = 0.0
    for configuration in wanted:
        if configuration.key in outcomes:
            learn(pace, configuration, outcomes[configuration.key])
            continue
        once = configuration.seconds * pace.get(configuration.method, 1.0)
        left = budget - spent
        if once > min(left, LONGEST * budget):
            outcomes[configuration.key] = Outcome(
                "left out", f"a run would take some {once:.2g} s: give more --minutes"
            )
            continue
        told = watch(configuration, (1 + runs) * once)
        limit = min(left, max(SLACK * once, LONGEST * budget))
        asked = (*settings, *configuration.settings)
        outcome = measure(scene, asked, names, runs=runs, limit=limit, length=frame.length, told=told, look=1)
        outcomes[configuration.key] = outcome
        if outcome.status != "stopped":
            store.write(configuration.key, outcome.as_json())
        spent += outcome.spent
        learn(pace, configuration, outcome)
    return outcomes


def learn(pace: dict[str, float], configuration: Configuration, outcome: Outcome) -> None:
    """Note how this machine's time compares with the rough estimate, by method; updated in place."""
    if outcome.status == "done" and outcome.walls:
        found = outcome.seconds / configuration.seconds
        pace[configuration.method] = 0.5 * (pace.get(configuration.method, found) + found)
