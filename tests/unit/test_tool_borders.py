"""Cells with borders at tools' edges: where the planes are, how cells thin towards them, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_protocol.scene.scene import Scene
from softseam_protocol.tool_borders import Line, tool_borders
from softseam_services.body.block import bordered_line
from softseam_services.body.build import build_body

PAD = {"kind": "box", "size": (0.01, 0.02, 0.03), "position": (-0.043, 0.002, 0.025)}


def pads(grading: Any = 3.0, towards: tuple[str, ...] = ("left",), cell: Any = 0.01, **pad: Any) -> Scene:
    """A cube of 5 cm and a pad on its left, 3 mm off it."""
    shape = {"kind": "block", "size": (0.05, 0.05, 0.05), "grading": grading, "towards": towards}
    material = {"young": 20e3, "poisson": 0.45, "density": 1050.0}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "pads",
            "duration": 1.0,
            "body": {"shape": shape, "cell": cell, "material": material},
            "tools": {"left": {**PAD, **pad}, "ball": {"kind": "sphere", "radius": 0.01, "position": (0, 0, 0.2)}},
            "regions": {"default": "fem"},
        }
    )


def lines(scene: Scene) -> list[np.ndarray]:
    """Where cells end along x, y and z, from the block's lower corner [m]."""
    body = build_body(scene, {})
    corners = body.x_rest[body.cell_nodes[:, [0, 26]]].reshape(-1, 3) + np.array([0.025, 0.025, 0.0])
    return [np.unique(np.round(corners[:, axis], 9)) for axis in range(3)]


@pytest.mark.kernels
def test_cells_end_at_the_edges_of_the_pad() -> None:
    x, y, z = lines(pads())
    assert {0.017, 0.037} <= set(y) and {0.01, 0.04} <= set(z)
    # towards the pad's plane along x, with the farthest cell three times as long as the nearest
    widths = np.diff(x)
    assert widths[-1] / widths[0] == pytest.approx(3.0) and (np.diff(widths) > 0.0).all()
    # the middle piece of z is thin at both ends, the outer pieces are one cell each
    np.testing.assert_allclose(np.diff(z), [0.01, 0.006, 0.018, 0.006, 0.01], atol=1e-9)


@pytest.mark.kernels
def test_without_grading_pieces_have_equal_cells() -> None:
    _, y, z = lines(pads(grading=1.0))
    np.testing.assert_allclose(z, [0.0, 0.01, 0.02, 0.03, 0.04, 0.05], atol=1e-9)
    np.testing.assert_allclose(np.diff(y), [0.0085, 0.0085, 0.01, 0.01, 0.013], atol=1e-9)


@pytest.mark.kernels
def test_each_axis_has_its_own_grading() -> None:
    apart = lines(pads(grading=(1.0, 2.0, 4.0)))
    for axis, alone in enumerate((1.0, 2.0, 4.0)):
        np.testing.assert_array_equal(apart[axis], lines(pads(grading=alone))[axis])
    # along faces, too, without a tool
    apart = lines(pads(grading=(4.0, 1.0, 1.0), towards=()))
    np.testing.assert_array_equal(apart[0], lines(pads(grading=4.0, towards=()))[0])
    np.testing.assert_allclose(np.diff(apart[1]), 0.01, atol=1e-9)


def test_a_grading_out_of_range_is_refused_by_its_axis() -> None:
    with pytest.raises(ValueError, match=r"grading.*\n?.*less than or equal to 20"):
        pads(grading=(1.0, 1.0, 21.0))


@pytest.mark.kernels
def test_a_plate_over_the_whole_face_grades_as_grading_alone_does_beside_it() -> None:
    """Its edges are beyond the block's, so cells are thinner at the block's faces, but behind not."""
    covering = lines(pads(4.0, size=(0.01, 0.08, 0.08)))
    alone = lines(pads(4.0, towards=()))
    for axis in (1, 2):
        np.testing.assert_allclose(covering[axis], alone[axis], atol=1e-9)
    assert np.diff(covering[0])[0] < 0.3 * np.diff(covering[0])[-1]


@pytest.mark.parametrize("turn", [0.5 * np.pi, -0.5 * np.pi, 1.5 * np.pi])
def test_a_pad_turned_by_a_quarter(turn: float) -> None:
    turned = tool_borders((0.05, 0.05, 0.05), (0, 0, 0), pads(rotation=(turn, 0.0, 0.0)).tools, ("left",))
    assert turned[1].planes == pytest.approx((0.012, 0.042)) and turned[2].planes == pytest.approx((0.015, 0.035))
    assert turned[0] == Line((), (True, False))


def test_planes_that_are_close_to_others_or_to_a_face_are_left_out() -> None:
    found = bordered_line(0.05, 0.01, 1.0, Line((0.0005, 0.02, 0.0205, 0.0495), (False, False)))
    np.testing.assert_allclose(found, [0.0, 0.01, 0.02, 0.03, 0.04, 0.05], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"towards": ("right",)}, "no tool is called 'right'"),
        ({"towards": ("ball",)}, "ball is a sphere: cells are graded towards edges of boxes only, leave it out"),
        ({"rotation": (0.1, 0.0, 0.0)}, "left stands askew to the block: leave it out, or turn it by quarters alone"),
        ({"position": (-0.043, -0.043, 0.025)}, "left is past an edge of the block at time 0, and looks at no face"),
    ],
)
def test_what_has_no_edge_on_the_block_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        pads(**change)


def test_the_refusal_names_the_entry() -> None:
    text = pads().model_dump_json().replace('"towards":["left"]', '"towards":["left","ball"]')
    with pytest.raises(SceneError) as refused:
        parse_scene(text, "pads.yaml")
    assert refused.value.key == "body.shape.towards.1"
