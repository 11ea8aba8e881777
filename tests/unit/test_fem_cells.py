"""Forces, tangents and energies of hex27 cells: invariants and derivatives, on full and partly filled cells."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from fem_run import block
from numpy.typing import NDArray
from test_fem_fronts import dense_of

from softseam_services.body.build import build_body
from softseam_services.body.filled import FILL_FLOOR
from softseam_services.body.materials import point
from softseam_services.body.region import build_region
from softseam_services.fem.elements.hex27_box import cell_tables
from softseam_services.fem.kernels.elements import add_cell_tangents, cauchy_stress, strain_energy, subtract_forces
from softseam_services.fem.kernels.fronts import factor
from softseam_services.fem.model import FemModel
from softseam_services.fem.parameters import FemParameters
from softseam_services.fem.structures import build_tables
from softseam_services.fem.tree import Tree
from softseam_services.fem.work import Work, build_work

pytestmark = pytest.mark.kernels

FILLS = ["full", "partial", "two materials"]
KINDS = ["neo_hookean", "linear"]


def _model(
    fill: str = "full", kind: str = "neo_hookean", counts: tuple[int, int, int] = (2, 1, 1)
) -> tuple[FemModel, FemParameters, Tree, Work]:
    everywhere = {"kind": "sphere", "position": (0.0, 0.0, 0.0), "radius": 1.0}
    other = [{"shape": everywhere, "material": {"young": 6e4, "poisson": 0.3}}]
    size = 0.01 * counts[0], 0.01 * counts[1], 0.01 * counts[2]
    body = build_body(block(size, 0.01, kind=kind, body={"inclusions": other}), {})
    rng = np.random.default_rng(1)
    shares, number = np.ones_like(body.fill), np.zeros_like(body.octant_material)
    if fill != "full":
        shares = rng.uniform(0.0, 1.0, body.fill.shape)
        shares[0, :2] = 0.0
    if fill == "two materials":
        number = rng.integers(0, 2, body.fill.shape).astype(np.int32)
    body = dataclasses.replace(body, fill=shares, octant_material=number)
    region = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
    model, parameters = build_tables(body, region)
    return model, parameters, model.tree, build_work(model, parameters, 0)


def _forces(x: NDArray[np.float64], model: FemModel, parameters: FemParameters, work: Work) -> NDArray[np.float64]:
    """f(x) per node (n, 3)."""
    r = np.zeros_like(work.r)
    subtract_forces(x, model, parameters, work, r)
    return -r.reshape(-1, 3)[model.order]


def _deformed(model: FemModel, parameters: FemParameters, size: float = 0.1, seed: int = 0) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    bent = parameters.x_rest @ (np.eye(3) + size * rng.standard_normal((3, 3)))
    return bent + 2e-4 * rng.standard_normal(bent.shape)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("fill", FILLS)
def test_rest_is_free_of_stress(fill: str, kind: str) -> None:
    model, parameters, _, work = _model(fill, kind)
    assert (
        np.abs(_forces(parameters.x_rest, model, parameters, work)).max() < 1e-14 * parameters.mu.max() * 0.01**2 * 1e3
    )
    assert (
        abs(strain_energy(parameters.x_rest, model, parameters, work))
        < 1e-14 * parameters.mu.max() * parameters.weight.sum()
    )


@pytest.mark.parametrize("fill", FILLS)
def test_forces_sum_to_zero(fill: str) -> None:
    """No net force, and no net torque about the origin."""
    model, parameters, _, work = _model(fill)
    x = _deformed(model, parameters)
    f = _forces(x, model, parameters, work)
    scale = np.abs(f).sum()
    np.testing.assert_allclose(f.sum(axis=0), 0.0, atol=1e-14 * scale)
    np.testing.assert_allclose(np.cross(x, f).sum(axis=0), 0.0, atol=1e-14 * scale)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("fill", FILLS)
def test_forces_are_the_gradient_of_the_energy(fill: str, kind: str) -> None:
    model, parameters, _, work = _model(fill, kind)
    x, way = _deformed(model, parameters), np.random.default_rng(2).standard_normal(parameters.x_rest.shape)
    e = 1e-7
    slope = (
        strain_energy(x + e * way, model, parameters, work) - strain_energy(x - e * way, model, parameters, work)
    ) / (2.0 * e)
    np.testing.assert_allclose(slope, (_forces(x, model, parameters, work) * way).sum(), rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("fill", FILLS)
def test_tangent_is_the_gradient_of_the_forces(fill: str, kind: str) -> None:
    """Central differences of f along random directions, away from rest."""
    model, parameters, tree, work = _model(fill, kind)
    x = _deformed(model, parameters)
    work.values[:] = 0.0
    add_cell_tangents(x, model, parameters, tree, work, False)
    dense = dense_of(model, tree, work)
    for seed in range(3):
        way = np.random.default_rng(seed).standard_normal(x.shape)
        e = 1e-7
        difference = (_forces(x + e * way, model, parameters, work) - _forces(x - e * way, model, parameters, work)) / (
            2.0 * e
        )
        ordered = np.zeros_like(work.r)
        ordered.reshape(-1, 3)[model.order] = way
        product = (dense @ ordered).reshape(-1, 3)[model.order]
        np.testing.assert_allclose(product, difference, atol=1e-6 * np.abs(difference).max())


@pytest.mark.parametrize("fill", FILLS)
def test_patch(fill: str) -> None:
    """A uniform deformation gives each octant its material's own stress and energy, whatever the fill."""
    model, parameters, _, work = _model(fill)
    F = np.eye(3) + 0.2 * np.random.default_rng(3).standard_normal((3, 3))
    x = parameters.x_rest @ F.T
    total = 0.0
    stress = np.empty((len(model.cell_nodes), 8, 6))
    cauchy_stress(x, model, parameters, work, stress)
    for at in np.ndindex(parameters.mu.shape):
        law = point.NEO_HOOKEAN, np.array([parameters.mu[at], parameters.lambda_[at]])
        total += parameters.weight[at] * point.energy(*law, F)
        sigma = np.empty((3, 3))
        point.cauchy(*law, F, sigma)
        if model.filled[at]:
            np.testing.assert_allclose(stress[at], sigma[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]], rtol=1e-10)
    np.testing.assert_allclose(strain_energy(x, model, parameters, work), total, rtol=1e-12)
    assert not stress[~model.filled].any()


