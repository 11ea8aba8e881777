"""Cells that end where materials meet: where the planes are, how many cells lie between, and who asks for them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rich.console import Console

from softseam.checking import check_scene
from softseam.scenes import load_scene
from softseam.variants import with_settings
from softseam_protocol.material_borders import are_equal, cells_along, material_borders, pieces, wanted_for
from softseam_protocol.scene.bodies import BlockShape, BodySpec
from softseam_protocol.scene.scene import Scene
from softseam_services.bodies import build_any_body
from softseam_services.body.body import Body
from softseam_studies.study.configurations import Fem, configurations
from softseam_studies.study.frame import Frame
from softseam_studies.study.levels import ACROSS, levels_of

SIZE = (0.06, 0.04, 0.04)
EDGES = np.array(SIZE)
BAR = {"kind": "box", "position": (0.01, 0.0, 0.02), "size": (0.02, 0.1, 0.01)}


def layers(border: float = 0.02, *settings: str) -> Scene:
    """heavy_on_soft with the upper layer's lower face at `border` [m]."""
    start = f"body.inclusions.0.shape.position=[0, 0, {border + 0.01}]"
    size = "body.inclusions.0.shape.size=[0.1, 0.1, 0.02]"
    return with_settings(load_scene("heavy_on_soft"), (start, size, *settings))


def two_layers(border: float) -> Frame:
    """The upper one from `border` to the top [m]."""
    whole = (
        f"body.inclusions.0.shape.position=[0, 0, {border + 0.05}]",
        "body.inclusions.0.shape.size=[0.1, 0.1, 0.1]",
    )
    return Frame(layers(border, *whole), EDGES)


def spec(scene: Scene) -> BodySpec:
    assert isinstance(scene.body, BodySpec)
    return scene.body


def built(scene: Scene) -> Body:
    body = build_any_body(scene, scene.body, {})
    assert isinstance(body, Body)
    return body


def ends(body: Body, axis: int) -> NDArray[np.float64]:
    """Where cells end along an axis [m]."""
    return np.unique(np.round(body.x_rest[body.cell_nodes[:, [0, 26]]][..., axis], 9))


def planes(*parts: dict[str, Any]) -> tuple[tuple[float, ...], ...]:
    text = [{"shape": part, "material": {"young": 1e5}} for part in parts]
    body = spec(load_scene("heavy_on_soft")).model_dump() | {"inclusions": text}
    return material_borders(SIZE, (0.0, 0.0, 0.0), BodySpec.model_validate(body).inclusions)


def test_planes_are_where_boxes_end_inside_the_block() -> None:
    """From the block's lower corner; a box beside the block, a sphere and one askew have none."""
    x, y, z = planes(BAR)
    assert x == pytest.approx((0.03, 0.05)) and y == () and z == pytest.approx((0.015, 0.025))
    assert planes({**BAR, "position": (0.01, 0.0, 0.2)}) == ((), (), ())
    assert planes({**BAR, "rotation": (0.0, 0.3, 0.0)}) == ((), (), ())
    assert planes({"kind": "sphere", "position": (0.0, 0.0, 0.02), "radius": 0.01}) == ((), (), ())
    turned = planes({**BAR, "rotation": (0.0, 0.5 * np.pi, 0.0)})
    assert turned[0] == pytest.approx((0.035, 0.045)) and turned[2] == pytest.approx((0.01, 0.03))
    assert planes(BAR, BAR) == (x, y, z), "two that end in one plane"


def test_pieces_have_whole_cells() -> None:
    assert [n for *_, n in pieces(0.04, 0.01, (0.013, 0.033))] == [1, 2, 1]
    assert [n for *_, n in pieces(0.04, 0.04 / 3.0, (0.02,))] == [2, 2], "halves round up, on both sides alike"
    assert cells_along(0.04, 0.04, (0.02,)) == 2 and cells_along(0.04, 0.01, ()) == 4
    assert are_equal(0.04, 0.01, (0.02,)) and not are_equal(0.04, 0.01, (0.013,))
    for count in (2, 4, 6, 8):
        wanted = wanted_for(0.04, count, (0.02,))
        assert wanted is not None and cells_along(0.04, wanted, (0.02,)) == count
    assert wanted_for(0.04, 3, (0.02,)) is None


