"""Bodies embedded in cells: exact on polyhedra, second order on curved bodies."""

from __future__ import annotations

import numpy as np
import pytest
from solids import ALONG_THE_SCENE, box, cylinder, join, obj, sphere

from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.filled import FILL_FLOOR, FULL_MOMENTS, filled_centroids
from softseam_services.body.interpolate import Functions, point_weights, rest_points
from softseam_services.body.kernels.fill import octant_moments
from softseam_services.body.lattice import LOCAL, OCTANT_NODES, SIMPSON
from softseam_services.body.mass import lump
from softseam_services.body.region import BESIDE, build_region, shared_nodes
from softseam_services.body.surface_check import enclosed_volume, triangle_areas

DENSITY = 1000.0
RADIUS, HEIGHT = 0.02, 0.05
AXIS = np.array([1.0, 0.5, 0.8])


def embedded(vertices: np.ndarray, triangles: np.ndarray, cell: float) -> Body:
    scene = {
        "softseam": 1,
        "name": "solid",
        "duration": 1.0,
        "body": {
            "shape": {"kind": "mesh", "path": "solid.obj"},
            "cell": cell,
            "fixed": ALONG_THE_SCENE,
            "material": {"young": 2e4, "poisson": 0.3, "density": DENSITY},
        },
    }
    return build_body(Scene.model_validate(scene), {"solid.obj": obj(vertices, triangles)})


def moments(body: Body) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and second moments about it, from the lumped masses."""
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes, body.cell_mass)
    centre = mass @ body.x_rest / mass.sum()
    r = body.x_rest - centre
    return mass.sum(), centre, np.einsum("n,ni,nj->ij", mass, r, r)


def slope(sizes: np.ndarray, errors: list[float]) -> float:
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def test_moments_of_a_cut_corner_are_exact() -> None:
    """x + y + z < 3 cuts octants to 1, 5/6, 1/6 or 0 of their volume; Dirichlet's integral gives their moments."""
    vertices = np.array([[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 3]], dtype=np.float64)
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.int32)
    m = octant_moments(vertices, triangles, np.array([3, 3, 3]))
    i, j, k = np.indices((3, 3, 3))
    expected = np.array([1.0, 5 / 6, 1 / 6, 0.0, 0.0, 0.0, 0.0])[i + j + k]
    np.testing.assert_allclose(m[..., 0], expected, atol=1e-14)
    np.testing.assert_allclose(m[0, 0, 0], FULL_MOMENTS, atol=1e-14)
    corner = m[1, 1, 0]  # the tetrahedron s + t + w < 1
    factorial = np.array([1, 1, 2])
    dirichlet = [
        factorial[p] * factorial[q] * factorial[r] / np.prod(np.arange(1, p + q + r + 4))
        for r in range(3)
        for q in range(3)
        for p in range(3)
    ]
    np.testing.assert_allclose(corner, dirichlet, atol=1e-15)
    parts = np.tile(FULL_MOMENTS, (1, 8, 1))
    parts[0, 0] = corner
    centroids = filled_centroids(parts)[0]
    np.testing.assert_allclose(centroids[:2], [[-0.75, -0.75, -0.75], [0.5, -0.5, -0.5]], atol=1e-13)


def test_full_cells_get_simpson_weights() -> None:
    fill, mass = lump(np.tile(FULL_MOMENTS, (1, 8, 1)), np.array([0.1, 0.2, 0.3]), 500.0)
    np.testing.assert_array_equal(fill, 1.0)
    np.testing.assert_allclose(mass[0], 500.0 * 0.006 * SIMPSON, rtol=1e-13)


@pytest.mark.parametrize("cell", [0.03, 0.012, 0.007])
@pytest.mark.parametrize("solid", ["sphere", "cylinder", "hollow"])
def test_embedding_is_exact_for_the_polyhedron(solid: str, cell: float) -> None:
    """Filled volume and mass to rounding; every mass positive; points on the true surface, in kept cells."""
    vertices, triangles = {
        "sphere": lambda: sphere(RADIUS, 3),
        "cylinder": lambda: cylinder(RADIUS, HEIGHT, 24, AXIS),
        "hollow": lambda: join(box((0.05, 0.04, 0.03)), box((0.02, 0.01, 0.01), (0.01, 0.015, 0.012))),
    }[solid]()
    body = embedded(vertices, triangles, cell)
    points = rest_points(body)
    volume = enclosed_volume(points, body.surface.triangles)
    if solid == "hollow":
        assert volume == pytest.approx(0.05 * 0.04 * 0.03 - 0.02 * 0.01 * 0.01, rel=1e-12)
    assert (
        volume == pytest.approx(abs(enclosed_volume(vertices, triangles.astype(np.int32))), rel=1e-12)
        or solid == "hollow"
    )
    filled = body.fill.sum() * body.edges.prod() / 8
    floor = FILL_FLOOR * body.fill.size * body.edges.prod() / 8
    assert -1e-12 * volume < filled - volume < floor
    assert body.cell_mass.sum() == pytest.approx(DENSITY * volume, rel=1e-13)
    assert body.cell_mass.min() > 0
    assert (body.fill >= FILL_FLOOR).all()
    assert (body.fill <= 1.0).all()
    assert np.abs(body.surface.local).max() <= 1.0
    area = np.linalg.norm(triangle_areas(points, body.surface.triangles), axis=1).sum()
    assert area == pytest.approx(
        np.linalg.norm(triangle_areas(vertices, triangles.astype(np.int32)), axis=1).sum(), rel=1e-12
    )
    assert body.surface.area.sum() == pytest.approx(area, rel=1e-12)
    longest = np.linalg.norm(np.diff(points[body.surface.triangles[:, [0, 1, 2, 0]]], axis=1), axis=2).max()
    assert longest <= body.edges.min() / 2 * (1 + 1e-12)


