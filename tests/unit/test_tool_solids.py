"""Every kind of tool: its gap is a distance, its normal the gradient; meshes against exact distances and windings."""

from __future__ import annotations

import re

import igl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from solids import box, cylinder, join, obj, sphere

from softseam_protocol.scene.tools import BoxTool, CapsuleTool, CylinderTool, PlaneTool, SolidTool, SphereTool
from softseam_services.body.errors import MeshError
from softseam_services.shapes import SHAPES
from softseam_services.shapes.branches import BOX, CAPSULE, CYLINDER, MESH, PLANE, SPHERE
from softseam_services.shapes.mesh import FINENESS, MOST, ToolMesh, tool_mesh
from softseam_services.shapes.mesh_grid import SPACING, VALUES
from softseam_services.shapes.turns import quaternion_onto, quaternion_turning, rotate, turned
from softseam_services.tools.kernels import rotate_back, tool_gap

Floats = NDArray[np.float64]

HERE, UPRIGHT = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
SOLIDS = {
    "plane": (PLANE, np.array([0.0, 0.6, 0.8])),
    "box": (BOX, np.array([0.5, 0.3, 0.2, 0.0])),
    "sphere": (SPHERE, np.array([0.4, 0.0, 0.0])),
    "capsule": (CAPSULE, np.array([0.2, 0.4, 0.0])),
    "cylinder": (CYLINDER, np.array([0.3, 0.4, 0.0])),
}
AT = (0.0, 0.0, 0.0)
SPECS: dict[str, PlaneTool | SolidTool] = {
    "plane": PlaneTool(normal=(0.0, 0.6, 0.8)),
    "box": BoxTool(position=AT, size=(1.0, 0.6, 0.4)),
    "sphere": SphereTool(position=AT, radius=0.4),
    "capsule": CapsuleTool(position=AT, radius=0.2, length=0.8),
    "cylinder": CylinderTool(position=AT, radius=0.3, length=0.8),
}
points = st.tuples(*[st.floats(-1.2, 1.2)] * 3).map(np.array)
turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda v: quaternion_turning(np.array(v)))


def angle(lying: tuple[float, float], standing: tuple[float, float], height: float) -> tuple[Floats, NDArray[np.int64]]:
    """An L of two boxes from one corner, each as wide and as deep as it says."""
    (x, y), (u, v) = lying, standing
    profile = np.array([[0, 0], [x, 0], [x, y], [u, y], [u, v], [0, v]])
    n = len(profile)
    vertices = np.concatenate([np.column_stack([profile, np.full(n, z)]) for z in (0.0, height)])
    walls = [t for i in range(n) for t in ((i, (i + 1) % n, n + (i + 1) % n), (i, n + (i + 1) % n, n + i))]
    lid = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    ends = [(c, b, a) for a, b, c in lid] + [(a + n, b + n, c + n) for a, b, c in lid]
    return vertices, np.array([*walls, *ends])


def of(vertices: Floats, triangles: NDArray[np.int64]) -> ToolMesh:
    return ToolMesh(vertices, triangles.astype(np.int32))


def gaps(kind: int, shape: Floats, at: Floats) -> Floats:
    """Gaps and normals of many points (n, 4)."""
    return np.array([tool_gap(kind, shape, HERE, UPRIGHT, p) for p in at])


@pytest.mark.kernels
@pytest.mark.parametrize("name", SOLIDS)
@settings(deadline=None, max_examples=60)
@given(q=turns, a=points, b=points)
def test_the_gap_is_a_distance(name: str, q: Floats, a: Floats, b: Floats) -> None:
    """1-Lipschitz; its normal is a unit vector that leads back to the surface; a ball of its reach holds it."""
    kind, shape = SOLIDS[name]
    position = np.array([0.1, -0.2, 0.3])
    (gap_a, *normal), (gap_b, *_) = (tool_gap(kind, shape, position, q, p) for p in (a, b))
    assert abs(gap_a - gap_b) <= np.linalg.norm(a - b) + 1e-12
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
    assert tool_gap(kind, shape, position, q, a - gap_a * np.array(normal))[0] == pytest.approx(0.0, abs=1e-9)
    if gap_a < 0.0 or kind == PLANE:
        return
    assert gap_a >= np.linalg.norm(a - position) - SHAPES[name].build(SPECS[name], {}).reach - 1e-12


