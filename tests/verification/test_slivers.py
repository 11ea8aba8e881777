"""Slivers of cut cells joined to fuller octants: patch test to rounding, derivatives, who is joined to whom, a star."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest
from benchmarks.claim_case import closing, material, mesh, plates, scene
from benchmarks.claim_shapes import extent
from element_statics import Statics, lattice
from fem_run import FemRun
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from softseam_protocol.scene.kinds import ElementKind
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.filled import FILL_FLOOR
from softseam_services.body.materials import point
from softseam_services.body.slivers import root_octants
from softseam_services.fem.kernels.elements import cauchy_stress

Floats = NDArray[np.float64]
EDGE, COUNTS = 0.01, (2, 2, 1)
ENDS = (2.02, 2.4, 1.1)
"""where a box ends that begins in the lattice's corner, in octants: cells of slivers beyond two faces and an edge"""
LINE = (Polynomial([0.0, -0.5, 0.5]), Polynomial([1.0, 0.0, -1.0]), Polynomial([0.0, 0.5, 0.5]))
KINDS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("neo_hookean", {}),
    ("linear", {}),
    ("mooney_rivlin", {"ratio": 0.2}),
)


def moments(length: float) -> Floats:
    """int s^p ds from 0 to a length within [0, 1], p = 0 .. 2 (3,)."""
    reach = float(np.clip(length, 0.0, 1.0))
    return np.array([reach ** (p + 1) / (p + 1) for p in range(3)])


def box(ends: tuple[float, float, float] = ENDS, **keys: Any) -> Body:
    """Cells that a box fills, which ends within them."""
    body = lattice((COUNTS[0] * EDGE, COUNTS[1] * EDGE, COUNTS[2] * EDGE), COUNTS, **keys)
    filled = np.empty((body.n_cells, 8, 27))
    for cell, octant in np.ndindex(body.n_cells, 8):
        x, y, z = (moments(ends[i] - 2 * body.cell_grid[cell, i] - (octant >> i & 1)) for i in range(3))
        filled[cell, octant] = np.einsum("r,q,p->rqp", z, y, x).ravel()
    return dataclasses.replace(body, moments=filled, fill=np.maximum(filled[:, :, 0], FILL_FLOOR))


@cache
def case(kind: str, element: ElementKind = "hex27") -> Statics:
    return Statics(box(kind=kind, **dict(KINDS)[kind]), element)


def surface(body: Body) -> Floats:
    """int N n dA over the box's surface, of each node (N, 3) [m^2]: one dimension at a time."""
    at = np.rint((body.x_rest - body.x_rest.min(axis=0)) / (0.5 * EDGE)).astype(int)
    inside, ends = [], []
    for axis in range(3):
        volume, jump = np.zeros((2, 2 * COUNTS[axis] + 1))
        for cell in range(COUNTS[axis]):
            reach = np.clip(ENDS[axis] - 2 * cell, 0.0, 2.0) - 1.0
            for k, line in enumerate(LINE):
                volume[2 * cell + k] += 0.5 * EDGE * (line.integ()(reach) - line.integ()(-1.0))
                jump[2 * cell + k] += line(reach) - line(-1.0)
        inside.append(volume[at[:, axis]])
        ends.append(jump[at[:, axis]])
    x, y, z = inside
    return np.stack([ends[0] * y * z, x * ends[1] * z, x * y * ends[2]], axis=1)


def stretched(kind: str) -> tuple[Floats, Floats]:
    """A deformation gradient, and the first Piola-Kirchhoff stress of it."""
    gradient = np.eye(3) + 0.1 * np.array([[1.0, 0.3, 0.0], [0.0, -1.0, 0.2], [0.4, 0.0, 0.5]])
    material, stress = case(kind).body.material, np.empty((3, 3))
    point.stress(material.number, material.parameters, gradient, stress)
    return gradient, stress


@pytest.mark.parametrize("element", ["hex27", "hex27_reduced"])
@pytest.mark.parametrize("kind", [kind for kind, _ in KINDS])
def test_a_uniform_stress_is_in_balance_with_tractions_on_the_true_surface(kind: str, element: ElementKind) -> None:
    """The patch test, to rounding: 3e-3 where empty octants have the stiffness of their floor."""
    statics, (gradient, stress) = case(kind, element), stretched(kind)
    assert len(statics.model.joints.cell) > 1
    force, expected = statics.forces(statics.x_rest @ gradient.T), surface(statics.body) @ stress.T
    assert np.abs(force - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("kind", [kind for kind, _ in KINDS])
def test_every_octant_tells_a_uniform_stress(kind: str) -> None:
    statics, (gradient, stress) = case(kind), stretched(kind)
    told = np.empty((statics.body.n_cells, 8, 6))
    cauchy_stress(statics.x_rest @ gradient.T, statics.model, statics.parameters, statics.work, told)
    exact = stress if kind == "linear" else stress @ gradient.T / np.linalg.det(gradient)
    np.testing.assert_allclose(
        told, np.broadcast_to(exact[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]], told.shape), rtol=1e-9
    )


