"""Blocks: numbering, exact masses and areas, clamping, initial velocities; regions; interpolation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.interpolate import Functions, point_weights, rest_points
from softseam_services.body.kernels.shape_functions import hex27, octant_trilinear
from softseam_services.body.lattice import LOCAL, OCTANT_NODES
from softseam_services.body.region import build_region, node_of_point, shared_nodes
from softseam_services.body.surface_check import enclosed_volume, triangle_areas

SIZE = (0.05, 0.04, 0.06)


def block(**body: object) -> Body:
    spec = {
        "shape": {"kind": "block", "size": SIZE},
        "position": [0.1, 0.2, 0.3],
        "material": {"young": 2e4, "poisson": 0.45, "density": 1050},
        **body,
    }
    return build_body(Scene.model_validate({"softseam": 1, "name": "block", "duration": 1.0, "body": spec}), {})


def node_mass(body: Body) -> np.ndarray:
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes, body.cell_mass)
    return mass


@pytest.mark.parametrize(
    ("size", "counts"),
    [
        ((1.0, 1.0, 0.02), (54, 54, 1)),
        ((0.003, 0.1, 0.1), (1, 48, 48)),
        ((0.01, 2.0, 0.01), (2, 494, 2)),
        ((0.3, 0.02, 0.02), (45, 3, 3)),
    ],
)
def test_plates_and_sticks_are_not_cut_into_tens_of_thousands_of_cells(
    size: tuple[float, float, float], counts: tuple[int, int, int]
) -> None:
    """A plate of 1 m and 20 mm had 67,500 cells, of which XPBD took 17 s a step."""
    body = block(shape={"kind": "block", "size": size})
    assert tuple(body.cell_grid.max(axis=0) + 1) == counts
    assert body.n_cells <= 3000


@pytest.mark.parametrize(("cell", "counts"), [(None, (4, 3, 4)), (0.02, (2, 2, 3)), ([0.1, 0.02, 0.011], (1, 2, 5))])
def test_cells_fill_the_block_exactly(cell: float | list[float] | None, counts: tuple[int, int, int]) -> None:
    body = block(cell=cell)
    np.testing.assert_allclose(body.edges * counts, SIZE, rtol=1e-15)
    assert body.n_cells == np.prod(counts)
    assert body.n_nodes == np.prod(2 * np.array(counts) + 1)
    np.testing.assert_allclose(body.x_rest.min(axis=0), [0.075, 0.18, 0.3], atol=1e-15)
    np.testing.assert_allclose(body.x_rest.max(axis=0), [0.125, 0.22, 0.36], atol=1e-15)
    # x runs fastest over nodes and cells, and local nodes sit at their lattice offsets
    step = np.diff(body.x_rest[:, 0])
    assert (step[: 2 * counts[0]] > 0).all()
    offset = body.x_rest[body.cell_nodes] - body.x_rest[body.cell_nodes[:, :1]]
    np.testing.assert_allclose(offset, np.broadcast_to(LOCAL * body.edges / 2, offset.shape), atol=1e-15)
    order = body.cell_grid @ [1, counts[0], counts[0] * counts[1]]
    np.testing.assert_array_equal(order, np.arange(body.n_cells))


def test_octants_hold_their_corners() -> None:
    middle = LOCAL[OCTANT_NODES].mean(axis=1)
    for o in range(8):
        np.testing.assert_array_equal(middle[o], [(o & 1) + 0.5, (o >> 1 & 1) + 0.5, (o >> 2 & 1) + 0.5])


def test_mass_centre_and_inertia_are_those_of_a_box() -> None:
    """Simpson's rule integrates quadratics exactly, so second moments are exact too."""
    body = block(cell=0.02)
    mass = node_mass(body)
    total = 1050 * np.prod(SIZE)
    assert mass.sum() == pytest.approx(total, rel=1e-14)
    centre = mass @ body.x_rest / mass.sum()
    np.testing.assert_allclose(centre, [0.1, 0.2, 0.33], rtol=1e-14)
    second = mass @ (body.x_rest - centre) ** 2
    np.testing.assert_allclose(second, total * np.array(SIZE) ** 2 / 12, rtol=1e-12)
    assert (body.cell_mass > 0).all()


def test_surface_areas_normals_and_triangles() -> None:
    body = block(cell=0.02)
    points, surface = rest_points(body), body.surface
    a, b, c = SIZE
    faces = 2 * (a * b + b * c + c * a)
    assert surface.area.sum() == pytest.approx(faces, rel=1e-14)
    vectors = triangle_areas(points, surface.triangles)
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(faces, rel=1e-13)
    np.testing.assert_allclose(vectors.sum(axis=0), 0.0, atol=1e-17)
    assert enclosed_volume(points, surface.triangles) == pytest.approx(np.prod(SIZE), rel=1e-13)
    outward = np.einsum("pi,pi->p", surface.normal, points - points.mean(axis=0))
    assert (outward > 0).all()
    np.testing.assert_allclose(np.linalg.norm(surface.normal, axis=1), 1.0, rtol=1e-14)


def test_clamps_and_initial_velocities() -> None:
    body = block(
        cell=0.02,
        fixed=[{"min": [-1, -1, 0.3], "max": [1, 1, 0.3]}],
        velocity=[1.0, 0.0, 0.0],
        spin=[0.0, 0.0, 2.0],
    )
    np.testing.assert_array_equal(body.fixed, body.x_rest[:, 2] < 0.3 + 1e-9)
    assert not body.v_initial[body.fixed].any()
    free = ~body.fixed
    r = body.x_rest[free] - [0.1, 0.2, 0.33]
    expected = np.stack([1.0 - 2.0 * r[:, 1], 2.0 * r[:, 0], np.zeros(len(r))], axis=1)
    np.testing.assert_allclose(body.v_initial[free], expected, atol=1e-14)


