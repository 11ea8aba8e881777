"""Recovered stress: linear fields exactly, smooth ones at second order, also where cells are partly filled."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from softseam_protocol.messages import Frame, Header
from softseam_protocol.scene import Scene
from softseam_protocol.scene_file import parse_scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.errors import MeshError
from softseam_services.body.lattice import LOCAL, OCTANT_NODES
from softseam_services.body.recover import FEM_SAMPLE, PBD_SAMPLE, nodal_recovery
from softseam_services.orchestrator.probes import Probes

Floats = NDArray[np.float64]


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
    """Where each octant's stress is sampled, at rest (8 C, 3)."""
    octant = (LOCAL - 1.0)[OCTANT_NODES].sum(axis=1) / 4.0
    middle = body.x_rest[body.cell_nodes[:, 13]]
    at: Floats = middle[:, None, :] + 0.5 * sample[:, None, None] * octant * body.edges
    return at.reshape(-1, 3)


def _samples(body: Body) -> Floats:
    """Both kinds of cells, as at a seam (C,)."""
    return np.where(np.arange(body.n_cells) % 3 == 0, FEM_SAMPLE, PBD_SAMPLE)


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


def test_smooth_stress_converges_at_second_order() -> None:
    errors = []
    for n in (2, 4, 8):
        body = build_body(_scene(n), {})
        sample = _samples(body)
        wave = np.array([40.0, 30.0, 50.0])
        recovered = nodal_recovery(body, sample) @ np.sin(_sampled(body, sample) @ wave)
        errors.append(np.abs(recovered - np.sin(body.x_rest @ wave)).max())
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert slopes[-1] > 1.8


def _frame(body: Body, cauchy: Floats, x: Floats) -> Frame:
    none = np.zeros((0, 3))
    return Frame(
        Header(1, "s", "", 0, 0, 0, 0.0), x, cauchy, np.ones(body.n_cells, dtype=np.int8), none, none,
        np.zeros(0, dtype=np.int32), np.zeros(0, dtype=np.int32), none, none, np.zeros((0, 4)),
    )  # fmt: skip


def test_probes_report_stress_and_displacement() -> None:
    scene = _scene(2, {"inside": [0.003, -0.004, 0.012], "edge": [0.02, 0.015, 0.02]})
    body = build_body(scene, {})
    probes = Probes(body, scene.probes)
    cauchy = np.zeros((body.n_cells, 8, 6))
    cauchy[..., 0] = 5.0 * _sampled(body, np.full(body.n_cells, FEM_SAMPLE))[:, 0].reshape(-1, 8)
    found = probes.measure(_frame(body, cauchy, 1.1 * body.x_rest), "fem", "pbd")
    for name, at in scene.probes.items():
        assert_allclose(found[f"{name}.von_mises"], 5.0 * at[0], rtol=1e-8)
        assert_allclose(found[f"{name}.displacement"], 0.1 * np.linalg.norm(at), rtol=1e-10)


@pytest.mark.parametrize("at", [[0.0, 0.0, 0.03], [0.0201, 0.0, 0.01]])
def test_a_probe_outside_the_body_is_refused_by_name(at: list[float]) -> None:
    scene = _scene(2, {"tip": at})
    with pytest.raises(MeshError, match=r"probes\.tip: .*not in the body"):
        Probes(build_body(scene, {}), scene.probes)
