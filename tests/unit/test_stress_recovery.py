"""Recovered stress: linear and quadratic fields exactly, smooth ones at third order, also in partly filled cells."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.session import Frame
from softseam_protocol.models import OCTANT_CENTRES
from softseam_protocol.scene.file import parse_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.errors import MeshError
from softseam_services.body.lattice import LOCAL, OCTANT_NODES
from softseam_services.body.recover import FEM_SAMPLE, nodal_recovery, point_recovery
from softseam_services.orchestrator.probes import Probes

Floats = NDArray[np.float64]
PBD_SAMPLE = OCTANT_CENTRES


def _scene(n: int, probes: dict[str, list[float]] | None = None) -> Scene:
    return parse_scene(
        json.dumps(
            {
                "softseam": 1,
                "name": "block",
                "duration": 0.1,
                "body": {
                    "shape": {"kind": "block", "size": [0.04, 0.03, 0.02]},
                    "cell": [0.04 / (2 * n), 0.03 / n, 0.02 / n],
                    "material": {"kind": "neo_hookean", "young": 2e4, "poisson": 0.4, "density": 1000},
                },
                "probes": probes or {},
            }
        ),
        "block",
    )


def _sampled(body: Body, sample: Floats) -> Floats:
    """Where each octant's stress is sampled, at rest (8 C, 3): in cells filled in part at octants' centres."""
    octant = (LOCAL - 1.0)[OCTANT_NODES].sum(axis=1) / 4.0
    sample = np.where((body.fill < 1.0).any(axis=1), PBD_SAMPLE, sample)
    middle = body.x_rest[body.cell_nodes[:, 13]]
    at: Floats = middle[:, None, :] + 0.5 * sample[:, None, None] * octant * body.edges
    return at.reshape(-1, 3)


def _samples(body: Body) -> Floats:
    """Both kinds of cells, as at a seam (C,)."""
    return np.where(np.arange(body.n_cells) % 3 == 0, FEM_SAMPLE, PBD_SAMPLE)


def _quadratic(x: Floats) -> Floats:
    """A field without slopes (n,) at x (n, 3)."""
    curvature = np.array([[3.0, 1.0, 0.5], [1.0, -2.0, 4.0], [0.5, 4.0, 5.0]])
    return np.asarray(np.einsum("ni,ij,nj->n", x, curvature, x))


def test_linear_stress_is_recovered_exactly_at_every_node() -> None:
    body = build_body(_scene(2), {})
    sample = _samples(body)
    slope = np.array([3.0, -2.0, 5.0])
    recovered = nodal_recovery(body, sample) @ (_sampled(body, sample) @ slope + 7.0)
    assert_allclose(recovered, body.x_rest @ slope + 7.0, rtol=1e-8)


def test_partly_filled_cells_recover_a_linear_stress_where_samples_span_space() -> None:
    """Half of the octants gone, so that a cell's are in a plane: neighbours help; alone, the mean is kept."""
    body = build_body(_scene(2), {})
    fill = body.fill.copy()
    top = body.x_rest[body.cell_nodes[:, 13], 2] > body.x_rest[:, 2].mean()
    fill[np.ix_(top, [4, 5, 6, 7])] = 0.0
    fill[np.ix_(top, [0, 1, 2, 3])] = 0.3
    body = replace(body, fill=fill)
    sample = _samples(body)
    slope = np.array([3.0, -2.0, 5.0])
    recovered = nodal_recovery(body, sample) @ (_sampled(body, sample) @ slope)
    half = np.sort(np.unique(body.x_rest[:, 2]))[2]
    below = body.x_rest[:, 2] <= half + 1e-12
    assert_allclose(recovered[below], (body.x_rest @ slope)[below], atol=1e-8)
    empty = body.x_rest[:, 2] > body.x_rest[:, 2].max() - 1e-12
    assert np.isfinite(recovered).all()
    assert np.abs(recovered[empty]).max() < 2.0 * np.abs(body.x_rest @ slope).max()