def test_no_node_is_lighter_than_a_fifth_of_its_octants_share() -> None:
    body = embedded(*sphere(RADIUS, 3), 0.011)
    share = np.zeros((body.n_cells, 27))
    for o in range(8):
        share[:, OCTANT_NODES[o]] += body.fill[:, o, None] / 8
    share *= DENSITY * body.edges.prod() / 8
    # The floor of empty octants is taken off the partly filled cells: up to 8 % of one that is 1 % full.
    assert (body.cell_mass >= 0.2 * 0.92 * share).all()


def test_sphere_converges_to_the_closed_forms() -> None:
    """Volume, area and inertia of an inscribed polyhedron: errors fall with the square of its edges."""
    refinements = np.arange(2, 6)
    volume_error, second_error, area_error = [], [], []
    exact = DENSITY * 4 / 3 * np.pi * RADIUS**3
    for n in refinements:
        vertices, triangles = sphere(RADIUS, int(n))
        body = embedded(vertices, triangles, 0.4 * RADIUS)
        mass, centre, second = moments(body)
        np.testing.assert_allclose(centre, [0, 0, RADIUS], atol=1e-12)  # symmetric, base at z = 0
        volume_error.append(1 - mass / exact)
        second_error.append(np.abs(second / (exact * RADIUS**2 / 5) - np.eye(3)).max())
        area_error.append(abs(1 - body.surface.area.sum() / (4 * np.pi * RADIUS**2)))
    sizes = 2.0**-refinements
    assert slope(sizes, volume_error) == pytest.approx(2.0, abs=0.1)
    assert slope(sizes, area_error) == pytest.approx(2.0, abs=0.1)
    assert volume_error[-1] < 2e-3
    assert second_error[-1] < 2.5e-2  # what lumping of partly filled cells leaves, see the next test


def test_lumping_error_falls_with_the_cells() -> None:
    """Only the blend of partly filled cells is inexact: inertia of a tilted cylinder, second order in the cell."""
    vertices, triangles = cylinder(RADIUS, HEIGHT, 96, AXIS)
    area = 0.5 * 96 * RADIUS**2 * np.sin(2 * np.pi / 96)
    mass_exact = DENSITY * area * HEIGHT
    # regular n-gon: int x^2 dA = area r^2 (2 + cos(2 pi/n)) / 12
    across = mass_exact * RADIUS**2 * (2 + np.cos(2 * np.pi / 96)) / 12
    w = AXIS / np.linalg.norm(AXIS)
    exact = across * (np.eye(3) - np.outer(w, w)) + mass_exact * HEIGHT**2 / 12 * np.outer(w, w)
    base = np.array([0, 0, -vertices[:, 2].min()])
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0)) * [1, 1, 0]
    cells = np.array([0.02, 0.014, 0.01, 0.007, 0.005])
    centre_error, second_error = [], []
    for cell in cells:
        mass, centre, second = moments(embedded(vertices, triangles, float(cell)))
        assert mass == pytest.approx(mass_exact, rel=1e-12)
        centre_error.append(float(np.linalg.norm(centre - (base - middle))) / RADIUS)
        second_error.append(float(np.linalg.norm(second - exact) / np.linalg.norm(exact)))
    assert max(centre_error) < 5e-3
    assert slope(cells, second_error) > 1.5
    assert second_error[-1] < 5e-3