@pytest.mark.kernels
@pytest.mark.parametrize("name", SOLIDS)
def test_the_normal_is_the_gradient(name: str) -> None:
    kind, shape = SOLIDS[name]
    q, h = quaternion_turning(np.array([0.4, -0.9, 0.7])), 1e-6
    for point in np.random.default_rng(8).uniform(-1.0, 1.0, size=(40, 3)):
        _, *normal = tool_gap(kind, shape, HERE, q, point)
        gradient = [
            (tool_gap(kind, shape, HERE, q, point + h * e)[0] - tool_gap(kind, shape, HERE, q, point - h * e)[0])
            / (2 * h)
            for e in np.eye(3)
        ]
        np.testing.assert_allclose(normal, gradient, atol=1e-5)


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["capsule", "cylinder"])
def test_distances_are_to_the_nearest_point_of_the_surface(name: str) -> None:
    """Brute force over a fine outline, whose spacing bounds what it may be too large by."""
    kind, shape = SOLIDS[name]
    radius, half = shape[:2]
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    if kind == CAPSULE:
        polar = np.linspace(0.0, 0.5 * np.pi, 46)
        profile = np.concatenate(
            [np.stack([radius * np.sin(polar), half + radius * np.cos(polar)], 1), [[radius, z] for z in half * LINE]]
        )
        profile = np.concatenate([profile, profile * [1.0, -1.0]])
    else:
        flat = [[radius * r, s * half] for r in 0.5 * (LINE + 1.0) for s in (-1.0, 1.0)]
        profile = np.array([*flat, *([radius, half * z] for z in LINE)])
    surface = np.concatenate(
        [np.stack([p[0] * np.cos(turn), p[0] * np.sin(turn), 0.0 * turn + p[1]], 1) for p in profile]
    )
    for y in np.random.default_rng(3).uniform(-0.8, 0.8, size=(60, 3)):
        brute = float(np.linalg.norm(surface - y, axis=1).min())
        gap = tool_gap(kind, shape, HERE, UPRIGHT, y)[0]
        inside = np.hypot(y[0], y[1]) < radius and abs(y[2]) < half
        assert brute - 0.02 <= abs(gap) <= brute + 1e-12
        assert gap < 0.0 or not inside


LINE = np.linspace(-1.0, 1.0, 81)


@pytest.mark.kernels
def test_poses() -> None:
    """Turns compose, the later one in the world's frame; a cylinder's axis is where it is told to be."""
    about_x, about_z = np.array([0.5 * np.pi, 0.0, 0.0]), np.array([0.0, 0.0, 0.5 * np.pi])
    quarter = quaternion_turning(about_x)
    np.testing.assert_allclose(turned(about_x, quarter), quaternion_turning(2.0 * about_x), atol=1e-15)
    np.testing.assert_allclose(rotate(turned(about_z, quarter), 0.0, 1.0, 0.0), [0.0, 0.0, 1.0], atol=1e-15)
    for axis in ([0.3, -0.5, 0.2], [0.0, 0.0, -2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]):
        q = quaternion_onto(np.array(axis))
        tip = np.array(axis) / np.linalg.norm(axis)
        assert tool_gap(CYLINDER, np.array([0.1, 1.0, 0.0]), HERE, q, tip)[0] == pytest.approx(0.0, abs=1e-15)
        assert tool_gap(CYLINDER, np.array([0.1, 1.0, 0.0]), HERE, q, 2.0 * tip)[0] == pytest.approx(1.0)


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["box", "sphere", "capsule", "cylinder"])
def test_extents_are_those_of_the_points_inside(name: str) -> None:
    kind, shape = SOLIDS[name]
    q = quaternion_turning(np.array([0.4, -0.9, 0.7]))
    geometry = SHAPES[name].build(SPECS[name], {})
    np.testing.assert_array_equal(geometry.numbers, shape)
    for direction in np.random.default_rng(5).normal(size=(10, 3)):
        direction /= np.linalg.norm(direction)
        reach = geometry.reach_along(np.array(rotate_back(q, *direction)))
        grid = np.stack(np.meshgrid(*[np.linspace(-0.7, 0.7, 45)] * 3), axis=-1).reshape(-1, 3)
        inside = np.array([tool_gap(kind, shape, HERE, q, p)[0] <= 0.0 for p in grid])
        assert 0.0 <= reach - (grid[inside] @ direction).max() < 0.06


# ---- meshes --------------------------------------------------------------------------------------------------