def test_quadratic_stress_is_recovered_exactly_where_two_cells_meet_along_each_axis() -> None:
    """A single cell across has two planes of samples, which do not fix a curvature: there the control is off."""
    body = build_body(_scene(2), {})
    sample = _samples(body)
    recovered = nodal_recovery(body, sample) @ _quadratic(_sampled(body, sample))
    low, high = body.x_rest.min(axis=0), body.x_rest.max(axis=0)
    between = np.abs((body.x_rest - low) / body.edges % 1.0 - 0.5) > 0.4  # on a plane between cells, or on the surface
    inner = (between & (body.x_rest > low + 1e-9) & (body.x_rest < high - 1e-9)).all(axis=1)
    assert inner.sum() == 3
    assert_allclose(recovered[inner], _quadratic(body.x_rest[inner]), atol=1e-10 * np.abs(recovered).max())
    assert np.abs(recovered - _quadratic(body.x_rest)).max() > 0.02 * np.abs(recovered).max()


def _points(body: Body, inner: bool) -> tuple[NDArray[np.int32], Floats, Floats]:
    """Cells, in them, and at rest: three points of every cell, or of those that no corner of is on the surface."""
    cells = np.arange(body.n_cells, dtype=np.int32)
    if inner:
        low, high = body.x_rest.min(axis=0) + 1e-9, body.x_rest.max(axis=0) - 1e-9
        within = ((body.x_rest > low) & (body.x_rest < high)).all(axis=1)
        cells = cells[within[body.cell_nodes].all(axis=1)]
    cell = np.repeat(cells, 3)
    local = np.tile([[0.0, 0.0, 0.0], [0.5, -0.3, 0.8], [1.0, 0.0, -1.0]], (len(cells), 1))
    return cell, local, body.x_rest[body.cell_nodes[cell, 13]] + 0.5 * local * body.edges


def test_quadratic_stress_is_recovered_exactly_all_through_cells_inside() -> None:
    """The middle of a cell sees the cells around its corners; alone, a cell fixes no curvature."""
    body = build_body(_scene(4), {})
    sample = _samples(body)
    cell, local, at = _points(body, inner=True)
    assert len(cell) == 3 * 24
    recovered = point_recovery(body, sample, 0, cell, local, at) @ _quadratic(_sampled(body, sample))
    assert_allclose(recovered, _quadratic(at), atol=1e-10 * np.abs(recovered).max())
    middle = nodal_recovery(body, sample)[body.cell_nodes[cell[::3], 13]] @ _quadratic(_sampled(body, sample))
    assert np.abs(middle - _quadratic(at[::3])).max() > 1e-3 * np.abs(middle).max(), "the control"


def test_linear_stress_is_recovered_exactly_at_every_point_of_a_material_and_at_corners_as_at_nodes() -> None:
    body = build_body(_scene(2), {})
    sample = _samples(body)
    slope = np.array([3.0, -2.0, 5.0])
    cell, local, at = _points(body, inner=False)
    recovered = point_recovery(body, sample, 0, cell, local, at) @ (_sampled(body, sample) @ slope + 7.0)
    assert_allclose(recovered, at @ slope + 7.0, rtol=1e-8)
    node = body.cell_nodes[cell, 26]
    corner = point_recovery(body, sample, 0, cell, np.ones_like(local), body.x_rest[node])
    assert_allclose(corner.toarray(), nodal_recovery(body, sample)[node].toarray(), atol=1e-12)


