"""What replays and pictures draw: surface, stress, tools, pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import solids
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from squeeze import Squeeze

from softseam.observation import von_mises
from softseam.view import colors
from softseam.view.colors import engineering, round_up, stress_colors
from softseam.view.raster import Camera, Canvas
from softseam.view.surface import DisplaySurface
from softseam.view.tool_shapes import rotate, tool_shapes
from softseam_protocol.messages.recording import ToolSurface
from softseam_protocol.scene.scene import Scene


@pytest.fixture(scope="module")
def run() -> Squeeze:
    return Squeeze(3)


@pytest.fixture(scope="module")
def surface(run: Squeeze) -> DisplaySurface:
    return DisplaySurface(run.begin.surfaces["body"])


@pytest.mark.kernels
def test_a_cube_has_sharp_edges(run: Squeeze, surface: DisplaySurface) -> None:
    """Inside a face one vertex a point, on an edge two, in a corner three; all normals are straight."""
    per_point = np.bincount(surface.vertex_point)
    on_sides = (np.abs(np.abs(run.begin.surfaces["body"].point_rest - [0, 0, 0.025]) - 0.025) < 1e-9).sum(axis=1)
    assert_allclose(per_point, on_sides)
    normals = surface.normals(surface.vertices(run.begin.surfaces["body"].point_rest))
    assert_allclose(np.abs(normals).max(axis=1), 1.0, atol=1e-12)
    outward = run.begin.surfaces["body"].point_rest[surface.vertex_point] - [0, 0, 0.025]
    assert (np.einsum("ij,ij->i", normals, outward) > 0.0).all()


@pytest.mark.kernels
def test_a_smooth_surface_is_not_split() -> None:
    """An octahedron subdivided into a sphere keeps one vertex a point."""
    ball = tool_shapes(Squeeze(1).scene, 0.05, {})[3]
    points, inverse = np.unique(ball.vertices.round(12), axis=0, return_inverse=True)
    triangles = inverse.reshape(-1)[ball.triangles]
    proper = (np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)
    mesh = Squeeze(1).begin.surfaces["body"]
    sphere = DisplaySurface(replace(mesh, point_rest=points, triangles=triangles[proper].astype(np.int32)))
    assert len(sphere.vertex_point) == len(points)


@pytest.mark.kernels
def test_stress_on_the_surface_is_exact_for_a_constant_and_bounded_for_any(
    run: Squeeze, surface: DisplaySurface
) -> None:
    assert_allclose(surface.at_points(np.full((run.body.n_cells, 8), 3.25)), 3.25, rtol=1e-12)
    values = np.random.default_rng(1).uniform(1.0, 2.0, (run.body.n_cells, 8))
    seen = surface.at_points(values)
    assert seen.min() >= values.min() and seen.max() <= values.max()


@pytest.mark.kernels
def test_stress_on_the_surface_follows_a_linear_field_along_it(run: Squeeze, surface: DisplaySurface) -> None:
    """A field linear in y is met at points away from the edges that bound y."""
    octant = np.array([[o & 1, o >> 1 & 1, o >> 2 & 1] for o in range(8)]) - 0.5
    centres = run.begin.surfaces["body"].cell_center[:, None, :] + 0.5 * octant * run.begin.surfaces["body"].edges
    points = run.begin.surfaces["body"].point_rest
    inner = np.abs(points[:, 1]) < 0.02
    assert_allclose(surface.at_points(centres[..., 1])[inner], points[inner, 1], atol=1e-12)


@pytest.mark.kernels
def test_empty_octants_do_not_count(run: Squeeze) -> None:
    mesh = run.begin.surfaces["body"]
    fill = mesh.fill.copy()
    fill[:, 4:] = 0.0
    surface = DisplaySurface(replace(mesh, fill=fill))
    values = np.where(fill > 0.0, 1.0, 1e9)
    top = surface.at_points(values).max()
    assert top <= 1.0 + 1e-12


@pytest.mark.kernels
def test_triangles_belong_to_the_region_of_their_cell(run: Squeeze, surface: DisplaySurface) -> None:
    near = surface.near(run.near.astype(np.int8))
    middle = run.begin.surfaces["body"].point_rest[run.begin.surfaces["body"].triangles].mean(axis=1)
    assert_allclose(near, np.abs(middle[:, 0]) > 0.0125)


@pytest.mark.kernels
def test_cell_lines_lie_on_the_grid(run: Squeeze, surface: DisplaySurface) -> None:
    """Each of the 6 faces has 5 lines each way, of 8 pieces; those on the cube's 12 edges are shared by two faces."""
    assert len(surface.cell_lines) == 6 * 10 * 8 - 12 * 8


