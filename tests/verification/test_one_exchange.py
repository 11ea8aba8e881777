"""FEM beside XPBD: one exchange a step in the common case, in free motion and in contact.

Asked for at a gap of 1 % of a cell: 1.3 exchanges a step at most (docs/decisions/03).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest

from softseam.variants import with_model, with_settings
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Configured,
    Fields,
    Observe,
    Released,
    Reply,
    Request,
    SnapshotTaken,
)
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import bundle_scene, load_scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

SCENES = Path(__file__).parents[2] / "scenes"
CELLS = {"cantilever": 0.025, "tofu_grasp": 0.0167, "stiff_inclusion": 0.0125}
"""shortest edges of their cells [m]"""


class Counting(EmbeddedTransport):
    """Counts rounds of messages in which somebody advanced."""

    n_rounds = 0
    seconds = 0.0

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        self.n_rounds += any(isinstance(request, Advance) for request in requests.values())
        began = perf_counter()
        try:
            return super().exchange(requests)
        finally:
            if not any(isinstance(request, Observe) for request in requests.values()):
                self.seconds += perf_counter() - began  # a look as a phase ends comes after the step that is told of


def run(name: str, *settings: str, frames: bool = False) -> list[StepReport]:
    """All steps of a scene that is cut from its start, also where one model would do."""
    loaded = load_scene(SCENES / f"{name}.yaml")
    scene = with_settings(with_model(loaded.scene, "hybrid"), settings)
    transport = Counting()
    simulation = Simulation(bundle_scene(scene, loaded.bundle.files), transport)
    reports = []
    while not simulation.done:
        transport.seconds = 0.0
        report = simulation.step(fields=frames)
        reports.append(report)
        # also where only one of the sides was asked: what the other would have done meanwhile is no work of the seam
        assert report.seconds["coupling"] <= report.seconds["total"] - transport.seconds + 1e-9
    simulation.close()
    assert sum(report.seam.exchanges for report in reports) == transport.n_rounds  # also of steps that were cut
    return reports


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "most_loose", "most_tight"),
    [("cantilever", 1.05, 1.15), ("tofu_grasp", 1.3, 2.1), ("stiff_inclusion", 1.3, 1.9)],
    ids=lambda value: value,
)
def test_one_exchange_in_most_steps(name: str, most_loose: float, most_tight: float) -> None:
    """A beam that falls, a cube that is squeezed, held and lifted.

    The gap that is left does not depend on the tolerance, nor does what the run ends with. In single steps of the stiff
    inclusion, as its far points begin to slide and as they leave the ground, there were 14 exchanges at 1 %, and 42 at
    3e-4. So where the cube's last far points leave the ground two steps in a row take 9 and 36 at 1 %; at 19 other
    tolerances no step takes more than 8. For the same reason one tolerance may lose 12 % less than all beside it, on
    one kind of processor; two beside it are asked then, and the middle of three counts.
    """
    loose, tight = (run(name, f"seam.tolerance={tolerance}") for tolerance in (1e-2, 3e-4))
    for reports, most in ((loose, most_loose), (tight, most_tight)):
        assert np.mean([report.seam.exchanges for report in reports]) < most
        cut = [report.seam.gap for report in reports if report.seam.n_nodes]
        assert np.median(cut) < 1e-5 * CELLS[name]
    assert sorted(report.seam.exchanges for report in loose)[-3] <= 8
    assert max(report.seam.exchanges for report in tight) <= 16
    for quantity in ("grip_force", "tip_deflection"):
        if quantity in tight[-1].quantities:
            ends = [abs(reports[-1].quantities[quantity]) for reports in (loose, tight)]
            assert abs(ends[0] - ends[1]) <= 2e-3 * ends[1]
    lost = loss(loose)
    if abs(lost - loss(tight)) >= 0.1 * loss(tight):
        beside = [loss(run(name, f"seam.tolerance={tolerance}")) for tolerance in (9e-3, 1.1e-2)]
        lost = float(np.median([lost, *beside]))
    assert abs(lost - loss(tight)) < 0.1 * loss(tight)


@pytest.mark.slow
def test_exchanges_where_both_models_slide_on_one_tool() -> None:
    """tofu_slab lands, is pinched, and lies: counts, so that what a step costs does not grow unseen.

    Its seam runs over the table. As it lands both parts slide to and fro there, and each exchange finds other points
    that stick (docs/decisions/19). Counts there go by the last digit of anything: 2.7 to 3.8 exchanges a step in six
    runs whose gravity differs by up to 1 %, one step in parts at most.
    """
    exchanges = [report.seam.exchanges for report in run("tofu_slab", "duration=0.6")]
    assert np.mean(exchanges) < 4.5
    assert np.mean(exchanges[40:]) < 1.5
    assert sum(count > 16 for count in exchanges) <= 2


def loss(reports: list[StepReport]) -> float:
    """Of all steps [J]."""
    return sum(report.energy["dissipation"] for report in reports)


def test_all_that_participants_do_counts_as_theirs() -> None:
    """Steps, corrections with a frame, and what is looked at by a request of its own."""

    class Adding(EmbeddedTransport):
        def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
            replies = super().exchange(requests)
            for name, reply in replies.items():
                seconds = getattr(reply, "seconds", 0.0)
                assert seconds > 0.0 or isinstance(reply, Released)
                worked[name] = worked.get(name, 0.0) + seconds
                kinds.add(type(reply))
            return replies

    worked: dict[str, float] = {}
    kinds: set[type] = set()
    loaded = load_scene(SCENES / "cantilever.yaml")
    scene = with_model(loaded.scene, "hybrid")
    simulation = Simulation(bundle_scene(scene, loaded.bundle.files), Adding())
    for step in range(12):
        worked.clear()
        seconds = simulation.step(fields=step % 2 == 0).seconds
        assert seconds["fem"] == pytest.approx(worked["body.near"])
        assert seconds["pbd"] == pytest.approx(worked["body.far"])
    simulation.estimate()
    simulation.save()
    assert kinds == {Configured, Advanced, Fields, SnapshotTaken}
    simulation.close()


def test_looking_changes_nothing() -> None:
    """A frame of every step has each step settled by a message of its own; without frames the next step's does it."""
    settings = ("duration=0.1",)
    seen, unseen = run("cantilever", *settings, frames=True), run("cantilever", *settings)
    for one, other in zip(seen, unseen, strict=True):
        assert one.seam == other.seam
        assert one.energy == other.energy
        assert other.quantities.items() <= one.quantities.items()
