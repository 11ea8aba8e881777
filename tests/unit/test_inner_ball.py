"""A ball that cells follow: which one, how many cells, who asks for them, and what is refused."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from softseam.checking import check_scene
from softseam.errors import SceneRefused
from softseam.scenes import load_scene
from softseam.variants import with_settings
from softseam_protocol.inner_ball import Ball, inner_ball
from softseam_protocol.material_borders import material_borders, pieces
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.scene import Scene
from softseam_services.bodies import build_any_body
from softseam_services.body.body import Body
from softseam_services.body.borders import border_lines
from softseam_studies.study.configurations import Fem, configurations
from softseam_studies.study.frame import Frame
from softseam_studies.study.levels import levels_of

SIZE = (0.06, 0.05, 0.04)
SPHERE = {"kind": "sphere", "position": (0.0, 0.0, 0.02), "radius": 0.008}
LAYER = {"kind": "box", "position": (0.0, 0.0, 0.086), "size": (1.0, 1.0, 0.1)}
ALONE = ("regions={default: fem}", "body.shape.borders=materials")


def ball(*parts: dict[str, Any]) -> Ball | None:
    text = [{"shape": part, "material": {"young": 1e5}} for part in parts]
    body = load_scene("stiff_inclusion").body.model_dump() | {"inclusions": text}
    return inner_ball(SIZE, (0.0, 0.0, 0.0), BodySpec.model_validate(body).inclusions)


def nut(*settings: str) -> Scene:
    return with_settings(load_scene("stiff_inclusion"), settings)


def frame(*settings: str) -> Frame:
    return Frame(nut(*settings), np.full(3, 0.05))


def built(scene: Scene) -> Body:
    body = build_any_body(scene, scene.body, {})
    assert isinstance(body, Body)
    return body


def test_the_box_reaches_half_a_radius_beyond_a_ball_and_is_half_as_wide_as_the_block() -> None:
    one = ball(SPHERE)
    assert one is not None and one.centre == pytest.approx((0.03, 0.025, 0.02)) and one.reach == pytest.approx(1.5)
    assert one.planes[0] == pytest.approx((0.018, 0.042)) and one.planes[2] == pytest.approx((0.008, 0.032))
    small = ball({**SPHERE, "radius": 0.002})
    assert small is not None and small.reach == pytest.approx(5.0) and small.planes[0] == pytest.approx((0.02, 0.04))


def test_a_box_whose_faces_would_be_close_to_others_ends_there() -> None:
    """At the block's lower face, and at a layer's, which stays a plane of its own."""
    low = ball({**SPHERE, "position": (0.0, 0.0, 0.0135)})
    assert low is not None and low.planes[2] == pytest.approx((0.0255,))
    under = ball({**SPHERE, "position": (0.0, 0.0, 0.023)}, LAYER)
    assert under is not None and under.planes[2] == pytest.approx((0.011, 0.036))


@pytest.mark.parametrize(
    "parts",
    [
        (SPHERE, {**SPHERE, "position": (0.02, 0.0, 0.02)}),
        (
            SPHERE,
            {"kind": "capsule", "position": (0.02, 0.0, 0.02), "axis": (0, 0, 1), "length": 0.01, "radius": 0.003},
        ),
        (SPHERE, {"kind": "box", "position": (0.02, 0.0, 0.02), "size": (0.01,) * 3, "rotation": (0.3, 0.0, 0.0)}),
        ({**SPHERE, "position": (0.0, 0.0, 0.0085)},),
        ({**SPHERE, "position": (0.0, 0.0, 0.1)},),
        ({**SPHERE, "position": (0.0, 0.0, 0.03)}, LAYER),
        (LAYER,),
    ],
)
def test_others_are_not_followed(parts: tuple[dict[str, Any], ...]) -> None:
    """Two spheres; a sphere beside what has no planes; at a face; beside the block; cut by a layer; none."""
    assert ball(*parts) is None


@pytest.mark.kernels
@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6])
def test_cells_are_counted_as_they_are_built(count: int) -> None:
    asked = frame()
    counts = asked.across(count)
    settings = Fem(asked, counts, 0.01).settings
    body = built(nut(*settings))
    assert body.n_cells == asked.n_cells(counts) and not body.boxes
    assert Fem(asked, counts, 0.01).configuration().label == f"FEM {body.n_cells} round, 10 ms"
    assert (body.octant_material == body.octant_material[:, :1]).all()


def test_layers_grow_with_the_cells_across_and_with_the_box() -> None:
    one = ball(SPHERE)
    assert one is not None
    assert [one.layers((m, 1, m)) for m in (1, 2, 3, 4, 6)] == [(1, 1), (1, 1), (1, 2), (1, 2), (2, 3)]
    small = ball({**SPHERE, "radius": 0.002})
    assert small is not None and small.layers((2, 2, 2)) == (1, 4)
    cut = [pieces(edge, 0.01, planes) for edge, planes in zip(SIZE, one.planes, strict=True)]
    assert [one.span(line, axis) for axis, line in enumerate(cut)] == [(2, 4), (1, 3), (1, 3)]
    assert one.n_cells(cut) == 6 * 4 * 4 + 2 * 3 * 4 * 2


def test_a_ball_that_a_later_box_covers_is_not_followed() -> None:
    """One inside an earlier box is, for the later part is what is there."""
    around = {"kind": "box", "position": (0.0, 0.0, 0.02), "size": (0.03, 0.03, 0.03)}
    assert ball(SPHERE, around) is None
    assert ball(around, SPHERE) is not None
    assert ball(around, SPHERE, around) is None


def test_a_sweep_follows_the_ball_but_where_a_seam_does_not_let_it() -> None:
    """Hybrids and a few others are of equal cells; nothing of it is refused."""
    asked = configurations(frame())
    names = [c.key for c in asked]
    assert len(set(names)) == len(names) and not any(" " in name for name in names)
    for one in asked:
        scene = nut(*one.settings)
        round_cells = any("round" in part for part in one.key.split("-"))
        assert isinstance(scene.body, BodySpec)
        assert (getattr(scene.body.shape, "borders", "") == "materials") == round_cells, one.key
        assert not (round_cells and one.method in ("hybrid", "as it is"))
    assert sum("round" in c.key for c in asked if c.method == "FEM") > 20
    assert any("2x2x2" in c.key for c in asked if c.method == "FEM")


def test_levels_of_a_reference_have_three_cells_and_more_across_the_box() -> None:
    asked = frame()
    levels = levels_of(asked)
    assert [asked.across_ball(asked.across(a)) for a in levels[:4]] == [3, 4, 5, 6]
    sizes = [asked.size(asked.across(a)) for a in levels]
    assert sizes == sorted(sizes, reverse=True) and len(set(sizes)) == len(sizes)
    assert asked.size(asked.across(4)) == pytest.approx((0.05**3 / 287) ** (1.0 / 3.0))
    tiny = frame("body.inclusions.0.shape.radius=0.002")
    assert len({tiny.across_ball(tiny.across(a)) for a in levels_of(tiny)}) > 4, "a small ball's cells are refined, too"


@pytest.mark.kernels
def test_a_smooth_border_is_drawn_as_a_net() -> None:
    """Of six patches of 3 x 3 cells, two octants each way; none of its edges bends enough for a line."""
    body = built(nut(*ALONE))
    ends = body.x_rest[border_lines(body)]
    assert len(ends) == 2 * 6 * (2 * 3) ** 2
    np.testing.assert_allclose(np.linalg.norm(ends - (0.0, 0.0, 0.025), axis=2), 0.0125, rtol=1e-3)


@pytest.mark.kernels
def test_a_seam_is_refused_with_what_to_do() -> None:
    with pytest.raises(SceneRefused, match=r"body\.shape\.borders.*leave out regions\.near, or `borders`"):
        nut("body.shape.borders=materials")
    assert built(nut("body.shape.borders=materials", "body.inclusions.0.shape.radius=0.024", "probes={}")).boxes


def test_the_ball_s_box_is_no_border() -> None:
    """A sphere has no planes in which materials meet, so that nobody tells of cells that do not end there."""
    body = nut().body
    assert isinstance(body, BodySpec)
    assert material_borders((0.05, 0.05, 0.05), body.position, body.inclusions) == ((), (), ())


@pytest.mark.kernels
def test_check_tells_of_a_staircase(tmp_path: Path) -> None:
    def told(*settings: str) -> str:
        path = tmp_path / "scene.yaml"
        path.write_text(nut(*settings).model_dump_json(exclude_unset=True))
        console = Console(file=io.StringIO(), width=400)
        check_scene(str(path), (), console)
        assert isinstance(console.file, io.StringIO)
        return console.file.getvalue()

    assert "staircase" in told("regions={default: pbd}") and "leave out regions.near" not in told(ALONE[0])
    assert "leave out regions.near" in told()
    assert "staircase" not in told(*ALONE) and "sphere: " in told(*ALONE)
    near_the_ground = "body.inclusions.0.shape.position=[0, 0, 0.0131]"
    assert "no cells follow the spheres" in told(*ALONE, near_the_ground), "asked for, and not there"