@pytest.mark.parametrize("kind", ["hex27", "hex8", "tet4", "tet10"])
def test_point_weights_sum_to_one_and_reproduce_linear_fields(kind: Functions) -> None:
    body = embedded(*sphere(RADIUS, 3), 0.012)
    cells = np.arange(0, body.n_cells, 2, dtype=np.int32)
    region = build_region(body, cells, np.zeros(0, dtype=np.int32))
    indptr, node, weight = point_weights(body, region, kind)
    row = np.repeat(np.arange(len(region.points)), np.diff(indptr))
    np.testing.assert_allclose(np.bincount(row, weights=weight), 1.0, atol=1e-13)
    x = body.x_rest[region.nodes[node]]
    at = np.stack([np.bincount(row, weights=weight * x[:, c]) for c in range(3)], axis=1)
    points = rest_points(body)[region.points]
    np.testing.assert_allclose(at, points, atol=1e-15)
    # A cell's own functions reproduce quadratic fields as well; linear ones are positive and belong to one octant.
    square = np.bincount(row, weights=weight * x[:, 0] ** 2) - points[:, 0] ** 2
    if kind in ("hex27", "tet10"):
        np.testing.assert_allclose(square, 0.0, atol=1e-17)
    else:
        assert np.abs(square).max() > 1e-6
        assert weight.min() > 0
        assert np.diff(indptr).max() == (8 if kind == "hex8" else 4)


@pytest.mark.parametrize("kind", ["hex27", "hex8", "tet4", "tet10"])
def test_points_beside_a_seam_are_carried_by_the_side_that_owns_them(kind: Functions) -> None:
    """Every point once, the near side's reach BESIDE beyond its faces, and linear fields still to the last digit."""
    body = embedded(*sphere(RADIUS, 3), 0.012)
    middle = body.x_rest[body.cell_nodes[:, 13]]
    near = (middle[:, 0] > 0.0) & (middle[:, 1] > -0.005)  # an edge inside
    cells = np.flatnonzero(near).astype(np.int32), np.flatnonzero(~near).astype(np.int32)
    seam = shared_nodes(body, *cells)
    regions = [build_region(body, cells[0], seam, True), build_region(body, cells[1], seam, False)]
    np.testing.assert_array_equal(
        np.sort(np.concatenate([region.points for region in regions])), np.arange(len(body.surface.cell))
    )
    for region in regions:
        indptr, node, weight = point_weights(body, region, kind)
        row = np.repeat(np.arange(len(region.points)), np.diff(indptr))
        x = body.x_rest[region.nodes[node]]
        at = np.stack([np.bincount(row, weights=weight * x[:, c]) for c in range(3)], axis=1)
        np.testing.assert_allclose(at, rest_points(body)[region.points], atol=1e-15)
        np.testing.assert_allclose(np.bincount(row, weights=weight), 1.0, atol=1e-13)
        assert np.bincount(row, weights=np.abs(weight)).max() < (1.0 + 2.0 * BESIDE) * 1.25**3
    across = near[body.surface.cell[regions[1].points]]
    assert not across.any()  # the far side carries none of the near side's
    taken = ~near[body.surface.cell[regions[0].points]]
    beyond = np.abs(regions[0].point_local[taken]).max(axis=1)
    assert taken.any() and beyond.min() >= 1.0 and beyond.max() < 1.0 + BESIDE
    assert np.abs(regions[1].point_local).max() <= 1.0


def test_a_tip_in_an_almost_empty_cell_keeps_the_cell() -> None:
    """A ridge that rises a ten-thousandth of a cell above a plane of the grid: its points still lie in a cell."""
    profile = np.array([[0, 0], [4, 0], [4, 3], [2, 0.5], [1.5, 1.0001], [0.5, 0.5]])
    n = len(profile)
    vertices = 0.01 * np.concatenate([np.insert(profile, 1, y, axis=1) for y in (0.0, 1.0)])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    caps = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]])
    triangles = np.concatenate([caps, caps[:, ::-1] + n, np.stack([i, n + j, j], 1), np.stack([i, n + i, n + j], 1)])
    body = embedded(vertices, triangles, 0.01)
    assert (body.fill <= FILL_FLOOR).all(axis=1).sum() == 1  # the cell of the tip
    points = rest_points(body)
    assert np.abs(body.surface.local).max() <= 1.0
    assert (np.abs(points[:, None] - (vertices - [0.02, 0.005, 0])).max(axis=2).min(axis=0) < 1e-12).all()
    assert body.cell_mass.sum() == pytest.approx(DENSITY * enclosed_volume(points, body.surface.triangles), rel=1e-12)


def test_local_nodes_of_embedded_cells_are_on_the_lattice() -> None:
    body = embedded(*sphere(RADIUS, 2), 0.012)
    offset = body.x_rest[body.cell_nodes] - body.x_rest[body.cell_nodes[:, :1]]
    np.testing.assert_allclose(offset, np.broadcast_to(LOCAL * body.edges / 2, offset.shape), atol=1e-15)


def test_same_input_same_bits() -> None:
    vertices, triangles = cylinder(RADIUS, HEIGHT, 24, AXIS)
    one, two = (embedded(vertices, triangles, 0.01) for _ in range(2))
    for name in ("x_rest", "cell_nodes", "fill", "cell_mass"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    for name in ("cell", "local", "area", "normal", "triangles"):
        assert getattr(one.surface, name).tobytes() == getattr(two.surface, name).tobytes()