@pytest.mark.parametrize(
    ("stress", "expected"),
    [
        ([5.0, 0, 0, 0, 0, 0], 5.0),
        ([2.0, 2.0, 2.0, 0, 0, 0], 0.0),
        ([0, 0, 0, 0, 0, 3.0], 3.0 * np.sqrt(3.0)),
        ([0, 0, 0, 4.0, 0, 0], 4.0 * np.sqrt(3.0)),
    ],
)
def test_von_mises(stress: list[float], expected: float) -> None:
    """Tension gives its stress, pressure nothing, shear sqrt(3) times its stress."""
    assert_allclose(von_mises(np.array(stress)), expected, atol=1e-12)


@pytest.mark.kernels
def test_tools_are_closed_and_face_outwards(run: Squeeze) -> None:
    """The divergence theorem: the volume of a box and (to the mesh) of a ball; a plane looks along its normal."""
    ground, left, _, ball = tool_shapes(run.scene, 0.05, {})
    for tool, volume, tolerance in ((left, 0.01 * 0.06 * 0.06, 1e-12), (ball, 4 / 3 * np.pi * 0.008**3, 0.01)):
        a, b, c = (tool.vertices[tool.triangles[:, i]] for i in range(3))
        assert_allclose(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0, volume, rtol=max(tolerance, 1e-12))
    a, b, c = ground.vertices[ground.triangles[0]]
    assert np.cross(b - a, c - a)[2] > 0.0


@pytest.mark.kernels
def test_long_tools_and_meshes_are_closed_and_face_outwards(run: Squeeze) -> None:
    """Volumes of a capsule, a cylinder and a mesh; normals and lines lie on the surface."""
    r, length = 0.01, 0.03
    vertices, triangles = solids.box((0.02, 0.03, 0.04))
    tools = {
        "capsule": {"kind": "capsule", "radius": r, "length": length, "position": [0, 0, 1]},
        "cylinder": {"kind": "cylinder", "radius": r, "length": length, "position": [0, 0, 1]},
        "mesh": {"kind": "mesh", "path": "a.obj", "position": [0, 0, 1]},
    }
    scene = Scene.model_validate({**run.scene.model_dump(), "tools": tools, "motion": (), "duration": 1.0})
    meshes = {"mesh": ToolSurface(vertices, triangles.astype(np.int32))}
    capsule, cylinder, mesh = tool_shapes(scene, 0.05, meshes)
    disc = np.pi * r * r
    for tool, volume, tolerance in (
        (capsule, disc * length + 4 / 3 * np.pi * r**3, 0.012),
        (cylinder, disc * length, 0.01),
        (mesh, 0.02 * 0.03 * 0.04, 1e-12),
    ):
        a, b, c = (tool.vertices[tool.triangles[:, i]] for i in range(3))
        assert_allclose(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0, volume, rtol=tolerance)
        facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), tool.normals[tool.triangles[:, 0]])
        assert (facing > -1e-12 * r * r).all()
    assert len(mesh.lines) == 12
    for tool, reach in ((capsule, 0.5 * length + r), (cylinder, 0.5 * length)):
        assert np.abs(tool.lines[..., 2]).max() == pytest.approx(reach)
        assert np.hypot(tool.lines[..., 0], tool.lines[..., 1]).max() == pytest.approx(r)
    assert len(tool_shapes(scene, 0.05, {})[2].vertices) == 0


