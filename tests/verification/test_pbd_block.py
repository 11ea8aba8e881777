"""The block constraint itself: derivatives, invariance, patch test, exact statics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pbd_run import CLAMP_LEFT, Energy, PbdRun, block_scene, static_solution

from softseam_protocol.scene.materials import MATERIALS
from softseam_services.body.materials import point
from softseam_services.pbd.kernels.general import solve_nine
from softseam_services.pbd.kernels.sweep import batch_energies, new_workspace, strain_energy

KINDS = tuple(MATERIALS)
STATICS = [("neo_hookean", 2), *((kind, 1) for kind in KINDS)]


def _run(kind: str = "neo_hookean", hourglass: str = "physical", cell: object = (0.05, 0.04, 0.03)) -> PbdRun:
    size = (0.10, 0.04, 0.03)
    return PbdRun(block_scene(size, cell, kind=kind, poisson=0.4, pbd={"hourglass": hourglass}))  # type: ignore[arg-type]


def _rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    k = axis / np.linalg.norm(axis)
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("hourglass", ["physical", "fitted"])
@pytest.mark.parametrize("scale", [1e-5, 1e-3, 4e-3])
def test_force_is_minus_the_gradient_of_the_energy(kind: str, hourglass: str, scale: float) -> None:
    run = _run(kind, hourglass)
    energy = Energy(run)
    rng = np.random.default_rng(1)
    x = run.body.x_rest + scale * rng.standard_normal(run.body.x_rest.shape)
    direction = rng.standard_normal(x.shape)
    h = 1e-6
    slope = (energy.value(x + h * direction) - energy.value(x - h * direction)) / (2 * h)
    force = energy.force(x)
    # Central differences: h^2 error plus roundoff of the energy over h.
    np.testing.assert_allclose(-np.sum(force * direction), slope, rtol=2e-6, atol=1e-6 * np.abs(force).sum())


@pytest.mark.parametrize("kind", KINDS)
def test_hourglass_energies_are_those_of_bending_and_twist(kind: str) -> None:
    """One block of 10 x 8 x 6 mm in pure modes of amplitude q, energy over V q^2/2, E 20 kPa, nu 0.4, a = 2/l.

    Bending u_x = q xi zeta alone: E/(1 - nu^2) a_x^2/3, the plate's; with the anticlastic u_y = r q eta zeta that a
    beam takes, r a_y = -nu a_x, E a_x^2/3, the beam's; warping u_x = q eta zeta: mu/3 (a_y^2 + a_z^2); twist
    u_c = q xi eta zeta: E a_c^2/9.
    """
    run = PbdRun(block_scene((0.02, 0.016, 0.012), (0.02, 0.016, 0.012), kind=kind, poisson=0.4))
    young, nu, mu = 20e3, 0.4, run.body.material.mu
    edges = np.array([0.010, 0.008, 0.006])
    a = 2.0 / edges
    q = 1e-6
    centre = np.array([-0.005, -0.004, 0.003])
    s = (run.body.x_rest - centre) / (0.5 * edges)
    only = np.all(np.abs(s) < 1.0 + 1e-9, axis=1)
    xi, eta, zeta = s.T
    zero = np.zeros_like(xi)

    def value(u_x: NDArray[np.float64], u_y: NDArray[np.float64], u_z: NDArray[np.float64]) -> float:
        x = run.body.x_rest[only] + q * np.stack([u_x, u_y, u_z], axis=1)[only]
        return float(_single_block(run, only, x) / (0.5 * edges.prod() * q * q))

    r = -nu * a[0] / a[1]
    expected = {
        "plate": young / (1 - nu**2) * a[0] ** 2 / 3,
        "beam": young * a[0] ** 2 / 3,
        "warp": mu * (a[1] ** 2 + a[2] ** 2) / 3,
        "twist x": young * a[0] ** 2 / 9,
        "twist z": young * a[2] ** 2 / 9,
    }
    found = {
        "plate": value(xi * zeta, zero, zero),
        "beam": value(xi * zeta, r * eta * zeta, zero),
        "warp": value(eta * zeta, zero, zero),
        "twist x": value(xi * eta * zeta, zero, zero),
        "twist z": value(zero, zero, xi * eta * zeta),
    }
    for name in expected:
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-4, err_msg=name)


def _single_block(run: PbdRun, only: np.ndarray, x: np.ndarray) -> float:
    """Energy [J] of the block whose nodes are `only`, at positions x (8, 3)."""
    blocks = run.solver.model.blocks
    ids = np.flatnonzero(only)
    batch, lane = np.nonzero(np.isin(blocks.nodes, ids).all(axis=1))
    assert len(batch) == 1
    n = len(only)
    xw = np.zeros((n + 8, 4))
    xw[:n, :3] = run.body.x_rest
    numbers = run.solver.parameters.blocks
    xw[n:, :3] = numbers.padding_x
    xw[ids, :3] = x
    volume = np.zeros_like(numbers.volume)
    volume[batch[0], lane[0]] = numbers.volume[batch[0], lane[0]]
    energies = np.zeros((blocks.n_batches, 2))
    law, n_batches = numbers.law, blocks.n_batches
    batch_energies(new_workspace(), xw, blocks.nodes, volume, numbers.constants, law, 0, n_batches, energies)
    return float(strain_energy(energies)[0])


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"linear"}))
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**31), angle=st.floats(0.1, 3.0))
def test_rigid_motion_changes_neither_energy_nor_stress(kind: str, seed: int, angle: float) -> None:
    run = _run(kind)
    energy = Energy(run)
    rng = np.random.default_rng(seed)
    x = run.body.x_rest + 2e-3 * rng.standard_normal(run.body.x_rest.shape)
    turn = _rotation(rng.standard_normal(3), angle)
    moved = x @ turn.T + rng.standard_normal(3)
    force = energy.force(x)
    largest = np.abs(force).max()
    # Positions of order 1 m carry 1e-16; F divides by 5e-3, so forces are good to about 1e-12 of stiffness x size.
    np.testing.assert_allclose(energy.value(moved), energy.value(x), rtol=1e-10)
    np.testing.assert_allclose(energy.force(moved), force @ turn.T, atol=1e-9 * largest)
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())
    np.testing.assert_allclose(np.cross(x, force).sum(axis=0), 0.0, atol=1e-12 * np.abs(force).sum())


@pytest.mark.parametrize("kind", KINDS)
def test_patch_any_affine_state_is_uniform_and_balanced_inside(kind: str) -> None:
    """x = G X: every block has F = G, the stress is the material's, and interior nodes feel no force."""
    run = PbdRun(block_scene((0.06, 0.05, 0.04), (0.03, 0.025, 0.02), kind=kind))
    gradient = np.eye(3) + 0.1 * np.random.default_rng(3).standard_normal((3, 3))
    rest = run.body.x_rest
    x = rest @ gradient.T
    force = Energy(run).force(x)
    inside = np.all((rest > rest.min(axis=0) + 1e-9) & (rest < rest.max(axis=0) - 1e-9), axis=1)
    assert inside.sum() == 27
    np.testing.assert_allclose(force[inside], 0.0, atol=1e-12 * np.abs(force).max())
    material = run.body.material
    sigma = np.empty((3, 3))
    point.cauchy(material.number, material.parameters, gradient, sigma)
    cauchy = PbdRun(run.scene, x=x).fields().cauchy
    expected = sigma[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    np.testing.assert_allclose(cauchy, np.broadcast_to(expected, cauchy.shape), rtol=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_the_rest_state_is_the_fixed_point_without_loads(kind: str) -> None:
    run = PbdRun(block_scene(kind=kind))
    run.run(0.05)
    np.testing.assert_allclose(run.x, run.body.x_rest, atol=1e-13)


@pytest.mark.parametrize(("kind", "sweeps"), STATICS)
def test_statics_are_exact(kind: str, sweeps: int) -> None:
    """A clamped beam that sags by a tenth of its length ends where a dense Newton on the same energy puts it.

    The sweep is approximate, but its fixed point is f(x) + load = 0. Implicit Euler in substeps damps the first mode to
    below 1e-8 within the time simulated.
    """
    scene = block_scene(
        (0.06, 0.03, 0.03),
        0.03,
        kind=kind,
        young=20e3,
        poisson=0.4,
        gravity=(0.0, 0.0, -9.81),
        position=(0.03, 0.0, 0.0),
        fixed=CLAMP_LEFT,
        pbd={"sweeps": sweeps},
    )
    run = PbdRun(scene)
    exact = static_solution(run, run.region.mass[:, None] * run.body.gravity)
    sag = np.abs(exact - run.body.x_rest).max()
    assert sag > 5e-3
    handed = PbdRun(scene, x=exact)
    handed.run(0.1)
    np.testing.assert_allclose(handed.x, exact, atol=1e-9 * sag)
    if kind not in ("neo_hookean", "linear"):
        return  # the way there takes four times as long
    run.run(45.0)
    np.testing.assert_allclose(run.x, exact, atol=1e-8 * sag)


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"neo_hookean", "linear"}))
def test_the_local_solve_is_newtons(kind: str) -> None:
    """`solve_nine` against a dense solve of (1 + V A diag(G)) d = R, with a crushed state's definite tangent."""
    law = _run(kind).body.material
    A = np.empty((9, 9))
    F = np.eye(3) + 0.3 * np.random.default_rng(7).standard_normal((3, 3))
    point.tangent(law.number, law.parameters, F, A, True)
    G = np.array([2e-4, 1e-4, 3e-4])
    r = np.random.default_rng(8).standard_normal(9)
    expected = np.linalg.solve(np.eye(9) + 0.5 * A * np.tile(G, 3), r)
    found = r.copy()
    solve_nine(A, np.sqrt(G), 0.5, found, np.empty((9, 9)), np.empty(9))
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("kind", ["corotated", "mooney_rivlin", "st_venant_kirchhoff", "stable_neo_hookean"])
def test_kicked_at_random_every_material_only_loses_energy(kind: str) -> None:
    """Substeps by the automatic rule, no other damping than implicit Euler's."""
    scene = block_scene((0.06, 0.05, 0.05), 0.025, kind=kind, position=(0.03, 0.0, 0.0), fixed=CLAMP_LEFT)
    n_nodes = len(PbdRun(scene).body.x_rest)
    run = PbdRun(scene, v=0.3 * np.random.default_rng(3).standard_normal((n_nodes, 3)))
    energy = [reply.kinetic + reply.strain for reply in run.run(0.5)]
    assert energy[-1] < 0.2 * energy[0]
    assert max(energy) < 1.01 * energy[0]