def bent(statics: Statics) -> Floats:
    rng = np.random.default_rng(0)
    turned = statics.x_rest @ (np.eye(3) + 0.1 * rng.standard_normal((3, 3)))
    return turned + 2e-4 * rng.standard_normal(turned.shape)


@pytest.mark.parametrize("kind", [kind for kind, _ in KINDS])
def test_forces_and_tangents_are_derivatives(kind: str) -> None:
    statics = case(kind)
    x, way, e = bent(statics), np.random.default_rng(1).standard_normal(statics.x_rest.shape), 1e-7
    slope = (statics.energy(x + e * way) - statics.energy(x - e * way)) / (2.0 * e)
    assert slope == pytest.approx(float((statics.forces(x) * way).sum()), rel=1e-6)
    difference = (statics.forces(x + e * way) - statics.forces(x - e * way)) / (2.0 * e)
    product = (statics.stiffness(x) @ way.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(product, difference, atol=1e-6 * np.abs(difference).max())


def test_forces_have_no_sum_and_no_moment() -> None:
    statics = case("neo_hookean")
    x = bent(statics)
    f = statics.forces(x)
    assert np.abs(f.sum(axis=0)).max() < 1e-13 * np.abs(f).sum()
    assert np.abs(np.cross(x, f).sum(axis=0)).max() < 1e-13 * np.abs(f).sum() * EDGE


def test_each_cell_tells_forces_that_sum_to_the_whole() -> None:
    """What an adjoint weighs cell by cell (`fem.adjoint`)."""
    statics = case("neo_hookean")
    f, total = statics.forces(bent(statics)), np.zeros_like(statics.x_rest)
    np.add.at(total, statics.body.cell_nodes, statics.work.fe.transpose(0, 2, 1))
    np.testing.assert_allclose(total, f, atol=1e-13 * np.abs(f).max())


def roots(body: Body) -> NDArray[np.int32]:
    return root_octants(body, np.arange(body.n_cells, dtype=np.int32))


def test_slivers_are_joined_to_their_own_cell_first_and_sliver_cells_to_one() -> None:
    found = roots(box()).reshape(4, 2, 2, 2)  # cell, z, y, x
    own = np.arange(32).reshape(4, 2, 2, 2)
    np.testing.assert_array_equal(found[0, 0], own[0, 0])
    np.testing.assert_array_equal(found[2, 0, 0], own[2, 0, 0])
    np.testing.assert_array_equal(found[0, 1], own[0, 0])  # .1 full along z
    np.testing.assert_array_equal(found[1], np.broadcast_to(own[0, 0, :, 1:], (2, 2, 2)))  # .02 along x
    np.testing.assert_array_equal(found[2, 0, 1], own[2, 0, 0])  # empty beyond .4 along y
    assert (found[3] // 8 == 2).all()


def test_slivers_are_joined_to_their_own_material() -> None:
    """The nearest octant of one is of another."""
    edge = 0.5 * EDGE
    first = {"kind": "box", "position": (0.5 * edge, 0.5 * edge, 0.5 * edge), "size": (edge, edge, edge)}
    body = box((1.1, 4.0, 2.0), inclusions=[{"shape": first, "material": {"young": 1e5, "poisson": 0.3}}])
    found, material = roots(body), body.octant_material.reshape(-1)
    assert np.flatnonzero(material).tolist() == [0]
    assert found[0, 1] == 2 and (found[0, 3:6:2] == [2, 4]).all()


def test_full_cells_and_those_without_a_root_stay_alone() -> None:
    own = np.arange(32).reshape(4, 8)
    np.testing.assert_array_equal(roots(box((4.0, 4.0, 2.0))), own)
    beyond = np.array([1, 3], dtype=np.int32)  # what is joined to cells of another part
    part = root_octants(box(), beyond)
    np.testing.assert_array_equal(part, own[:2])


def test_a_star_takes_few_factors() -> None:
    """Squeezed by .3 between plates at two arms, on cells of 12 mm; slivers alone: 2.2 a step."""
    low, high = extent("star")
    squeeze = closing(compression=0.3)
    tools = plates(low.tolist(), high.tolist(), 1)
    star = scene("star", mesh("star", 0.012, material(20e3)), tools, ["grip_force"], motion=squeeze)
    run = FemRun(star.scene, body=build_body(star.scene, star.files))
    assert len(run.solver.tables.whole.model.joints.cell) > 0
    n_steps = round(0.15 * (high[1] - low[1]) / 0.02 / star.scene.step)
    for _ in range(n_steps):
        run.step({"left": (0.0, 0.02, 0.0), "right": (0.0, -0.02, 0.0)})
    assert run.solver.factorisations < 0.5 * n_steps