@pytest.mark.parametrize("planes", [(0.18, 0.36), (0.2, 0.5), (0.31, 0.42), (0.04, 0.9), (0.15, 0.4, 0.8)])
def test_all_counts_that_cells_can_have_are_found_again(planes: tuple[float, ...]) -> None:
    """Also those that rounding leads to from more cells: of 8 equal ones here 1, 1 and 5 remain."""
    for across in range(1, 25):
        count = cells_along(1.0, 1.0 / across, planes)
        wanted = wanted_for(1.0, count, planes)
        assert wanted is not None and cells_along(1.0, wanted, planes) == count, across


@pytest.mark.kernels
def test_a_block_ends_its_cells_where_materials_meet() -> None:
    """And each cell is of one material; without the key the border lies in the middle of cells."""
    asked = built(layers(0.013, "body.shape.borders=materials"))
    assert ends(asked, 2) == pytest.approx([0.0, 0.013, 0.023, 0.033, 0.04])
    assert (asked.octant_material == asked.octant_material[:, :1]).all()
    plain = built(layers(0.013))
    assert 0.013 not in ends(plain, 2) and not (plain.octant_material == plain.octant_material[:, :1]).all()


@pytest.mark.kernels
def test_equal_cells_that_fit_are_those_of_a_plain_block() -> None:
    """Bit for bit, on the path of boxes of one size."""
    plain, asked = built(layers(0.02)), built(layers(0.02, "body.shape.borders=materials"))
    assert asked.boxes and (asked.x_rest == plain.x_rest).all()
    assert (asked.octant_material == plain.octant_material).all()


@pytest.mark.kernels
def test_grading_and_planes_of_tools_keep_the_borders() -> None:
    asked = built(layers(0.02, "body.shape.borders=materials", "body.shape.towards=[plate]", "body.cell=0.01"))
    assert {0.02, 0.024, 0.036} <= set(ends(asked, 2))
    thin = built(layers(0.02, "body.shape.borders=materials", "body.shape.grading=4", "body.cell=0.005"))
    widths = np.diff(ends(thin, 2))
    assert 0.02 in ends(thin, 2) and widths[0] < widths[1] and widths[3] < widths[2], "thin at faces and at the border"


@pytest.mark.kernels
@pytest.mark.parametrize("border", [0.02, 0.013])
def test_a_sweep_s_cells_end_where_materials_meet(border: float) -> None:
    """All of them: also odd counts, those towards a tool's edges and graded ones. The scene's own are left as they
    are."""
    scene = layers(border)
    frame = Frame(scene, EDGES)
    asked = [c for c in configurations(frame) if c.method != "as it is"]
    assert len(asked) > 80
    for settings in {tuple(s for s in c.settings if s.startswith("body.")) for c in asked}:
        assert np.isclose(ends(built(with_settings(scene, settings)), 2), border).any(), settings


@pytest.mark.kernels
def test_a_sweep_names_the_cells_that_a_body_has() -> None:
    for border in (0.02, 0.013):
        frame = Frame(layers(border), EDGES)
        for across in (1, 2, 3, 4, 5, 6):
            counts = frame.across(across)
            assert built(with_settings(frame.scene, Fem(frame, counts, 0.01).settings)).n_cells == np.prod(counts)