@pytest.mark.kernels
def test_region_masses_sum_to_the_body_and_seams_are_shared() -> None:
    body = block(cell=0.01, fixed=[{"min": [-1, -1, 0.3], "max": [1, 1, 0.3]}])
    near = np.flatnonzero(body.x_rest[body.cell_nodes[:, 13], 0] < 0.1).astype(np.int32)
    far = np.setdiff1d(np.arange(body.n_cells), near).astype(np.int32)
    seam = shared_nodes(body, near, far)
    assert not body.fixed[seam].any()
    total = np.zeros(body.n_nodes)
    seen = []
    for cells, owns in ((near, True), (far, False)):
        region = build_region(body, cells[::-1], seam, owns)  # order does not matter
        np.testing.assert_array_equal(region.nodes[region.cell_nodes], body.cell_nodes[cells])
        np.testing.assert_array_equal(region.nodes[region.seam], seam)
        indptr, node, weight = point_weights(body, region, "hex27")
        np.testing.assert_array_equal(np.diff(indptr), 1)
        np.testing.assert_array_equal(weight, 1.0)
        at = region.nodes[node]
        np.testing.assert_allclose(body.x_rest[at], rest_points(body)[region.points], atol=1e-16)
        # points on the seam belong to one side, whichever cell carries them in the body
        assert np.isin(at, seam).any() == owns
        np.testing.assert_array_equal(region.fixed, body.fixed[region.nodes])
        total[region.nodes] += region.mass
        seen.append(region.points)
    np.testing.assert_allclose(total, node_mass(body), rtol=1e-13)
    np.testing.assert_array_equal(np.sort(np.concatenate(seen)), np.arange(len(body.surface.cell)))


def test_points_on_clamped_nodes_of_both_sides_belong_to_one() -> None:
    """A clamped node is in no seam. Where its point was told of by its cell, FEM's faces beside it had none there."""
    body = block(cell=0.01, fixed=[{"min": [-1, -1, 0.2999], "max": [1, 1, 0.3001]}])
    rng = np.random.default_rng(3)
    for _ in range(20):
        near = np.flatnonzero(rng.random(body.n_cells) < 0.5).astype(np.int32)
        far = np.setdiff1d(np.arange(body.n_cells, dtype=np.int32), near).astype(np.int32)
        seam = shared_nodes(body, near, far)
        one, other = build_region(body, near, seam), build_region(body, far, seam, owns_coupling_points=False)
        np.testing.assert_array_equal(np.sort(np.concatenate([one.points, other.points])), np.arange(body.n_points))
        assert set(one.nodes) & set(node_of_point(body)) <= set(node_of_point(body)[one.points])


def test_regions_refuse_foreign_cells_and_seam_nodes() -> None:
    body = block(cell=0.02)
    with pytest.raises(ValueError, match="needs cells within"):
        build_region(body, np.array([body.n_cells], dtype=np.int32), np.zeros(0, dtype=np.int32))
    with pytest.raises(ValueError, match="seam node"):
        build_region(body, np.array([0], dtype=np.int32), np.array([body.n_nodes - 1], dtype=np.int32))


@pytest.mark.kernels
@pytest.mark.parametrize("kind", ["hex27", "hex8", "tet4", "tet10"])
def test_points_of_a_block_are_single_nodes(kind: Functions) -> None:
    body = block(cell=0.02)
    region = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
    indptr, node, weight = point_weights(body, region, kind)
    np.testing.assert_array_equal(np.diff(indptr), 1)
    np.testing.assert_array_equal(weight, 1.0)
    np.testing.assert_allclose(body.x_rest[region.nodes[node]], rest_points(body), atol=1e-16)


local = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


@pytest.mark.kernels
@settings(deadline=None, max_examples=60)
@given(local)
def test_shape_functions_reproduce_polynomials(at: tuple[float, float, float]) -> None:
    """Both reproduce linear fields; hex27 all products of quadratics as well."""
    t = np.array(at)
    nodes = LOCAL - 1.0
    value, gradient, octant = np.empty(27), np.empty((27, 3)), np.empty(27)
    hex27(t, value, gradient)
    octant_trilinear(t, octant)
    for weights in (value, octant):
        assert weights.sum() == pytest.approx(1.0, abs=1e-14)
        np.testing.assert_allclose(weights @ nodes, t, atol=1e-14)
    assert (octant >= 0).all()
    np.testing.assert_allclose(gradient.T @ nodes, np.eye(3), atol=1e-13)
    field = (nodes**2).prod(axis=1)
    assert value @ field == pytest.approx((t**2).prod(), abs=1e-13)


@pytest.mark.kernels
def test_hex27_gradients_meet_finite_differences() -> None:
    t, h = np.array([0.3, -0.6, 0.8]), 1e-6
    value, gradient = np.empty(27), np.empty((27, 3))
    hex27(t, value, gradient)
    for axis in range(3):
        upper, lower, unused = np.empty(27), np.empty(27), np.empty((27, 3))
        d = h * np.eye(3)[axis]
        hex27(t + d, upper, unused)
        hex27(t - d, lower, unused)
        np.testing.assert_allclose(gradient[:, axis], (upper - lower) / (2 * h), atol=1e-9)