@pytest.mark.kernels
def test_a_box_mesh_is_the_box() -> None:
    """Beside its faces to rounding; beside edges, which the grid rounds, to a fifth of a spacing."""
    half = np.array([0.02, 0.015, 0.01])
    mesh = of(*box((0.04, 0.03, 0.02), (5.0, 5.0, 5.0)))
    h = mesh.row[SPACING]
    at = np.random.default_rng(1).uniform(-0.024, 0.024, (4000, 3))
    at = at[(np.abs(at) < half + 4.0 * h).all(axis=1)]
    error = np.abs(gaps(MESH, mesh.row, at)[:, 0] - gaps(BOX, np.append(half, 0.0), at)[:, 0])
    outside = np.sort(np.abs(at) - half, axis=1)
    by_face = (outside[:, 2] > -3.0 * h) & (outside[:, 1] < np.minimum(outside[:, 2] - 4.0 * h, -3.0 * h))
    near = outside[:, 2] > -3.0 * h
    assert by_face.sum() > 100
    assert error[by_face].max() < 1e-12
    assert error[near].max() < 0.2 * h
    assert pytest.approx(0.04 / FINENESS) == h


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("size", "off"),
    [
        ((0.3, 0.3, 0.005), 2.5e-5),
        ((0.1, 0.08, 0.001), 2.5e-5),
        ((0.002, 0.06, 0.05), 1e-9),
        ((0.001, 0.001, 0.05), 1e-9),
    ],
)
def test_thin_plates_and_needles_have_a_finer_grid(size: tuple[float, float, float], off: float) -> None:
    """Their faces are where they are; on 64 spacings along the longest edge they were beside them."""
    mesh, thin = of(*box(size)), int(np.argmin(size))
    assert not mesh.notes and len(mesh.row) <= VALUES + MOST
    across = np.zeros((4001, 3))
    across[:, thin] = np.linspace(0.0, 1.5 * size[thin], 4001)
    inside = across[gaps(MESH, mesh.row, across)[:, 0] <= 0.0, thin]
    assert inside.max() == pytest.approx(0.5 * size[thin], abs=off + 4e-4 * size[thin])


@pytest.mark.parametrize("thickness", [0.0005, 0.002])
def test_a_plate_too_thin_for_any_grid_says_so(thickness: float) -> None:
    (note,) = of(*box((0.3, 0.3, thickness))).notes
    assert re.match(r"beneath (98|99|1e.02) % of its surface it is thinner than 2.9 mm", note) and "kind: box" in note


@pytest.mark.parametrize(("flange", "told"), [(2e-4, True), (4e-4, True), (2e-3, False)])
def test_a_thin_flange_of_a_thick_handle_is_told(flange: float, told: bool) -> None:
    """In the mean its walls are thick; a profile of a handle and a flange."""
    notes = of(*angle((0.06, flange), (0.02, 0.02), 0.03)).notes
    assert [note.startswith("beneath ") for note in notes] == [True] * told


@pytest.mark.kernels
@pytest.mark.parametrize(("wall", "filled"), [(2.5e-4, True), (8e-4, True), (3e-3, False)])
def test_hollow_tools_of_thin_walls_are_filled(wall: float, filled: bool) -> None:
    """The walls are thinner than the grid sees: a finger printed hollow was felt by nothing. Others stay hollow."""
    inner = 0.04 - 2.0 * wall
    vertices, triangles = join(box((0.04, 0.04, 0.04)), box((inner, inner, inner), (wall, wall, wall)))
    triangles[12:] = triangles[12:, ::-1]
    mesh = of(vertices, triangles)
    centre, beneath = gaps(MESH, mesh.row, np.array([[0.0, 0.0, 0.0], [0.02 - 0.4 * wall, 0.003, 0.001]]))[:, 0]
    assert (centre < 0.0) == filled and beneath < 0.0
    assert ["what is hollow was filled" in note for note in mesh.notes] == [True] * filled


@pytest.mark.kernels
def test_a_sphere_mesh_is_the_sphere() -> None:
    """8192 facets on a radius of 20 mm, which lie up to 19 um below it: the grid adds next to nothing to that."""
    mesh, radius = of(*sphere(0.02, 5)), 0.02
    rng = np.random.default_rng(2)
    at = rng.normal(size=(1000, 3))
    at *= (radius + rng.uniform(-0.002, 0.003, (1000, 1))) / np.linalg.norm(at, axis=1, keepdims=True)
    found, exact = gaps(MESH, mesh.row, at), gaps(SPHERE, np.array([radius, 0.0, 0.0]), at)
    assert np.abs(found[:, 0] - exact[:, 0]).max() < 22e-6
    assert np.einsum("ni,ni->n", found[:, 1:], exact[:, 1:]).min() > np.cos(np.radians(2.0))


