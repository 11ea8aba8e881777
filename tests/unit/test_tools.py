"""Tools of a scene as arrays; tools that start inside the body are refused by name."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from solids import obj, sphere

from softseam_protocol.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.tools.build import build_tools
from softseam_services.tools.errors import ToolError
from softseam_services.tools.tool_set import BOX, PLANE, SPHERE

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


def test_arrays_follow_the_scene() -> None:
    tools = build_tools(scene({"ground": GROUND, "b": box([0.1, 0, 0]), "s": ball([0, 0.2, 0])}))
    assert tools.names == ("ground", "b", "s")
    np.testing.assert_array_equal(tools.kind, [PLANE, BOX, SPHERE])
    np.testing.assert_allclose(tools.shape, [[0.0, 0.0, 1.0], [0.01, 0.01, 0.01], [0.01, 0.0, 0.0]])
    np.testing.assert_allclose(tools.friction, [0.5, 0.6, 0.0])
    np.testing.assert_allclose(tools.position, [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0]])
    np.testing.assert_array_equal(tools.orientation, [[1, 0, 0, 0]] * 3)


def test_near_tools_are_those_that_move_unless_named() -> None:
    tools = {"ground": GROUND, "a": box([0.1, 0, 0]), "b": box([-0.1, 0, 0])}
    motion = [{"hold": 0.1}, {"tools": ["a", "b"], "close": 0.02, "until": {"time": 1.0}}]
    np.testing.assert_array_equal(build_tools(scene(tools, motion=motion)).near, [False, True, True])
    regions = {"near": {"within": 0.01, "tools": ["ground"]}}
    np.testing.assert_array_equal(build_tools(scene(tools, motion=motion, regions=regions)).near, [True, False, False])
    assert build_tools(scene({})).shape.shape == (0, 3)


@pytest.mark.parametrize(
    "tool",
    [
        GROUND,
        box([0.035, 0, 0.025]),  # touches a face
        box([0.035, 0.035, 0.06]),  # touches a corner
        ball([0, 0, 0.06]),  # touches the top
        box([0, 0, -0.05], 0.1),  # a table
    ],
)
def test_touching_is_allowed(tool: dict[str, object]) -> None:
    spec = scene({"tool": tool})
    build_tools(spec, build_body(spec, {}))


@pytest.mark.parametrize(
    "tool",
    [
        {"kind": "plane", "point": [0, 0, 0.001]},
        box([0.0349, 0, 0.025]),
        box([0, 0, 0.025], 0.004),  # smaller than the distance of surface points, wholly inside
        ball([0.004, 0.003, 0.025], 0.002),
        ball([0.0083, 0.0083, 0.0505], 0.002),  # pokes through the top between surface points
        box([0, 0, 0], 1.0),  # holds the body
    ],
)
def test_tools_inside_the_body_are_refused_by_name(tool: dict[str, object]) -> None:
    spec = scene({"fine": box([0.2, 0, 0]), "left": tool})
    with pytest.raises(ToolError, match=r"the tool 'left' starts .*inside the body: move it clear") as caught:
        build_tools(spec, build_body(spec, {}))
    assert "fine" not in str(caught.value)


def test_embedded_bodies_are_checked_on_their_true_surface() -> None:
    """A ball in the corner of the bounding box of a sphere does not touch it."""
    spec = scene({"ball": ball([0.017, 0.017, 0.037], 0.005)})
    mesh = Scene.model_validate(
        {
            **spec.model_dump(),
            "body": {**spec.body.model_dump(), "shape": {"kind": "mesh", "path": "s.obj"}, "cell": 0.01},
        }
    )
    body = build_body(mesh, {"s.obj": obj(*sphere(0.02, 3))})
    build_tools(mesh, body)
    inside = mesh.model_copy(update={"tools": scene({"ball": ball([0.012, 0.012, 0.032], 0.005)}).tools})
    with pytest.raises(ToolError, match="ball"):
        build_tools(inside, body)
