"""Compression is 0 until both tools touch the body, and then how much narrower it is between them, in every pose."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

STEP, SQUEEZE = 0.02, 0.15
DAMPED = {"young": 2e4, "poisson": 0.4, "density": 1000, "retardation_time": 0.01}
PLATE = {"kind": "box", "size": [0.01, 0.08, 0.05]}
# a wedge that points along +x, and its image
WEDGE = "v -10 -10 -10\nv -10 10 -10\nv -10 10 10\nv -10 -10 10\nv 10 0 -10\nv 10 0 10\n" + (
    "f 1 5 2\nf 4 3 6\nf 1 2 3\nf 1 3 4\nf 2 5 6\nf 2 6 3\nf 1 4 6\nf 1 6 5\n"
)
PAIRS: dict[str, list[dict[str, Any]]] = {
    "straight plates": [{**PLATE, "position": [-0.028, 0, 0.02]}, {**PLATE, "position": [0.028, 0, 0.02]}],
    "turned plates": [
        {**PLATE, "position": [x, 0, 0.02], "rotation": [0, 0, 0.26]} for x in (-0.0335, 0.0335)
    ],
    "plates turned apart": [
        {**PLATE, "position": [x, 0, 0.02], "rotation": [0, 0, turn]} for x, turn in ((-0.0335, 0.2), (0.0335, -0.2))
    ],
    "balls off the centre": [
        {"kind": "sphere", "radius": 0.009, "position": [x, y, 0.02]} for x, y in ((-0.031, 0.01), (0.031, -0.01))
    ],
    "crossed capsules": [
        {"kind": "capsule", "radius": 0.006, "length": 0.03, "axis": axis, "position": [x, 0.004, 0.02]}
        for x, axis in ((-0.029, [0, 1, 0]), (0.029, [0, 0.4, 1]))
    ],
    "a small plate and a cylinder": [
        {"kind": "box", "size": [0.01, 0.024, 0.02], "position": [-0.028, 0.003, 0.02]},
        {"kind": "cylinder", "radius": 0.012, "length": 0.03, "axis": [0.1, 0, 1], "position": [0.036, 0, 0.02]},
    ],
    "wedges": [
        {"kind": "mesh", "path": "wedge.obj", "scale": 0.001, "position": [x, 0, 0.02], "rotation": [0, 0, turn]}
        for x, turn in ((-0.0335, 0.3), (0.0335, np.pi - 0.3))
    ],
}  # fmt: skip


def scene(tools: list[dict[str, Any]], motion: list[dict[str, Any]], **changes: Any) -> Scene:
    document: dict[str, Any] = {
        "softseam": 1,
        "name": "compression",
        "gravity": [0, 0, 0],
        "step": STEP,
        "body": {
            "shape": {"kind": "block", "size": [0.04, 0.04, 0.04]},
            "cell": 0.02,
            "fixed": [{"min": [-1, -1, -1], "max": [1, 1, 0.001]}],  # else turned plates turn it
            "material": DAMPED,
        },
        "tools": {
            name: {**tool, "friction": 0.5} for name, tool in zip(("left", "right", "third"), tools, strict=False)
        },
        "motion": motion,
        "regions": {"default": "fem"},
        "quantities": ["grip_force", "compression"],
    }
    return Scene.model_validate({**document, **changes})


def run(of: Scene, files: dict[str, bytes] | None = None, told: list[str] | None = None) -> list[StepReport]:
    given = {"wedge.obj": WEDGE.encode(), **(files or {})}
    named = {name: given[name] for name in given if name in of.model_dump_json()}
    simulation = Simulation(bundle_scene(of, named), EmbeddedTransport())
    reports = []
    while not simulation.done:
        reports.append(simulation.step())
        assert len(reports) < 300
    if told is not None:
        told += [event.message for event in simulation.events if event.kind is EventKind.NOT_DONE]
    simulation.close()
    return reports


CLOSE: dict[str, Any] = {"tools": ["left", "right"], "close": 0.02, "until": {"compression": SQUEEZE}}


@pytest.mark.parametrize("pair", PAIRS)
def test_nothing_is_squeezed_before_both_touch_and_the_phase_ends_at_its_squeeze(pair: str) -> None:
    not_done: list[str] = []
    reports = run(scene(PAIRS[pair], [CLOSE, {"hold": 2 * STEP}]), told=not_done)
    assert not_done == []
    felt = [bool(report.wrench[0].any() and report.wrench[1].any()) for report in reports]
    told = [report.quantities["compression"] for report in reports]
    assert not felt[0] and felt[-1]
    assert all(value == 0.0 for value, both in zip(told, felt, strict=True) if not both)
    assert told[-1] == pytest.approx(SQUEEZE, abs=2e-3) and np.all(np.diff(told) >= 0.0)
    grip = reports[-1].quantities["grip_force"]
    assert grip > 0.1  # not at its edges' touch


def test_it_is_of_the_width_between_the_places_where_the_tools_touch() -> None:
    """Plates turned by .26 touch at two edges of the cube; balls off its middle touch its faces on oblique ways."""
    end = run(scene(PAIRS["turned plates"], [CLOSE]))[-1].tool_position
    touch = 0.02 + 0.005 / np.cos(0.26) + 0.02 * np.tan(0.26)
    assert -end[0, 0] == pytest.approx(touch - 0.5 * SQUEEZE * 0.04, abs=1e-7)
    end = run(scene(PAIRS["balls off the centre"], [CLOSE]))[-1].tool_position
    way = np.array([-0.031, 0.01]) / np.hypot(0.031, 0.01)
    meets = way * (0.029 / -way[0])  # the first ball's centre, as it touches x = -20 mm
    width = 2.0 * float(meets @ way + 0.009 * way[0])
    assert end[0, :2] == pytest.approx(meets - 0.5 * SQUEEZE * width * way, abs=2e-6)


@pytest.mark.parametrize("pair", PAIRS)
def test_it_knows_no_cells(pair: str) -> None:
    """The tools end where they do on any cells, in both models, wherever phases end within steps."""
    ends = []
    for cell, model in ((0.02, "fem"), (0.01, "fem"), (0.04, "pbd")):
        changed = scene(PAIRS[pair], [CLOSE]).model_dump()
        changed["body"]["cell"], changed["regions"]["default"] = cell, model
        ends.append(run(Scene.model_validate(changed))[-1].tool_position)
    for end in ends[1:]:
        np.testing.assert_allclose(end, ends[0], atol=2e-6)


def test_a_waist_counts_as_a_waist() -> None:
    """Fingers at the middle of a body that is twice as wide at its ends."""
    half = [0.02, 0.01, 0.02]
    rings = [
        [(x, y, z) for x, y in ((-w, -0.01), (w, -0.01), (w, 0.01), (-w, 0.01))]
        for w, z in zip(half, (0, 0.03, 0.06), strict=True)
    ]
    faces = ["f 4 3 2 1", "f 9 10 11 12"]
    for below in (0, 4):
        faces += [
            f"f {below + i + 1} {below + (i + 1) % 4 + 1} {below + (i + 1) % 4 + 5} {below + i + 5}" for i in range(4)
        ]
    waisted = "\n".join([*(f"v {x} {y} {z}" for ring in rings for x, y, z in ring), *faces, ""])
    fingers = [{"kind": "sphere", "radius": 0.006, "position": [x, 0, 0.03]} for x in (-0.02, 0.02)]
    body = {
        "shape": {"kind": "mesh", "path": "waist.obj"},
        "cell": 0.01,
        "material": DAMPED,
    }
    reports = run(scene(fingers, [CLOSE], body=body), {"waist.obj": waisted.encode()})
    # a ball rests in the notch of 2 atan(3/1), which its own centre is off by r/sin(half of it) from
    touch = 0.01 + 0.006 / np.cos(np.arctan(1.0 / 3.0))
    assert -reports[-1].tool_position[0, 0] == pytest.approx(touch - 0.5 * SQUEEZE * 0.02, abs=2e-4)
    assert reports[-1].quantities["compression"] == pytest.approx(SQUEEZE, abs=1e-6)


def test_a_body_that_was_carried_away_is_gripped_where_it_is() -> None:
    """Gripped, carried aside, let go, gripped again across its other side by tools that come to it."""
    plates = PAIRS["straight plates"]
    closed = {**CLOSE, "until": {"compression": 0.1}}
    aside = {"tools": ["left", "right"], "move": [0, 0.05, 0], "speed": 0.1}
    wide = [{"tools": [name], "move": [x, 0, 0], "speed": 0.1} for name, x in (("left", -0.008), ("right", 0.008))]
    free = {
        "fixed": [],
        "shape": {"kind": "block", "size": [0.04, 0.04, 0.04]},
        "cell": 0.02,
        "damping": 5.0,
        "material": DAMPED,
    }
    motion = [closed, aside, *wide, {"hold": 0.2}, closed, {"hold": 0.04}]
    reports = run(scene(plates, motion, body=free))
    opened = [report for report in reports if report.phase == 4]
    assert all(report.quantities["compression"] == 0.0 for report in opened)
    assert reports[-1].quantities["compression"] == pytest.approx(0.1, abs=2e-3)
    assert reports[-1].quantities["grip_force"] == pytest.approx(
        next(report for report in reports if report.phase == 1).quantities["grip_force"], rel=0.1
    )


def test_a_body_that_turns_instead_is_told_of() -> None:
    """Free between plates turned by 15 degrees, it turns flush with them first; between straight ones it does not."""
    free = {"shape": {"kind": "block", "size": [0.04, 0.04, 0.04]}, "cell": 0.02, "material": DAMPED}
    for pair, turns in (("turned plates", True), ("straight plates", False)):
        told: list[str] = []
        run(scene(PAIRS[pair], [CLOSE, {"hold": 2 * STEP}], body=free), told=told)
        assert [f"motion[0] ends at a compression of {SQUEEZE:g}" in text for text in told] == [True] * turns, told


def test_by_hand_it_counts_from_where_the_tools_came_to_the_body() -> None:
    """Balls that would touch the upper edges 1.5 mm later go down beside the faces first, and close as in a scene that
    begins there."""
    balls, lower = (
        [{"kind": "sphere", "radius": 0.009, "position": [x, 0.0, z]} for x in (-0.034, 0.034)] for z in (0.045, 0.035)
    )
    told = []
    for tools, down in ((balls, 10), (lower, 0)):
        simulation = Simulation(bundle_scene(scene(tools, [CLOSE])), EmbeddedTransport())
        for _ in range(down):
            simulation.step({name: [0, 0, -0.001 / STEP] for name in ("left", "right")})
        squeezed = []
        for _ in range(14):
            report = simulation.step({"left": [0.0005 / STEP, 0, 0], "right": [-0.0005 / STEP, 0, 0]})
            squeezed.append(report.quantities["compression"])
        told.append(squeezed)
        simulation.close()
    assert told[0][0] == 0.0 and told[0][-1] > 0.05
    np.testing.assert_allclose(told[0], told[1], atol=1e-4)
