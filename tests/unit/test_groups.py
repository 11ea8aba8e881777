"""Motions of several tools at once: three that close about a point, moves by own vectors, tools turned as robots do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.file import SceneError, bundle_scene, parse_scene, scene_from_document
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.shapes.turns import quaternion_turning
from softseam_services.tools.build import build_tools

STEP = 0.01
NAMES = ["a", "b", "c"]
CORNER = "v 0 0 0\nv 30 0 0\nv 0 20 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def around(count: int, radius: float, height: float = 0.02, turn: float = 0.1) -> list[list[float]]:
    """Places about the origin [m]."""
    angles = turn + 2.0 * np.pi * np.arange(count) / count
    return [[float(radius * np.cos(t)), float(radius * np.sin(t)), height] for t in angles]


def document(motion: list[dict[str, Any]], **changes: Any) -> dict[str, Any]:
    """A cylinder of cells would be round; a block is not, so three balls feel unlike forces unless it can turn."""
    places = around(3, 0.0365)
    return {
        "softseam": 1,
        "name": "groups",
        "gravity": [0, 0, 0],
        "step": STEP,
        "body": {
            "shape": {"kind": "block", "size": [0.04, 0.04, 0.04]},
            "cell": 0.02,
            "fixed": [{"min": [-1, -1, -1], "max": [1, 1, 0.001]}],
            "material": {"young": 2e4, "poisson": 0.4, "density": 1000, "retardation_time": 0.01},
        },
        "tools": {
            name: {"kind": "sphere", "radius": 0.008, "position": place, "friction": 0.5}
            for name, place in zip(NAMES, places, strict=True)
        },
        "motion": motion,
        "regions": {"default": "fem"},
        **changes,
    }


def run(motion: list[dict[str, Any]], **changes: Any) -> list[StepReport]:
    simulation = Simulation(bundle_scene(Scene.model_validate(document(motion, **changes))), EmbeddedTransport())
    reports = []
    while not simulation.done:
        reports.append(simulation.step())
        assert len(reports) < 300
    simulation.close()
    return reports


CLOSE = {"tools": NAMES, "close": 0.02, "until": {"compression": 0.2}}


@pytest.mark.kernels
def test_three_tools_close_on_their_centre_by_a_squeeze() -> None:
    reports = run([CLOSE, {"hold": 0.05}])
    start, end = np.array(around(3, 0.0365)), reports[-1].tool_position
    inward = -start / np.linalg.norm(start[:, :2], axis=1, keepdims=True) * [1.0, 1.0, 0.0]
    gone = ((end - start) * inward).sum(axis=1)
    np.testing.assert_allclose(end - start, gone[:, None] * inward, atol=1e-12)
    np.testing.assert_allclose(gone, gone[0], atol=1e-12)
    last = reports[-1]
    pressed = -(last.wrench[:, :3] * inward).sum(axis=1)
    assert (pressed > 0.05).all()
    assert last.quantities["grip_force"] == pytest.approx(pressed.mean(), rel=1e-12)
    assert last.quantities["compression"] == pytest.approx(0.2, abs=1e-9)
    told = [report.quantities["compression"] for report in reports]
    assert told[0] == 0.0 and np.all(np.diff(told) >= 0.0)


@pytest.mark.kernels
def test_they_hold_a_force_and_open_again() -> None:
    held = {"tools": NAMES, "close": 0.02, "force": 0.5, "until": {"force": 0.45, "time": 1.0}}
    reports = run([held, {"hold": 0.3}, {"tools": [*reversed(NAMES)], "open": 0.05}])
    assert [r for r in reports if r.phase == 1][-1].quantities["grip_force"] == pytest.approx(0.5, rel=0.02)
    np.testing.assert_allclose(reports[-1].tool_position, around(3, 0.0365), atol=1e-9)


@pytest.mark.kernels
def test_they_close_about_a_point() -> None:
    """Also two of them, which are not opposite one another."""
    for names in (NAMES, NAMES[:2]):
        motion = [{"tools": names, "close": 0.02, "about": [0.002, -0.001, 0.02], "until": {"time": 0.1}}]
        end = run(motion)[-1].tool_position
        for start, now in zip(around(3, 0.0365)[: len(names)], end[: len(names)], strict=True):
            way = np.array([0.002, -0.001, 0.02]) - start
            np.testing.assert_allclose(now - start, 0.002 * way / np.linalg.norm(way), atol=1e-12)


@pytest.mark.kernels
def test_each_moves_by_its_own_vector_and_all_arrive_together() -> None:
    ways: dict[str, list[float]] = {"a": [0.01, 0, 0.02], "b": [0, 0, 0], "c": [0, -0.005, 0]}
    reports = run([{"move": ways, "speed": 0.1}, {"hold": STEP}])
    start = np.array(around(3, 0.0365))
    np.testing.assert_allclose(reports[-1].tool_position - start, list(ways.values()), atol=1e-12)
    time = np.hypot(0.01, 0.02) / 0.1
    half = reports[10]  # after 11 steps
    share = 11 * STEP / time
    np.testing.assert_allclose(half.tool_position - start, share * np.array(list(ways.values())), atol=1e-12)


SCENE = document([CLOSE])


@pytest.mark.parametrize(
    ("phase", "key", "words"),
    [
        ({"tools": ["a", "b", "a"], "close": 0.1, "until": {"time": 1}}, "motion.0.tools.2", "'a' is named twice"),
        ({"tools": ["a"], "close": 0.1, "until": {"time": 1}}, "motion.0.tools", "too few"),
        (
            {"tools": NAMES, "close": 0.1, "about": around(3, 0.0365)[1], "until": {"time": 1}},
            "motion.0.about",
            "is where 'b' is",
        ),
        ({"move": {"a": [0, 0, 1], "d": [0, 0, 1]}, "speed": 1}, "motion.0.move.d", "no tool is called 'd'"),
        ({"move": {"a": [0, 0, 0]}, "speed": 1}, "motion.0.move", "zero length"),
        ({"move": {}, "speed": 1}, "motion.0.move", "zero length"),
        ({"move": {"a": [0, 0]}, "speed": 1}, "motion.0.move.a", "too few"),
        ({"tools": ["b"], "move": {"a": [0, 0, 1]}, "speed": 1}, "motion.0.tools", "leave `tools` out"),
        ({"move": [0, 0, 1], "speed": 1}, "motion.0", "too few tools"),
        ({"tools": ["b"], "move": 3, "speed": 1}, "motion.0.move", "but this is 3"),
    ],
)
def test_what_cannot_be_meant_is_refused(phase: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(SceneError) as refused:
        scene_from_document({**SCENE, "motion": [phase]}, "groups")
    assert refused.value.key == key and words in str(refused.value)


def test_a_scene_is_the_same_after_it_was_written_and_read() -> None:
    scene = Scene.model_validate({**SCENE, "motion": [{"move": {"a": [0, 0, 1]}, "speed": 1}, CLOSE]})
    assert Scene.model_validate_json(scene.model_dump_json()) == scene
    assert scene.motion[0].tools == ("a",)  # type: ignore[union-attr]


# ---- how tools are turned and placed


def placed(tool: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and orientation (4,) of a tool as built."""
    changed = {**SCENE, "tools": {"tool": tool}, "motion": [{"hold": 0.1}]}
    tools = build_tools(scene_from_document(changed, "groups"), None, {"corner.obj": CORNER.encode()})
    return tools.position[0], tools.orientation[0]