def test_rotation_by_a_quaternion() -> None:
    """A quarter turn about z takes x to y."""
    quarter = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    assert_allclose(rotate(quarter, np.eye(3)), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15)


@settings(deadline=None)
@given(st.floats(1e-9, 1e9))
def test_a_scale_ends_at_a_round_figure_just_above(value: float) -> None:
    top = round_up(value)
    assert value * (1 - 1e-9) <= top <= 2.0 * value * (1 + 1e-9)
    assert stress_colors(np.array([0.0, top, 2.0 * top]), top).tolist()[1:] == [[253, 231, 37]] * 2


def test_lightness_of_the_scale_rises_steadily() -> None:
    """Perceptual: luma never falls from unstressed to most stressed."""
    ramp = stress_colors(np.linspace(0, 1, 200), 1.0) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(ramp) > -1.0).all() and ramp[-1] - ramp[0] > 120.0


def test_figures_get_the_prefix_that_suits_them() -> None:
    assert [engineering(v, u) for v, u in ((4500.0, "Pa"), (2e-8, "m"), (13.1, "N"), (0.0, "m"))] == [
        "4.5 kPa",
        "20 nm",
        "13.1 N",
        "0 m",
    ]


def square(depth: float, half: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A square in the plane y = depth that faces the eye at negative y."""
    corners = np.array([[-half, depth, -half], [half, depth, -half], [half, depth, half], [-half, depth, half]])
    return corners, np.tile([0.0, -1.0, 0.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]])


def test_the_nearer_triangle_is_seen_whatever_the_order() -> None:
    camera = Camera(np.array([0.0, -10.0, 0.0]), np.zeros(3), fov=20.0)
    pictures = []
    for order in ((0, 1), (1, 0)):
        canvas = Canvas(40, 40, camera)
        for which in order:
            paint = np.zeros((2, 3, 3))
            paint[..., which] = 1.0
            canvas.mesh(*square(float(which), half=0.5 + which), paint)
        pictures.append(canvas.image())
    assert np.array_equal(pictures[0], pictures[1])
    assert pictures[0][20, 20, 0] > 100 and pictures[0][20, 20, 1] == 0, "red is nearer"
    assert pictures[0][20, 7, 1] > 100 and pictures[0][20, 7, 0] == 0, "green is behind and larger"


def test_faces_that_look_away_are_not_drawn() -> None:
    canvas = Canvas(20, 20, Camera(np.array([0.0, 10.0, 0.0]), np.zeros(3)))
    canvas.mesh(*square(0.0), np.zeros((2, 3, 3)))
    assert (canvas.image() == 255).all()


def test_a_fitted_camera_fills_the_picture() -> None:
    corners = np.array([[x, y, z] for x in (0.0, 3.0) for y in (1.0, 2.0) for z in (-1.0, 1.0)])
    camera = Camera(np.array([9.0, -20.0, 8.0]), np.zeros(3)).fitted(corners, 300, 200, fill=0.9)
    at = camera.project(corners, 300, 200)[:, :2]
    part = np.ptp(at, axis=0) / [300, 200]
    assert_allclose(part.max(), 0.9, rtol=0.02)
    assert_allclose(0.5 * (at.min(axis=0) + at.max(axis=0)), [150, 100], atol=3.0)


def test_one_region_has_the_name_and_colour_of_its_model() -> None:
    """Whatever the region is called: FEM is coral and PBD is blue, alone as beside each other."""
    assert colors.parts({"body.far": "fem"}) == {"body.far": ("FEM", colors.NEAR)}
    assert colors.parts({"body.near": "fem"}) == {"body.near": ("FEM", colors.NEAR)}
    assert colors.parts({"body.far": "pbd"}) == {"body.far": ("PBD", colors.FAR)}
    both = {"body.near": ("near part: FEM", colors.NEAR), "body.far": ("far part: PBD", colors.FAR)}
    assert colors.parts({"body.far": "pbd", "body.near": "fem"}) == both
