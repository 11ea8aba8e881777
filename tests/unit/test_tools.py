"""Tools of a scene as arrays; tools that start inside the body are refused by name."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
import solids
from solids import obj, sphere

from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.body.errors import MeshError, ToolError
from softseam_services.shapes.branches import BOX, CAPSULE, MESH, PLANE, SPHERE
from softseam_services.tools.build import build_tools
from softseam_services.tools.kernels import tool_gap


def long(kind: str, position: list[float], axis: list[float], radius: float = 0.01) -> dict[str, object]:
    return {"kind": kind, "radius": radius, "length": 0.04, "position": position, "axis": axis}


def mesh(position: list[float], rotation: float = 0.0) -> dict[str, object]:
    return {"kind": "mesh", "path": "finger.obj", "position": position, "rotation": [0, 0, rotation]}


FILES = {"finger.obj": obj(*solids.box((0.02, 0.02, 0.06)))}
GROUND = {"kind": "plane", "normal": [0, 0, 2.0], "friction": 0.5}


def scene(tools: Mapping[str, object], **other: object) -> Scene:
    body = {
        "shape": {"kind": "block", "size": [0.05, 0.05, 0.05]},
        "material": {"young": 2e4, "poisson": 0.3, "density": 1000},
    }
    return Scene.model_validate({"softseam": 1, "name": "t", "duration": 1.0, "body": body, "tools": tools, **other})


def box(position: list[float], size: float = 0.02) -> dict[str, object]:
    return {"kind": "box", "size": [size] * 3, "position": position, "friction": 0.6}


def ball(position: list[float], radius: float = 0.01) -> dict[str, object]:
    return {"kind": "sphere", "radius": radius, "position": position}


@pytest.mark.kernels
def test_arrays_follow_the_scene() -> None:
    tools = build_tools(scene({"ground": GROUND, "b": box([0.1, 0, 0]), "s": ball([0, 0.2, 0])}))
    assert tools.names == ("ground", "b", "s")
    np.testing.assert_array_equal(tools.kind, [PLANE, BOX, SPHERE])
    np.testing.assert_allclose(tools.shape, [[0, 0, 1.0, 0], [0.01, 0.01, 0.01, 0], [0.01, 0, 0, 0]])
    np.testing.assert_allclose(tools.friction, [0.5, 0.6, 0.0])
    np.testing.assert_allclose(tools.position, [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0]])
    np.testing.assert_array_equal(tools.orientation, [[1, 0, 0, 0]] * 3)


@pytest.mark.kernels
def test_followed_tools_are_those_that_move_unless_named() -> None:
    tools = {"ground": GROUND, "a": box([0.1, 0, 0]), "b": box([-0.1, 0, 0])}
    motion = [{"hold": 0.1}, {"tools": ["a", "b"], "close": 0.02, "until": {"time": 1.0}}]
    np.testing.assert_array_equal(build_tools(scene(tools, motion=motion)).followed, [False, True, True])
    regions = {"near": {"within": 0.01, "tools": ["ground"]}}
    np.testing.assert_array_equal(
        build_tools(scene(tools, motion=motion, regions=regions)).followed, [True, False, False]
    )
    assert build_tools(scene({})).shape.shape == (0, 3)


@pytest.mark.kernels
@pytest.mark.parametrize(
    "tool",
    [
        GROUND,
        box([0.035, 0, 0.025]),  # touches a face
        box([0.035, 0.035, 0.06]),  # touches a corner
        ball([0, 0, 0.06]),  # touches the top
        box([0, 0, -0.05], 0.1),  # a table
        {**box([0.025 + 0.01 * np.sqrt(2), 0, 0.025]), "rotation": [0, 0, np.pi / 4]},  # touches along an edge
        long("capsule", [0, 0, 0.06], [1, 0, 0]),
        long("cylinder", [0, 0, 0.07], [0, 0, 1]),
        long("cylinder", [0.035, 0, 0.025], [0, 2, 0]),
        mesh([0.035, 0, 0.025]),
    ],
)
def test_touching_is_allowed(tool: dict[str, object]) -> None:
    spec = scene({"tool": tool})
    build_tools(spec, build_body(spec, FILES), FILES)


@pytest.mark.kernels
@pytest.mark.parametrize(
    "tool",
    [
        {"kind": "plane", "point": [0, 0, 0.001]},
        box([0.0349, 0, 0.025]),
        box([0, 0, 0.025], 0.004),  # smaller than the distance of surface points, wholly inside
        ball([0.004, 0.003, 0.025], 0.002),
        ball([0.0083, 0.0083, 0.0505], 0.002),  # pokes through the top between surface points
        box([0, 0, 0], 1.0),  # holds the body
        {**box([0.039, 0, 0.025]), "rotation": [0, 0, np.pi / 4]},
        long("capsule", [0.004, 0.003, 0.079], [0, 0, 1]),  # its round end
        long("capsule", [0, 0, 0.0595], [1, 0, 0]),
        long("cylinder", [0, 0, 0.0695], [0, 0, 1]),
        long("cylinder", [0.0083, 0.0083, 0.069], [0, 0, 1], 0.002),  # pokes through the top between surface points
        mesh([0.034, 0, 0.025]),
        mesh([0.036, 0, 0.025], 0.3),
    ],
)
def test_tools_inside_the_body_are_refused_by_name(tool: dict[str, object]) -> None:
    spec = scene({"fine": box([0.2, 0, 0]), "left": tool})
    with pytest.raises(ToolError, match=r"tools\.left: it starts .*inside the body: move it clear") as caught:
        build_tools(spec, build_body(spec, FILES), FILES)
    assert "fine" not in str(caught.value)


@pytest.mark.kernels
def test_embedded_bodies_are_checked_on_their_true_surface() -> None:
    """A ball in the corner of the bounding box of a sphere does not touch it."""
    spec = scene({"ball": ball([0.017, 0.017, 0.037], 0.005)})
    embedded = Scene.model_validate(
        {
            **spec.model_dump(),
            "body": {**spec.body.model_dump(), "shape": {"kind": "mesh", "path": "s.obj"}, "cell": 0.01},
        }
    )
    body = build_body(embedded, {"s.obj": obj(*sphere(0.02, 3))})
    build_tools(embedded, body)
    inside = embedded.model_copy(update={"tools": scene({"ball": ball([0.012, 0.012, 0.032], 0.005)}).tools})
    with pytest.raises(ToolError, match="ball"):
        build_tools(inside, body)


@pytest.mark.kernels
def test_long_tools_lie_along_their_axis_and_meshes_are_centred() -> None:
    tools = build_tools(
        scene({"a": long("capsule", [0.1, 0, 0], [0, 3, 0]), "b": box([0, 0, 1.0]), "m": mesh([0, 0, 2.0])}),
        files=FILES,
    )
    np.testing.assert_array_equal(tools.kind, [CAPSULE, BOX, MESH])
    assert tools.shape.shape[0] == 3 and tools.shape.shape[1] > 10_000
    np.testing.assert_allclose(tools.shape[:, :3], [[0.01, 0.02, 0.0], [0.01, 0.01, 0.01], [0.01, 0.01, 0.03]])
    for tool, point, gap in ((0, [0.1, 0.03, 0], 0.0), (0, [0.111, 0.02, 0], 1e-3), (2, [0, 0.01, 2.0], 0.0)):
        found = tool_gap(
            tools.kind[tool], tools.shape[tool], tools.position[tool], tools.orientation[tool], np.array(point)
        )
        assert found[0] == pytest.approx(gap, abs=1e-12)


def test_a_mesh_without_its_file_and_an_axis_of_zero_are_refused() -> None:
    with pytest.raises(MeshError, match=r"finger\.obj: the file is missing"):
        build_tools(scene({"m": mesh([0, 0, 2.0])}))
    with pytest.raises(ValueError, match="the axis must not be zero"):
        scene({"a": long("capsule", [0.1, 0, 0], [0, 0, 0])})


@pytest.mark.kernels
@pytest.mark.parametrize("above", [1e-18, -3e-17, 2e-16])
def test_rounding_is_no_place(above: float) -> None:
    """A body on the ground stands at z 0 in what is said of it."""
    spec = scene({"left": box([0.034, 0, 0.025])})
    body = build_body(spec, FILES)
    body.x_rest[:, 2] += above - body.x_rest[:, 2].min()
    with pytest.raises(ToolError, match=r"; z 0 \.\. "):
        build_tools(spec, body, FILES)