def test_patch_of_full_cells_is_in_equilibrium_inside() -> None:
    """Under a uniform deformation only nodes of the surface carry force."""
    model, parameters, _, work = _model(counts=(2, 2, 2))
    f = _forces(parameters.x_rest @ (np.eye(3) + 0.1), model, parameters, work)
    grid = np.rint((parameters.x_rest - parameters.x_rest.min(axis=0)) / 0.005)
    inside = ((grid > 0) & (grid < 4)).all(axis=1)
    assert inside.sum() == 27
    assert np.abs(f[inside]).max() < 1e-13 * np.abs(f).max()


def test_small_strains_follow_the_linear_law() -> None:
    model, parameters, _, work = _model(kind="linear")
    F = np.eye(3) + 1e-3 * np.random.default_rng(3).standard_normal((3, 3))
    stress = np.empty((2, 8, 6))
    cauchy_stress(parameters.x_rest @ F.T, model, parameters, work, stress)
    sigma = np.empty((3, 3))
    point.stress(point.LINEAR, np.array([parameters.mu[0, 0], parameters.lambda_[0, 0]]), F, sigma)
    np.testing.assert_allclose(stress[0, 0], sigma[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]], rtol=1e-9)


@pytest.mark.parametrize("fill", FILLS)
def test_six_rigid_modes_and_no_others(fill: str) -> None:
    """At rest K has exactly six modes without energy: no hourglass modes, also where octants are empty."""
    model, parameters, tree, work = _model(fill)
    add_cell_tangents(parameters.x_rest, model, parameters, tree, work, False)
    values = np.linalg.eigvalsh(dense_of(model, tree, work))
    assert np.abs(values[:6]).max() < 1e-12 * values[-1]
    assert values[6] > (1e-3 if fill == "full" else 1e-3 * FILL_FLOOR) * values[-1]


def test_rotation_costs_nothing() -> None:
    """The neo-Hookean solid is objective: a quarter turn and a shift give no force."""
    model, parameters, _, work = _model("partial")
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = parameters.x_rest @ turn.T + np.array([3.0, -2.0, 1.0])
    # positions of 3 m carry rounding of 4e-16 m; f is that times a stiffness of mu h
    assert np.abs(_forces(moved, model, parameters, work)).max() < 1e-14 * parameters.mu.max() * 0.01 * 1e2


def test_stabilisation_is_semi_definite_and_blind_to_linear_fields() -> None:
    tables = cell_tables(np.array([0.01, 0.02, 0.015]))
    values = np.linalg.eigvalsh(tables.stabilisation)
    assert values[0] > -1e-14 * values[-1]
    field = np.random.default_rng(0).standard_normal((3, 4)) @ np.vstack(
        [np.ones(27), *np.array([(a % 3, a // 3 % 3, a // 9) for a in range(27)], dtype=float).T]
    )
    assert np.abs(field @ tables.stabilisation).max() < 1e-13 * values[-1] * np.abs(field).max()


def test_crushed_cells_have_finite_forces_and_a_safe_matrix() -> None:
    """Cells turned inside out: the energy goes on, and the safe tangent can be factored where the true one cannot."""
    model, parameters, tree, work = _model(counts=(2, 2, 1))
    x = parameters.x_rest * np.array([-0.4, 1.0, 0.3]) + 1e-3 * np.random.default_rng(0).standard_normal(
        parameters.x_rest.shape
    )
    assert np.isfinite(_forces(x, model, parameters, work)).all()
    add_cell_tangents(x, model, parameters, tree, work, False)
    true_values = np.linalg.eigvalsh(dense_of(model, tree, work))
    assert true_values[0] < -1e-3 * true_values[-1]
    work.values[:] = 0.0
    add_cell_tangents(x, model, parameters, tree, work, True)
    values = np.linalg.eigvalsh(dense_of(model, tree, work))
    assert values[0] > -1e-12 * values[-1]
    work.values[:] = 0.0
    add_cell_tangents(x, model, parameters, tree, work, True)
    for front in range(len(tree.meta)):
        _, n_own, n_all, _, offset = tree.meta[front, :5]
        work.values[offset + np.arange(3 * n_own) * (3 * n_all + 1)] += 1e-6 * values[-1]
    assert factor(tree, work.values, work.factoring) == 0


def test_masses_are_those_of_the_block() -> None:
    _, parameters, _, _ = _model(counts=(2, 1, 1))
    np.testing.assert_allclose(parameters.mass.sum(), 1050.0 * 0.02 * 0.01 * 0.01, rtol=1e-13)
    assert (parameters.mass > 0.0).all()