@pytest.mark.kernels
def test_a_mesh_that_is_not_convex() -> None:
    """An L of two boxes: outside, the distance is the lesser of the two; the sign is that of the winding number."""
    mesh = of(*angle((0.03, 0.01), (0.01, 0.03), 0.02))
    h = mesh.row[SPACING]
    at = np.random.default_rng(4).uniform(-1.0, 1.0, (3000, 3)) * [0.017, 0.017, 0.012]
    found = gaps(MESH, mesh.row, at)[:, 0]
    middle = np.array([0.015, 0.015, 0.01])
    one = gaps(BOX, np.array([0.015, 0.005, 0.01, 0.0]), at + middle - [0.015, 0.005, 0.01])[:, 0]
    two = gaps(BOX, np.array([0.005, 0.015, 0.01, 0.0]), at + middle - [0.005, 0.015, 0.01])[:, 0]
    union = np.minimum(one, two)
    outside = union > 0.0
    assert np.abs(found - union)[outside].max() < 0.25 * h
    turns = igl.winding_number(mesh.vertices, mesh.triangles.astype(np.int64), at)
    clear = np.abs(found) > 0.25 * h
    np.testing.assert_array_equal((found < 0.0)[clear], (turns > 0.5)[clear])


@pytest.mark.kernels
def test_a_mesh_gap_is_smooth_and_steps_nowhere() -> None:
    """Its normal is the interpolated gradient; along any way the gap changes by hardly more than the way, also where
    the grid ends."""
    mesh = of(*cylinder(0.01, 0.03, 24, np.array([0.2, 0.4, 1.0])))
    start, end = np.array([-0.05, -0.03, -0.04]), np.array([0.04, 0.045, 0.035])
    way = start + np.linspace(0.0, 1.0, 20001)[:, None] * (end - start)
    found = gaps(MESH, mesh.row, way)
    step = np.linalg.norm(way[1] - way[0])
    assert np.abs(np.diff(found[:, 0])).max() < 1.15 * step
    np.testing.assert_allclose(np.linalg.norm(found[:, 1:], axis=1), 1.0, atol=1e-12)
    e = 1e-7
    for point in np.random.default_rng(6).uniform(-0.012, 0.012, (50, 3)):
        _, *normal = tool_gap(MESH, mesh.row, HERE, UPRIGHT, point)
        moved = [[tool_gap(MESH, mesh.row, HERE, UPRIGHT, point + s * e * a)[0] for s in (1, -1)] for a in np.eye(3)]
        gradient = np.array([(a - b) / (2 * e) for a, b in moved])
        np.testing.assert_allclose(normal, gradient / np.linalg.norm(gradient), atol=1e-4)


@pytest.mark.kernels
def test_far_from_the_grid_the_gap_is_never_too_small() -> None:
    mesh, radius = of(*sphere(0.02, 4)), 0.02
    at = np.random.default_rng(7).uniform(-0.2, 0.2, (500, 3))
    found, exact = gaps(MESH, mesh.row, at)[:, 0], gaps(SPHERE, np.array([radius, 0.0, 0.0]), at)[:, 0]
    far = exact > 0.02
    assert (found >= exact - 1e-12)[far].all()
    assert (found <= 1.06 * exact + 1e-4)[far].all()


@pytest.mark.kernels
def test_a_mesh_is_made_once_for_the_same_content() -> None:
    data = obj(*box((0.04, 0.03, 0.02)))
    first = tool_mesh("a.obj", data, 1.0, "z")
    assert tool_mesh("a.obj", bytes(bytearray(data)), 1.0, "z") is first
    assert tool_mesh("a.obj", data, 2.0, "z") is not first


CROSSING = [box((0.04, 0.03, 0.02)), box((0.04, 0.03, 0.02), (0.01, 0.01, 0.01)), box((2e-3,) * 3, (1e-3,) * 3)]
"""the least may be a cavity, so that they are not united"""


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("vertices", "triangles", "words"),
    [
        (box((0.04, 0.03, 0.02))[0], box((0.04, 0.03, 0.02))[1][1:], "3 open edges"),
        (1e5 * box((0.04, 0.03, 0.02))[0], box((0.04, 0.03, 0.02))[1], "4e+03 m long"),
        (*join(*CROSSING), "crosses itself"),
    ],
)
def test_what_is_no_solid_is_refused(vertices: Floats, triangles: NDArray[np.int64], words: str) -> None:
    with pytest.raises(MeshError, match=words.replace("+", r"\+")):
        tool_mesh("finger.obj", obj(vertices, triangles), 1.0, "z")
