"""What a run says at its end of how far it can be trusted: true, asked by nobody, and free for who steps by hand."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from pbd_run import PbdRun
from rich.console import Console

from softseam.closing import print_closing
from softseam.embedded import EmbeddedBackend
from softseam.report import ReportBuilder
from softseam.session import open_as_given
from softseam_protocol.messages.participant import Observe, Reply, Request
from softseam_protocol.messages.session import ErrorEstimate
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator import error_estimate
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_studies.atlas.atlas import MAPS
from softseam_studies.atlas.runs import settled, still
from softseam_studies.atlas.scenes import press


class Watched(EmbeddedTransport):
    """Counts looks at the fields."""

    looks = 0

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        self.looks += any(isinstance(request, Observe) for request in requests.values())
        return super().exchange(requests)


def simulation(scene: Mapping[str, Any] | Scene, transport: EmbeddedTransport | None = None) -> Simulation:
    parsed = scene if isinstance(scene, Scene) else Scene.model_validate(scene)
    return Simulation(bundle_scene(parsed), transport or EmbeddedTransport())


def at_the_end(of: Simulation) -> ErrorEstimate:
    """Follow the scene's motion to its end; what the last step, and no other, says."""
    said = []
    while not of.done:
        said.append(of.step().estimate)
    assert said.pop() is not None and not any(said)
    assert of.report is not None and of.report.estimate is not None
    return of.report.estimate


def squeezed_and_let_go(model: str = "fem", friction: float = 0.5) -> dict[str, Any]:
    """A cube between plates that close in 0.05 s, hold, and go away again."""
    scene = press(2e4, 0.01, "fem" if model == "fem" else "pbd", friction=friction, hold=0.05, speed=0.02)
    away = [{"tools": [name], "move": [way, 0, 0], "speed": 0.2} for name, way in (("left", -0.02), ("right", 0.02))]
    return scene | {"motion": [*scene["motion"], *away, {"hold": 0.3}]}


@pytest.mark.parametrize(
    ("element", "poisson", "bends", "trusted"),
    [
        ("hex27", 0.45, True, True),
        ("hex27", 0.49, False, True),
        ("hex27_reduced", 0.3, True, True),
        ("hex27_reduced", 0.49, True, True),
        ("hex8_reduced", 0.49, True, False),
        ("hex8_reduced", 0.49, False, False),
        ("tet4_fbar", 0.45, True, False),
        ("tet4_fbar", 0.49, False, False),
        ("hex27_full", 0.4, True, False),
    ],
)
def test_the_estimate_is_the_error_to_a_factor_of_two_and_a_half(
    element: str, poisson: float, bends: bool, trusted: bool
) -> None:
    """Of tip or force, against hex27 on cells a third or half as long; a run that is 5 % off says so and what to do."""
    of = simulation(still("cantilever" if bends else "bonded", element, poisson))
    said = at_the_end(of)
    truth = settled("hex27", poisson, bends, 3 if bends else 2).value
    error = abs(settled(element, poisson, bends).value / truth - 1.0)
    if error > 0.01:
        assert 0.4 < said.answer / error < 2.5
    events = [event.message for event in of.events if event.kind == "accuracy"]
    assert said.too_large != trusted and len(events) == (not trusted)
    assert trusted == (error < 0.05), "the case is one that the test is about"
    assert ("try " in said.text) != trusted and all(said.text in event for event in events)
    of.close()


