"""What a scene asks for and its run did not do stands in the summary, with a remedy; what was done does not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from io import StringIO
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from squeeze import SCENE, Squeeze

from softseam.closing import print_closing
from softseam.report import ReportBuilder
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import Event, StepReport
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.motion import ClosePhase, HoldPhase, Phase
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.unfinished import left_out, unreached


def close(**until: float) -> ClosePhase:
    force = until.pop("held", None)
    return ClosePhase.model_validate({"tools": ("left", "right"), "close": 0.02, "until": until, "force": force})


@pytest.mark.parametrize(
    ("phase", "compression", "force", "words"),
    [
        (
            close(time=0.5, force=2.0),
            0.1,
            0.3,
            "motion[3]: its until.time of 0.5 s ended it with 0.3 N, not with the 2 N",
        ),
        (close(time=0.2, force=40.0), 0.0, 0.0, "with 0 N, not with the 40 N of until.force"),
        (close(time=1.5, compression=0.3), 0.12, 5.0, "a compression of 0.12, not with the 0.3 of until.compression"),
        (close(time=0.7, compression=0.15), -0.4, 0.0, "a compression of 0, not with the 0.15"),
        (close(time=0.9, held=3.0), 0.1, 1.1, "with 1.1 N, not with the 3 N of `force`"),
        (close(time=0.5, force=2.0, compression=0.2), 0.1, 0.3, "the 2 N of until.force, and a compression of 0.1"),
        (close(time=0.5, force=2.0), 0.1, 1.99, ""),
        (close(time=0.5, compression=0.2), 0.2, 0.0, ""),
        (close(time=0.9, held=3.0), 0.1, 2.9, ""),
        (close(time=0.5), 0.0, 0.0, ""),
        (close(compression=0.2), 0.1, 0.0, ""),
        (HoldPhase(hold=0.3), 0.0, 0.0, ""),
    ],
)
def test_a_phase_that_time_ended_says_what_it_lacked(
    phase: Phase, compression: float, force: float, words: str
) -> None:
    told = unreached(3, phase, compression, force)
    assert (words in told and "give left and right more time" in told) if words else told == ""


@pytest.mark.parametrize(
    ("number", "begun", "words"),
    [
        (0, True, "motion[0] is not over, and motion[1] to motion[3] not begun"),
        (2, True, "motion[2] is not over, and motion[3] not begun"),
        (3, True, "motion[3] is not over;"),
        (1, False, "motion[1] is not begun, nor are motion[2] to motion[3]"),
        (2, False, "motion[2] is not begun, nor is motion[3]"),
        (3, False, "motion[3] is not begun;"),
    ],
)
def test_a_motion_that_is_cut_off_says_where(number: int, begun: bool, words: str) -> None:
    told = left_out([HoldPhase(hold=0.1)] * 4, number, begun, 0.45)
    assert told.startswith(f"the duration of 0.45 s ends before the motion: {words}") and "longer `duration`" in told


def pressed(motion: list[dict[str, Any]], duration: float | None = None) -> list[str]:
    """What a run of a cube of eight cells between two plates tells of what was not done."""
    scene = Scene.model_validate(
        {
            **SCENE,
            "body": {
                "shape": {"kind": "block", "size": [0.02, 0.02, 0.02]},
                "cell": 0.01,
                "material": {"young": 2e4, "poisson": 0.3, "density": 1000},
            },
            "tools": {
                "ground": {"kind": "plane"},
                "left": {"kind": "box", "size": [0.01, 0.03, 0.03], "position": [-0.016, 0, 0.02]},
                "right": {"kind": "box", "size": [0.01, 0.03, 0.03], "position": [0.016, 0, 0.02]},
            },
            "motion": motion,
            "duration": duration,
            "regions": {"default": "fem"},
            "quantities": [],
        }
    )
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    while not simulation.done:
        simulation.step()
    told = [event.message for event in simulation.events if event.kind is EventKind.NOT_DONE]
    simulation.close()
    return told


CLOSE = {"tools": ["left", "right"], "close": 0.02}


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("until", "words"),
    [
        ({"force": 50.0, "time": 0.1}, "of until.force"),
        ({"compression": 0.4, "time": 0.15}, "not with the 0.4 of until.compression"),
        ({"force": 5.0, "time": 0.02}, "with 0 N, not with the 5 N"),
        ({"force": 0.2, "time": 0.5}, ""),
        ({"compression": 0.1, "time": 0.5}, ""),
        ({"time": 0.1}, ""),
    ],
)
def test_a_run_tells_of_tools_that_time_stopped(until: dict[str, float], words: str) -> None:
    told = pressed([{**CLOSE, "until": until}, {"hold": 0.03}])
    assert [words in text for text in told] == [True] if words else not told


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("duration", "words"),
    [
        (0.05, "motion[0] is not over, and motion[1] to motion[2] not begun"),
        (0.1, "motion[1] is not begun, nor is motion[2]"),
        (0.12, "motion[1] is not over, and motion[2] not begun"),
        (0.17, "motion[2] is not over"),
        (0.2, ""),
        (0.3, ""),
        (None, ""),
    ],
)
def test_a_run_tells_of_a_motion_that_its_duration_cuts(duration: float | None, words: str) -> None:
    told = pressed([{**CLOSE, "until": {"time": 0.1}}, {"hold": 0.05}, {"hold": 0.05}], duration)
    assert [words in text for text in told] == [True] if words else not told


def report_of(
    scene: dict[str, Any],
    told: Sequence[tuple[EventKind, str]] = (),
    touching: bool = True,
    n_steps: int = 20,
) -> dict[str, Any]:
    run = Squeeze(n_steps)
    builder = ReportBuilder(Bundle(Scene.model_validate({**SCENE, **scene}).model_dump_json(), {}))
    for message in run.messages():
        if isinstance(message, StepReport) and not touching:
            message = replace(message, wrench=np.zeros_like(message.wrench))
        builder.add(message)
    for kind, text in told:
        builder.add(Event(run.header(n_steps), kind, text))
    return builder.build()


def closing(report: dict[str, Any]) -> list[str]:
    said = StringIO()
    print_closing(Console(file=said, width=200), report)
    return [line for line in said.getvalue().splitlines() if line.startswith("not done: ")]


@pytest.mark.kernels
def test_the_summary_says_what_was_not_done() -> None:
    """As sentences of their own, however many other events there were of a kind."""
    told = [
        (EventKind.NOT_DONE, "13 of the 26 cells that regions.near asked for never became fem"),
        (EventKind.REGIONS, "8 cells raised"),
        (EventKind.FORCE, "motion[0] ends with 0.6 N, not with the 1 N of until.force"),
        (EventKind.NOT_DONE, "the duration ends before the motion"),
    ]
    report = report_of({}, told)
    assert report["not_done"] == [told[i][1] for i in (0, 2, 3)]
    assert closing(report) == [f"not done: {text}" for text in report["not_done"]]
    assert report_of({})["not_done"] == [] == closing(report_of({}))


@pytest.mark.kernels
def test_a_summary_is_no_longer_than_a_page() -> None:
    lines = closing(report_of({}, [(EventKind.NOT_DONE, f"motion[{i}]: nothing") for i in range(40)]))
    assert len(lines) == 7 and lines[-1] == "not done: 34 more, see not_done in a --report"


@pytest.mark.kernels
@pytest.mark.parametrize("until", [{"time": 0.4}, {"compression": 0.15}, {"time": 0.4, "compression": 0.2}])
def test_tools_that_close_on_nothing_are_told_of(until: dict[str, float]) -> None:
    motion = [{**CLOSE, "until": until}, {"tools": ["left", "right"], "move": [0, 0, 0.05], "speed": 0.05}]
    words = "motion[0]: left and right never touched a body: close longer, or begin nearer to it"
    assert report_of({"motion": motion}, touching=False)["not_done"] == [words]
    assert report_of({"motion": motion}, touching=True)["not_done"] == []


@pytest.mark.kernels
def test_a_phase_that_was_never_begun_has_not_failed_to_touch() -> None:
    motion = [{"hold": 0.1}, {"hold": 0.1}, {**CLOSE, "until": {"time": 0.4}}]
    assert report_of({"motion": motion}, touching=False)["not_done"] == []


FINGERS: dict[str, dict[str, Any]] = {
    "box": {"kind": "box", "size": [0.01, 0.01, 0.01]},
    "sphere": {"kind": "sphere", "radius": 0.005},
    "capsule": {"kind": "capsule", "radius": 0.004, "length": 0.01},
    "cylinder": {"kind": "cylinder", "radius": 0.004, "length": 0.01},
}
SOFT = {"material": {"young": 2e4, "poisson": 0.3, "density": 1000}, "cell": 0.01}
BODIES: dict[str, dict[str, Any]] = {
    "fem": {"shape": {"kind": "block", "size": [0.02, 0.02, 0.02]}, **SOFT, "regions": {"default": "fem"}},
    "pbd": {"shape": {"kind": "block", "size": [0.02, 0.02, 0.02]}, **SOFT, "regions": {"default": "pbd"}},
    "sheet": {"kind": "sheet", "size": [0.02, 0.02], "divisions": [4, 4], "density": 0.1, "stretch": 100},
}
MOTIONS: dict[str, dict[str, Any]] = {
    "moves": {"tools": ["finger"], "move": [0, 0, -0.0123], "speed": 0.2},
    "turns": {"tools": ["finger"], "turn": [0.1, 0, 0], "speed": 2.0, "about": [0, 0.123, 0]},
    "closes": {"tools": ["finger", "ground"], "close": 0.2, "until": {"time": 0.06}},
    "presses": {"tools": ["finger", "ground"], "close": 0.2, "force": 0.5, "until": {"time": 0.06}},
}


@pytest.mark.kernels
@pytest.mark.parametrize("kind", FINGERS)
@pytest.mark.parametrize(
    ("model", "how"), [(model, how) for model in BODIES for how in MOTIONS if (model, how) != ("sheet", "presses")]
)
@pytest.mark.parametrize("reaches", [True, False])
def test_a_tool_that_moved_and_reached_nothing_is_told_of(kind: str, model: str, how: str, reaches: bool) -> None:
    """Each kind of tool, drive and model: pressed on the middle of the top, or beside the body."""
    told = reached(FINGERS[kind], BODIES[model], MOTIONS[how], [0.0 if reaches else 0.06, 0.0, 0.032])
    assert reaches != any("motion[0]: finger" in text and "never touched a body" in text for text in told)


def reached(finger: dict[str, Any], body: dict[str, Any], phase: dict[str, Any], position: list[float]) -> list[str]:
    sheet = body.get("kind") == "sheet"
    fixed = [{"min": [-1, -1, -1], "max": [-0.0099, 1, 1]}, {"min": [0.0099, -1, -1], "max": [1, 1, 1]}]
    regions = body.get("regions", {"default": "pbd"})
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "finger",
            "step": 0.005,
            "body": {k: v for k, v in body.items() if k != "regions"}
            | {"position": [0, 0, 0.02 if sheet else 0], "fixed": fixed},
            "regions": regions,
            "tools": {"ground": {"kind": "plane", "point": [0, 0, -0.2]}, "finger": {**finger, "position": position}},
            "motion": [phase],
        }
    )
    found = report_by_running(scene)["not_done"]
    assert isinstance(found, list)
    return found


def report_by_running(scene: Scene) -> dict[str, Any]:
    bundle = bundle_scene(scene)
    builder, simulation = ReportBuilder(bundle), Simulation(bundle, EmbeddedTransport())
    while not simulation.done:
        builder.add(simulation.step())
    simulation.close()
    return builder.build()


def hanging_scene(young: float, model: str, body: dict[str, Any], **models: Any) -> Scene:
    """A block that is held at its top, which nothing touches, for .1 s."""
    block: dict[str, Any] = {
        "shape": BODIES["fem"]["shape"],
        "cell": SOFT["cell"],
        "material": {"young": young, "poisson": 0.3, "density": 1000},
        "fixed": [{"min": [-1, -1, 0.0199], "max": [1, 1, 1]}],
        **body,
    }
    document = {"softseam": 1, "name": "hanging", "step": 0.01, "duration": 0.1, "body": block}
    return Scene.model_validate({**document, "regions": {"default": model}, "models": models})


def hanging(young: float, model: str, body: dict[str, Any]) -> dict[str, Any]:
    """A report of it, at rest where nothing drags at it."""
    static = {} if body.get("damping") else {"fem": {"integrator": "static"}}
    return report_by_running(hanging_scene(young, model, body, **static))


@pytest.mark.kernels
@pytest.mark.parametrize("young", [3e3, 2e4, 1e6])
def test_rest_that_is_asked_of_fem_is_missed_by_xpbd(young: float) -> None:
    """`static` finds rest at once; the same scene by XPBD swings about it, and says so."""
    assert hanging(young, "fem", {})["not_done"] == []
    (told,) = hanging(young, "pbd", {})["not_done"]
    assert told.startswith("models.fem.integrator: static: the run is by pbd, which moves the body")
    assert hanging(young, "pbd", {"damping": 5.0})["not_done"] == []


@pytest.mark.kernels
def test_what_a_scene_damps_is_no_error_of_its_steps() -> None:
    """A block that swings too little for its steps alone is told of; one whose air drags at it is as it should be."""
    for model in ("fem", "pbd"):
        for damping in (0.0, 20.0):
            simulation = Simulation(bundle_scene(hanging_scene(2e4, model, {"damping": damping})), EmbeddedTransport())
            while not simulation.done:
                simulation.step()
            told = [event.message for event in simulation.events if ": steps took" in event.message]
            simulation.close()
            assert len(told) == (damping == 0.0)
            assert all(("midpoint" in text) == (model == "fem") for text in told)
