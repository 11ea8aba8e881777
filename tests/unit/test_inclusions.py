"""Inclusions: which octants they take, what a scene may say of them, and that stress is not averaged across borders."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from fem_run import block
from numpy.typing import NDArray
from solids import obj, sphere

from softseam.view.surface import DisplaySurface
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_services.body.borders import border_lines
from softseam_services.body.build import build_body
from softseam_services.body.check import check_body
from softseam_services.body.errors import MeshError
from softseam_services.body.inclusions import holds, octant_centres
from softseam_services.body.recover import FEM_SAMPLE, nodal_recovery
from softseam_services.recorder.begin import surface_mesh

Floats = NDArray[np.float64]
CORE = {"shape": {"kind": "box", "position": (0.0, 0.0, 0.025), "size": (0.025, 0.025, 0.025)}}
PARTS: list[dict[str, Any]] = [
    {"kind": "box", "position": (0.1, -0.2, 0.3), "size": (0.3, 0.5, 0.7), "rotation": (0.4, -0.3, 0.9)},
    {"kind": "sphere", "position": (0.1, -0.2, 0.3), "radius": 0.4},
    {"kind": "capsule", "position": (0.1, -0.2, 0.3), "radius": 0.25, "length": 0.5, "axis": (1.0, 2.0, -1.0)},
    {"kind": "cylinder", "position": (0.1, -0.2, 0.3), "radius": 0.3, "length": 0.6, "axis": (1.0, 2.0, -1.0)},
]
VOLUMES = {
    "box": 0.3 * 0.5 * 0.7,
    "sphere": 4.0 / 3.0 * np.pi * 0.4**3,
    "capsule": np.pi * 0.25**2 * 0.5 + 4.0 / 3.0 * np.pi * 0.25**3,
    "cylinder": np.pi * 0.3**2 * 0.6,
}


def _spec(*inclusions: dict[str, Any]) -> BodySpec:
    scene = block(body={"inclusions": inclusions})
    assert isinstance(scene.body, BodySpec)
    return scene.body


@pytest.mark.kernels
@pytest.mark.parametrize("part", PARTS, ids=lambda part: part["kind"])
def test_a_part_holds_as_many_places_as_its_volume_says(part: dict[str, Any]) -> None:
    """Centre of gravity and volume, by counting 10^6 places at random: within four standard deviations."""
    shape = _spec({"shape": part, "material": {"young": 1e5}}).inclusions[0].shape
    places = np.random.default_rng(1).uniform(-1.0, 1.5, (1_000_000, 3))
    inside = holds(shape, places)
    share = VOLUMES[part["kind"]] / 2.5**3
    assert abs(inside.mean() - share) < 4.0 * np.sqrt(share / len(places))
    spread = places[inside].std(axis=0) / np.sqrt(inside.sum())
    assert (np.abs(places[inside].mean(axis=0) - part["position"]) < 4.0 * spread).all()


@pytest.mark.kernels
def test_a_turned_box_is_turned_as_tools_are() -> None:
    """A quarter turn about z takes what was long along x along y; half of it, along the diagonal."""
    long = {"kind": "box", "position": (0.0, 0.0, 0.0), "size": (2.0, 0.2, 0.2)}
    quarter, eighth = ((0.0, 0.9, 0.0), (0.9, 0.0, 0.0)), ((0.6, 0.6, 0.0), (0.6, -0.6, 0.0))
    for angle, (inside, outside) in ((0.5 * np.pi, quarter), (0.25 * np.pi, eighth)):
        shape = _spec({"shape": {**long, "rotation": (0.0, 0.0, angle)}, "material": {"young": 1e5}})
        found = holds(shape.inclusions[0].shape, np.array([inside, outside]))
        assert found.tolist() == [True, False]


@pytest.mark.kernels
def test_later_inclusions_lie_over_earlier_ones_and_take_what_they_leave_out_from_the_body() -> None:
    layer = {"shape": {"kind": "box", "position": (0, 0, 0), "size": (1, 1, 0.05)}, "material": {"density": 900.0}}
    body = build_body(block(body={"inclusions": [layer, {**CORE, "material": {"young": 1e6}}]}), {})
    own, below, core = body.materials
    assert [each.young for each in (own, below, core)] == pytest.approx([20e3, 20e3, 1e6])
    assert [each.density for each in (own, below, core)] == [1050.0, 900.0, 1050.0]
    at = body.x_rest[body.cell_nodes[:, 13]]
    for cell in range(body.n_cells):
        low = at[cell, 2] < 0.025
        assert sorted(body.octant_material[cell].tolist()) == ([1] * 7 if low else [0] * 7) + [2]
    check = check_body(body)
    assert [part.octants for part in check.parts] == [28, 8]
    assert check.parts[1].volume == pytest.approx(0.025**3)


@pytest.mark.parametrize(
    ("inclusion", "key", "words"),
    [
        ({**CORE, "material": {}}, "material", "differs from its body"),
        ({**CORE, "material": {"ratio": 0.2}}, "material.ratio", "neo_hookean has no ratio"),
        ({**CORE, "material": {"poisson": 0.5}}, "material.poisson", "0.5"),
        ({**CORE, "material": {"kind": "linear"}}, "material.kind", "kind"),
        ({"shape": {"kind": "cone", "position": (0, 0, 0)}, "material": {"young": 1.0}}, "shape.kind", "cone"),
        ({"shape": {"kind": "sphere", "radius": 1.0}, "material": {"young": 1.0}}, "shape.position", "position"),
    ],
)
def test_a_bad_inclusion_is_refused_by_name(inclusion: dict[str, Any], key: str, words: str) -> None:
    scene = json.loads(block().model_dump_json())
    scene["body"]["inclusions"] = [inclusion]
    with pytest.raises(SceneError) as caught:
        parse_scene(json.dumps(scene), "scene")
    assert caught.value.key == f"body.inclusions.0.{key}"
    assert words in str(caught.value)


@pytest.mark.kernels
def test_an_inclusion_that_no_cell_sees_is_refused() -> None:
    """Smaller than half a cell, or beside the body."""
    for position in ((0.0, 0.0, 0.025), (1.0, 0.0, 0.0)):
        part = {"shape": {"kind": "sphere", "position": position, "radius": 0.005}, "material": {"young": 1e6}}
        with pytest.raises(MeshError, match=r"body\.inclusions\.0\.shape: the sphere .* make `cell` smaller"):
            build_body(block(body={"inclusions": [part]}), {})


@pytest.mark.kernels
def test_masses_of_an_embedded_body_follow_its_materials() -> None:
    """A ball in cells, a heavy half: mass to the accuracy of the cells, centre on the axis; all nodes have mass."""
    half = {"shape": {"kind": "box", "position": (0, 0, 1), "size": (2, 2, 1.95)}, "material": {"density": 3150.0}}
    shape = {"kind": "mesh", "path": "ball.obj"}
    scene = block(cell=0.0125, body={"shape": shape, "inclusions": [half]})
    files = {"ball.obj": obj(*sphere(0.025, 3))}
    body, plain = build_body(scene, files), build_body(block(cell=0.0125, body={"shape": shape}), files)
    assert body.total_mass == pytest.approx(2.0 * plain.total_mass, rel=1e-2)
    used = np.zeros(body.n_nodes)
    np.add.at(used, body.cell_nodes, body.cell_mass)
    assert used.min() > 0.0
    assert body.mean_density == pytest.approx(2100.0, rel=1e-2)


@pytest.mark.kernels
def test_recovered_stress_does_not_cross_a_border() -> None:
    """A stress that jumps where a material ends is recovered to the value on each side of it."""
    body = build_body(block(cell=0.0125, body={"inclusions": [{**CORE, "material": {"young": 1e6}}]}), {})
    sample = np.full(body.n_cells, FEM_SAMPLE)
    values = np.where(body.octant_material == 1, 7.0, 1.0).ravel()
    x = body.x_rest - np.array([0.0, 0.0, 0.025])
    border = np.isclose(np.abs(x).max(axis=1), 0.0125)
    assert border.sum() == 98
    for material, value in ((0, 1.0), (1, 7.0)):
        np.testing.assert_allclose((nodal_recovery(body, sample, material) @ values)[border], value, rtol=1e-9)


@pytest.mark.kernels
def test_recovery_beside_a_border_is_linear_and_does_not_overshoot() -> None:
    """Linear fields on each side to rounding; amid a core of 32 octants the mean, where a curvature would overshoot."""
    core = {"kind": "sphere", "position": (0.0, 0.0, 0.025), "radius": 0.0125}
    body = build_body(block(cell=0.0125, body={"inclusions": [{"shape": core, "material": {"young": 1e6}}]}), {})
    sample = np.full(body.n_cells, FEM_SAMPLE)
    middle = body.x_rest[body.cell_nodes[:, 13]]
    at = octant_centres(middle, 2.0 * FEM_SAMPLE * body.edges).reshape(-1, 3)
    slope = np.array([3.0, -2.0, 5.0])
    for material in (0, 1):
        matrix = nodal_recovery(body, sample, material)
        whole = np.unique(body.cell_nodes[(body.octant_material == material).sum(axis=1) > 3])
        np.testing.assert_allclose((matrix @ (at @ slope))[whole], body.x_rest[whole] @ slope, atol=1e-9)
    centre = np.argmin(np.linalg.norm(body.x_rest - np.array([0.0, 0.0, 0.025]), axis=1))
    weights = matrix[[centre]].toarray().ravel()
    np.testing.assert_allclose(weights, np.where(body.octant_material.ravel() == 1, 1.0 / 32.0, 0.0), atol=1e-12)


@pytest.mark.kernels
def test_borders_are_drawn_where_they_bend_or_end() -> None:
    """The rim of a layer, sixteen octants around; the twelve edges of a core two octants wide; no others."""
    layer = {"shape": {"kind": "box", "position": (0, 0, 0), "size": (1, 1, 0.05)}, "material": {"density": 900.0}}
    body = build_body(block(body={"inclusions": [layer]}), {})
    ends = body.x_rest[border_lines(body)]
    assert len(ends) == 16
    np.testing.assert_allclose(ends[..., 2], 0.025)
    assert np.isclose(np.abs(ends[..., :2]).max(axis=2), 0.025).all()
    body = build_body(block(body={"inclusions": [{**CORE, "material": {"young": 1e6}}]}), {})
    ends = body.x_rest[border_lines(body)] - np.array([0.0, 0.0, 0.025])
    assert len(ends) == 24
    assert (np.isclose(np.abs(ends), 0.0125).all(axis=1).sum(axis=1) == 2).all()
    assert len(border_lines(build_body(block(), {}))) == 0


@pytest.mark.kernels
def test_stress_on_the_surface_is_of_one_material() -> None:
    """What a viewer shows: no point has a mean of the two values on either side of a border."""
    layer = {"shape": {"kind": "box", "position": (0, 0, 0), "size": (1, 1, 0.05)}, "material": {"young": 1e6}}
    body = build_body(block(body={"inclusions": [layer]}), {})
    mesh = surface_mesh(Header(SCHEMA_VERSION, "local", "", 0, 0, 0, 0.0), "body", body, {})
    shown = DisplaySurface(mesh).at_points(np.where(body.octant_material == 1, 7.0, 1.0))
    z = mesh.point_rest[:, 2]
    np.testing.assert_allclose(shown[z < 0.024], 7.0)
    np.testing.assert_allclose(shown[z > 0.026], 1.0)
    assert set(np.round(shown, 9)) == {1.0, 7.0}