@pytest.mark.parametrize(("element", "other"), [("hex27", False), ("hex27_reduced", False), ("tet4_fbar", True)])
def test_only_who_would_gain_by_it_is_told_to_take_hex27(
    element: str, other: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """hex27_reduced is the softer of the two: on coarse cells it errs less. All are told of shorter cells."""
    monkeypatch.setattr(error_estimate, "TOO_FAR_OFF", 1e-3)
    of = simulation(still("bonded", element, 0.45))
    said = at_the_end(of)
    of.close()
    assert said.too_large and "too coarse" in said.text and "body.cell: " in said.text
    assert ("models.fem.element" in said.text) == other


@pytest.mark.slow
def test_no_cell_of_the_atlas_is_wrong_in_silence() -> None:
    """The map on which coarse low-order elements were: all of it, controls too; few that are right say they are not."""
    false_alarms = []
    for cell in MAPS["poisson"]().cells:
        verdict = cell.run()
        assert not verdict.silent, f"{cell.label}: {verdict.why}"
        if verdict.kind == "accurate" and any("estimated" in told for told in verdict.warned):
            false_alarms.append(cell.label)
    assert len(false_alarms) <= 8 and not any("hex27" in label for label in false_alarms)


def test_what_is_let_go_is_judged_as_it_was_held() -> None:
    """The estimate is of the look at which the body was strained most; there are at most as many as phases."""
    transport = Watched()
    of = simulation(squeezed_and_let_go(), transport)
    said = at_the_end(of)
    strains = [of.report.parts["body.far"].strain] if of.report is not None else []
    assert said.time == pytest.approx(0.05) and said.judged == 1.0
    assert 0.1 < said.mesh_error < 0.3 and strains[0] < 1e-3
    assert transport.looks == 1
    held = simulation(squeezed_and_let_go() | {"motion": squeezed_and_let_go()["motion"][:1]})
    assert at_the_end(held) == said
    of.step()
    assert of.report is not None and of.report.estimate is None, "a run ends once"
    of.close()
    held.close()


def test_who_steps_by_hand_pays_nothing_and_may_ask() -> None:
    scene = squeezed_and_let_go() | {"duration": 0.05}
    transport = Watched()
    of = simulation(scene, transport)
    close = {"left": [0.02, 0.0, 0.0], "right": [-0.02, 0.0, 0.0]}
    for _ in range(8):
        report = of.step(close)
    assert report.done and report.estimate is None and transport.looks == 0
    asked = of.estimate()
    assert asked is not None and 0.1 < asked.mesh_error < 0.3 and asked.time == of.time
    assert of.step(close).estimate is None and transport.looks == 1
    of.close()


def test_a_restored_run_says_the_same() -> None:
    of = simulation(squeezed_and_let_go())
    while of.time < 0.1:
        of.step()
    kept = of.save()
    said = at_the_end(of)
    of.close()
    other = simulation(squeezed_and_let_go())
    other.load(kept)
    assert at_the_end(other) == said
    other.close()


def test_cells_that_cannot_be_judged_are_left_out() -> None:
    """Where they hold most of the energy nothing is said: of a body that fills no cell, or is not strained."""
    half = {"shape": {"kind": "box", "size": [0.005, 0.02, 0.02], "position": [0.0025, 0, 0]},
            "material": {"young": 4e4}}  # fmt: skip
    scene = squeezed_and_let_go()
    mixed = scene | {"body": scene["body"] | {"cell": [0.02, 0.02, 0.02], "inclusions": [half]}}
    free = scene | {"tools": {}, "motion": [], "duration": 0.02}
    for case, words in ((mixed, "cells that one material fills"), (free, "hardly strained")):
        of = simulation(case)
        said = at_the_end(of)
        assert "not known" in said.text and words in said.text
        assert not said.too_large and said.judged == 0.0 and not of.events
        of.close()


def test_pbd_is_judged_by_its_model() -> None:
    """A pressed cube with rough plates: the error of its force, against FEM on cells half as long, to a factor of 2."""
    scene = squeezed_and_let_go("pbd") | {"motion": squeezed_and_let_go("pbd")["motion"][:2]}
    force = {}
    for name, change in (
        ("pbd", {}),
        ("fine", {"regions": {"default": "fem"}, "body": scene["body"] | {"cell": 0.005}}),
    ):
        of = simulation(scene | change)
        said = at_the_end(of)
        assert of.report is not None
        force[name] = of.report.quantities["grip_force"], said
        of.close()
    said = force["pbd"][1]
    error = abs(force["pbd"][0] / force["fine"][0] - 1.0)
    assert said.mesh_error == 0.0 and said.model_error > 0.05
    assert 0.5 < said.answer / error < 2.0


def test_what_pbd_pays_is_bounded() -> None:
    """Ten products give an energy that is smaller, but hardly, of 216 cells as of eight."""
    for cells in (2, 6):
        run = PbdRun(Scene.model_validate(press(2e4, 0.01, "pbd", friction=0.5, cells=cells)))
        run.run(0.02)
        whole = run.solver.fields(run.header(), True).model_error.sum()
        bounded = run.solver.fields(run.header(), True, True).model_error.sum()
        assert 0.9 * whole < bounded < whole


def test_reports_sessions_and_the_closing_table_say_it() -> None:
    scene = Scene.model_validate(still("cantilever", "tet4_fbar", 0.45))
    with open_as_given(scene) as session:
        builder = ReportBuilder(session.bundle)
        session.reset()
        last = session.run(lambda observation: builder.add(observation.report))
        said = last.error_estimate
        assert said is not None and said.too_large
        again = session.estimate_errors()
        assert again is not None and again.text == said.text
    report = builder.build()
    assert report["estimated_error"]["answer"] == said.answer
    console = Console(file=io.StringIO(), width=200)
    print_closing(console, report)
    assert isinstance(console.file, io.StringIO)
    assert f"estimated error: {said.text}" in console.file.getvalue()


def test_a_body_of_particles_has_none() -> None:
    rope = {"kind": "rope", "length": 0.1, "divisions": 4, "density": 0.05, "stretch": 5e3, "bending": 1e-6}
    scene = Scene.model_validate({"softseam": 1, "name": "rope", "step": 0.01, "duration": 0.02, "body": rope})
    backend = EmbeddedBackend(bundle_scene(scene))
    backend.reset(0)
    last = backend.step(2, None, False).report
    assert last.done and last.estimate is None and backend.estimate() is None
    backend.close()


def test_the_estimate_is_a_number_even_of_nonsense() -> None:
    """Fields that are not numbers are not known, rather than passed on."""
    of = simulation(still("cantilever", "hex27", 0.3))
    of.step()
    fields = of.regions.participants.observe(indicators=True, own=True)
    fields["body.far"].mesh_error[0] = np.nan
    said = of.only.errors.now(0.1, of.regions.parts, fields)
    assert said is not None and "not numbers" in said.text and said.answer == 0.0
    of.close()