def test_points_of_one_material_do_not_see_another() -> None:
    body = build_body(_scene(4), {})
    lower = np.broadcast_to(np.arange(body.n_cells)[:, None] < body.n_cells // 2, (body.n_cells, 8))
    body = replace(body, octant_material=np.where(lower, 0, 1).astype(body.octant_material.dtype))
    cell, local, at = _points(body, inner=False)
    for material, mine in ((0, cell < body.n_cells // 2), (1, cell >= body.n_cells // 2)):
        matrix = point_recovery(body, _samples(body), material, cell[mine], local[mine], at[mine])
        assert_allclose(matrix @ np.where(lower, 5.0, 9.0).ravel(), 5.0 if material == 0 else 9.0, rtol=1e-10)


def test_a_single_octant_gives_its_own_stress() -> None:
    """One sample tells neither slope nor curvature: the value is taken as it is."""
    body = build_body(_scene(1), {})
    fill = np.zeros_like(body.fill)
    fill[0, 0] = 1.0
    recovered = nodal_recovery(replace(body, fill=fill), _samples(body)) @ np.arange(5.0, 5.0 + 8 * body.n_cells)
    assert_allclose(recovered[body.cell_nodes[0]], 5.0, rtol=1e-12)


def test_smooth_stress_converges_at_third_order_inside_and_second_at_the_surface() -> None:
    inside, everywhere, between = [], [], []
    for n in (2, 4, 8):
        body = build_body(_scene(n), {})
        sample = _samples(body)
        wave = np.array([40.0, 30.0, 50.0])
        recovered = nodal_recovery(body, sample) @ np.sin(_sampled(body, sample) @ wave)
        error = np.abs(recovered - np.sin(body.x_rest @ wave))
        low, high = body.x_rest.min(axis=0), body.x_rest.max(axis=0)
        corner = np.abs((body.x_rest - low) / body.edges % 1.0 - 0.5) > 0.4
        everywhere.append(error.max())
        inside.append(error[(corner & (body.x_rest > low + 1e-9) & (body.x_rest < high - 1e-9)).all(axis=1)].max())
        if n > 2:
            cell, local, at = _points(body, inner=True)
            found = point_recovery(body, sample, 0, cell, local, at) @ np.sin(_sampled(body, sample) @ wave)
            between.append(np.abs(found - np.sin(at @ wave)).max())
    assert np.log2(everywhere[1] / everywhere[2]) > 1.8
    assert np.log2(inside[1] / inside[2]) > 2.7
    assert np.log2(between[0] / between[1]) > 2.7


def _frame(body: Body, cauchy: Floats, x: Floats) -> Frame:
    none = np.zeros((0, 3))
    return Frame(
        Header(1, "s", "", 0, 0, 0, 0.0), "body", x, cauchy, np.ones(body.n_cells, dtype=np.int8), none, none,
        np.zeros(0, dtype=np.int32), np.zeros(0, dtype=np.int32), none, none, np.zeros((0, 4)),
    )  # fmt: skip


@pytest.mark.kernels
def test_probes_report_stress_and_displacement() -> None:
    scene = _scene(2, {"inside": [0.003, -0.004, 0.012], "edge": [0.02, 0.015, 0.02]})
    body = build_body(scene, {})
    probes = Probes(body, scene.probes)
    cauchy = np.zeros((body.n_cells, 8, 6))
    cauchy[..., 0] = 5.0 * _sampled(body, np.full(body.n_cells, FEM_SAMPLE))[:, 0].reshape(-1, 8)
    found = probes.measure(_frame(body, cauchy, 1.1 * body.x_rest), ("pbd", "fem"))
    for name, at in scene.probes.items():
        assert_allclose(found[f"{name}.von_mises"], 5.0 * at[0], rtol=1e-8)
        assert_allclose(found[f"{name}.displacement"], 0.1 * np.linalg.norm(at), rtol=1e-10)


@pytest.mark.kernels
def test_a_probe_beside_a_border_reports_its_own_side() -> None:
    """Stress 7 in one material and 1 in the other; half a cell from the border a mean of both would show."""
    scene = _scene(2, {"own": [0.001, 0.0, 0.007], "other": [0.001, 0.0, 0.013]})
    body = build_body(scene, {})
    above = body.x_rest[body.cell_nodes[:, 13], 2] > 0.01
    octant_material = np.repeat(above[:, None], 8, axis=1).astype(np.int32)
    body = replace(body, octant_material=octant_material, materials=body.materials * 2)
    cauchy = np.zeros((body.n_cells, 8, 6))
    cauchy[..., 0] = np.where(octant_material == 1, 7.0, 1.0)
    found = Probes(body, scene.probes).measure(_frame(body, cauchy, body.x_rest), ("pbd", "fem"))
    assert_allclose([found["own.von_mises"], found["other.von_mises"]], [1.0, 7.0], rtol=1e-8)


@pytest.mark.parametrize("at", [[0.0, 0.0, 0.03], [0.0201, 0.0, 0.01]])
def test_a_probe_outside_the_body_is_refused_by_name(at: list[float]) -> None:
    scene = _scene(2, {"tip": at})
    with pytest.raises(MeshError, match=r"probes\.tip: .*not in the body"):
        Probes(build_body(scene, {}), scene.probes)