def test_a_scene_s_own_cells_that_fit_no_border_give_way_to_others() -> None:
    """Three cells cannot end at half the height: those of the sweep are two and two; as it is, the scene keeps its."""
    scene = layers(0.02, "body.cell=[0.015, 0.0133333333333333, 0.0133333333333333]")
    frame = Frame(scene, EDGES)
    assert frame.own == (4, 3, 3) and frame.own_to_borders == (4, 3, 4)
    labels = {c.label for c in configurations(frame)}
    assert any("4x3x4" in label for label in labels) and not any("4x3x3" in label for label in labels)
    kept = Frame(layers(0.013), EDGES)
    assert kept.own == kept.own_to_borders == (4, 3, 4)


def test_equal_cells_are_not_asked_for_planes() -> None:
    """They fit by themselves, and one size is fast; a scene that asks keeps its own count."""
    even = Fem(Frame(layers(0.02), EDGES), (5, 3, 4), 0.01).settings
    assert not any("borders" in setting for setting in even)
    scene = layers(0.013, "body.shape.borders=materials")
    assert Frame(scene, EDGES).own == (4, 3, 4) == Frame(layers(0.013), EDGES).own
    assert spec(scene).shape == spec(with_settings(scene, Fem(Frame(scene, EDGES), (4, 3, 4), 0.01).settings)).shape
    assert not any("borders" in s for c in configurations(Frame(load_scene("tofu_grasp"), EDGES)) for s in c.settings)


def test_levels_of_a_reference_divide_the_coarsest_alike() -> None:
    """With one material, and where hardly any level would, all are taken; none are of the same cells."""
    frame = Frame(layers(0.02), EDGES)
    assert levels_of(frame) == (2, 4, 6, 8, 10, 12, 14, 16, 20, 24, 28, 32)
    assert all(np.allclose(np.array(frame.across(a)) / frame.across(2), a / 2) for a in levels_of(frame))
    assert levels_of(Frame(load_scene("tofu_grasp"), EDGES)) == ACROSS
    odd = Frame(layers(0.013), EDGES)
    cells = [odd.across(across) for across in levels_of(odd)]
    assert len(set(cells)) == len(cells) > 3
    assert [np.prod(c) for c in cells] == sorted(np.prod(c) for c in cells)


def test_levels_are_alike_only_where_every_piece_is_divided_alike() -> None:
    """At 0.3 of the height pieces have 1+1, 1+3, 2+4, 2+6, 4+8 and 5+11 cells, whose sums alone would be multiples."""
    frame = two_layers(0.012)
    assert [frame.across(across)[2] for across in (2, 4, 6, 8, 12, 16)] == [2, 4, 6, 8, 12, 16]
    assert [across for across in ACROSS if frame.refines(frame.level(across), frame.level(2))] == [2]
    assert levels_of(frame) == ACROSS
    quarter = two_layers(0.01)
    assert quarter.refines(quarter.across(8), quarter.across(4)) and not quarter.refines(
        quarter.level(8), quarter.level(2)
    ), "2+6 of 1+3, not of 1+2"


@pytest.mark.kernels
def test_check_tells_of_borders_inside_cells(tmp_path: Path) -> None:
    def told(scene: Scene) -> str:
        path = tmp_path / "scene.yaml"
        path.write_text(scene.model_dump_json(exclude_unset=True))
        console = Console(file=io.StringIO(), width=400)
        check_scene(str(path), (), console)
        assert isinstance(console.file, io.StringIO)
        return console.file.getvalue()

    cut = told(layers(0.013))
    assert "materials meet inside cells, at z 13, z 33 mm" in cut and "body.shape.borders: materials" in cut
    fits = told(layers(0.013, "body.shape.borders=materials"))
    assert "materials meet inside" not in fits and "hexahedra in the block" in fits
    assert "materials meet inside" not in told(layers(0.02))
    near = told(layers(0.0005, "body.shape.borders=materials"))
    assert "at z 0.5 mm" in near and "shorten `cell`" in near and "borders: materials" not in near


def test_a_shape_keeps_even_cells_unless_it_is_asked() -> None:
    assert BlockShape(size=SIZE).borders == "even" and not BlockShape(size=SIZE).graded
    assert BlockShape(size=SIZE, borders="materials").graded