BOX = {"kind": "box", "size": [0.01, 0.02, 0.03], "position": [0, 0, 0.1]}


@pytest.mark.kernels
def test_a_turn_may_be_a_vector_or_roll_pitch_yaw_or_a_quaternion() -> None:
    """Roll about x, then pitch about y, then yaw about z, all fixed, as in URDF."""
    r, p, y = 0.3, -0.5, 1.1
    about = np.array([[1.0, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    about = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]]) @ about
    about = np.array([[np.cos(y), -np.sin(y), 0], [np.sin(y), np.cos(y), 0], [0, 0, 1]]) @ about
    _, found = placed({**BOX, "rotation": {"rpy": [r, p, y]}})
    w, v = found[0], found[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    np.testing.assert_allclose(np.eye(3) + 2 * w * cross + 2 * cross @ cross, about, atol=1e-12)
    given = [3.0 * float(each) for each in found]
    for sign in (1.0, -1.0):
        _, again = placed({**BOX, "rotation": {"quaternion": [sign * each for each in given]}})
        np.testing.assert_allclose(abs(again @ found), 1.0, atol=1e-12)
    _, plain = placed({**BOX, "rotation": [0.1, -0.2, 0.3]})
    np.testing.assert_allclose(plain, quaternion_turning(np.array([0.1, -0.2, 0.3])), atol=1e-15)
    _, none = placed({**BOX, "rotation": {"quaternion": [1, 0, 0, 0]}})
    np.testing.assert_allclose(none, [1, 0, 0, 0], atol=1e-15)


@pytest.mark.parametrize(
    ("rotation", "key", "words"),
    [
        ({"rpy": [0, 1]}, "tools.tool.rotation.rpy", "too few"),
        ({"quaternion": [0, 0, 0, 0]}, "tools.tool.rotation.quaternion", "no turn has a quaternion of zeros"),
        ({"rpy": [0, 0, 1], "quaternion": [1, 0, 0, 0]}, "tools.tool.rotation", "one of rpy and quaternion"),
        ({"euler": [0, 0, 1]}, "tools.tool.rotation", "rpy"),
        ([0, 1], "tools.tool.rotation", "too few"),
    ],
)
def test_a_turn_that_is_none_is_refused(rotation: Any, key: str, words: str) -> None:
    with pytest.raises(SceneError) as refused:
        placed({**BOX, "rotation": rotation})
    assert refused.value.key == key and words in str(refused.value)


@pytest.mark.kernels
def test_a_mesh_is_placed_by_its_files_origin() -> None:
    """And turned about it: its centre follows."""
    mesh = {"kind": "mesh", "path": "corner.obj", "scale": 0.001, "position": [0, 0, 0.1]}
    at, turn = placed({**mesh, "place": "origin", "rotation": [0, 0, np.pi / 2]})
    np.testing.assert_allclose(at, [-0.01, 0.015, 0.105], atol=1e-12)
    np.testing.assert_allclose(turn, quaternion_turning(np.array([0, 0, np.pi / 2])), atol=1e-12)
    np.testing.assert_allclose(placed({**mesh, "place": "centre"})[0], [0, 0, 0.1])
    np.testing.assert_allclose(placed(mesh)[0], [0, 0, 0.1])
    up = placed({**mesh, "place": "origin", "up": "y"})[0]  # as a body's file: y to z
    assert up[2] == pytest.approx(0.11)


def test_a_file_names_the_line() -> None:
    text = (
        "softseam: 1\nname: x\nstep: 0.01\nduration: 1\n"
        "body: {shape: {kind: block, size: [1, 1, 1]}, cell: 1, material: {young: 1e4, poisson: 0.3, density: 1000}}\n"
        "tools:\n"
        "  a: {kind: box, size: [1, 1, 1], position: [0, 0, 3], rotation: {quaternion: [0, 0, 0, 0]}}\n"
    )
    with pytest.raises(SceneError) as refused:
        parse_scene(text)
    assert refused.value.line == 7
