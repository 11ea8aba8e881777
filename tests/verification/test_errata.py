"""What docs/errata.md says is wrong in the textbook chapter: its formula gives the wrong number, the mended one not."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PAGE = Path(__file__).parents[2] / "docs" / "errata.md"
I3 = np.eye(3)


def slope(function: Any, at: Floats, step: float = 1e-6) -> Floats:
    """Gradient by central differences, of the shape of `at`."""
    found = np.zeros_like(at)
    for place in np.ndindex(at.shape):
        way = np.zeros_like(at)
        way[place] = step
        found[place] = (function(at + way) - function(at - way)) / (2.0 * step)
    return found


# ---- 9.2 and 9.3: steps and sweeps


def test_implicit_euler_lacks_the_damping_of_where_it_is() -> None:
    """M (v - v_n)/dt + C v + K u = F with v = (u - u_n)/dt. With K = F = v_n = 0 what rests at 1 stays there."""
    m, c, dt, u = 2.0, 3.0, 0.1, 1.0
    chapter = m * u / (m + dt * c)
    mended = (m * u + dt * c * u) / (m + dt * c)
    assert chapter < 0.9 and mended == 1.0


def test_forward_euler_grows_at_every_step_size() -> None:
    """|1 + i w h| > 1; symplectic Euler, which moves by the new velocity, does not grow below w h = 2."""
    for h in (1e-3, 1e-2, 0.1):
        forward, symplectic = np.array([[1.0, h], [-h, 1.0]]), np.array([[1.0 - h * h, h], [-h, 1.0]])
        assert np.abs(np.linalg.eigvals(forward)).max() > 1.0 + 0.4 * h * h
        assert np.abs(np.linalg.eigvals(symplectic)).max() == pytest.approx(1.0, abs=1e-12)


def test_implicit_steps_are_stable_at_any_length() -> None:
    """Not FEM depends on the step, an explicit integrator does: implicit Euler shrinks an oscillation at w h = 1e3."""
    h = 1e3
    once = np.linalg.inv(np.array([[1.0, -h], [h, 1.0]]))
    assert np.abs(np.linalg.eigvals(once)).max() < 1.0


def test_projections_side_by_side_are_not_unconditionally_stable() -> None:
    """Ten springs that hold one point, each put right by itself: the sum overshoots, more in each sweep."""
    ends = np.array([[np.cos(a), np.sin(a)] for a in 2.0 * np.pi * np.arange(10) / 10.0])

    def swept(share: float) -> float:
        x = np.array([0.1, 0.0])
        for _ in range(20):
            away = x - ends
            length = np.linalg.norm(away, axis=1)
            x = x - share * ((length - 1.0) / length) @ away
        return float(np.linalg.norm(x))

    assert swept(1.0) > 0.3
    assert swept(0.1) < 1e-6


def test_one_minus_omega_is_of_one_constraint_alone() -> None:
    """Two springs in a row, each solved exactly (omega = 1): e is not 0 after a sweep."""
    x = np.array([0.0, 1.5, 2.0])
    for i in (0, 1):
        miss = x[i + 1] - x[i] - 1.0
        x[i], x[i + 1] = x[i] + 0.5 * miss, x[i + 1] - 0.5 * miss
    assert abs(x[1] - x[0] - 1.0) > 0.1


def test_the_best_omega_wants_the_spectral_radius_of_jacobi() -> None:
    """2/(1 + sqrt(1 - rho^2)) on a chain; with the radius of the Gauss-Seidel sweep it converges more slowly."""
    n = 20
    a = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    lower, d, upper = np.tril(a, -1), np.diag(np.diag(a)), np.triu(a, 1)

    def radius(matrix: NDArray[np.floating]) -> float:
        return float(np.abs(np.linalg.eigvals(matrix)).max())

    def sor(omega: float) -> float:
        return radius(np.linalg.solve(d + omega * lower, (1.0 - omega) * d - omega * upper))

    of_jacobi = radius(-np.linalg.solve(d, lower + upper))
    of_sweep = sor(1.0)
    right, wrong = (2.0 / (1.0 + np.sqrt(1.0 - rho**2)) for rho in (of_jacobi, of_sweep))
    assert sor(right) < 0.8 and sor(right) == pytest.approx(right - 1.0, abs=1e-4)
    assert np.log(sor(wrong)) / np.log(sor(right)) < 0.95
    assert min(sor(omega) for omega in np.linspace(1.0, 1.95, 96)) > sor(right) - 2e-2


def test_arccos_tells_a_flat_hinge_no_direction() -> None:
    """d/dz of the angle as a wing of unit length is lifted: 1; arccos has |z|, whose slope there is 0 or none."""

    def normals(z: float) -> tuple[Floats, Floats]:
        edge, left, right = np.array([0.0, 1.0, 0.0]), np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, z])
        one, other = np.cross(edge, left), np.cross(right, edge)
        return one / np.linalg.norm(one), other / np.linalg.norm(other)

    def chapter(z: float) -> float:
        one, other = normals(z)
        return float(np.arccos(np.clip(one @ other, -1.0, 1.0)))

    def mended(z: float) -> float:
        one, other = normals(z)
        return float(np.arctan2(np.cross(other, one)[1], one @ other))

    h = 1e-4
    assert (chapter(h) - chapter(-h)) / (2.0 * h) == pytest.approx(0.0, abs=1e-6)
    assert abs((mended(h) - mended(-h)) / (2.0 * h)) == pytest.approx(1.0, abs=1e-6)


# ---- 9.4: compliances and energy


def test_the_compliance_of_a_volume() -> None:
    """C^2/(2 alpha) is the energy K/2 (V/V_0 - 1)^2 V_0: alpha = V_0/K of C = V - V_0, and 1/(K V_0) of V/V_0 - 1."""
    bulk, rest, now = 5e4, 8e-6, 8.4e-6
    energy = 0.5 * bulk * (now / rest - 1.0) ** 2 * rest
    assert 0.5 * (now - rest) ** 2 * (bulk * rest) < 1e-6 * energy
    assert 0.5 * (now - rest) ** 2 / (rest / bulk) == pytest.approx(energy)
    assert 0.5 * (now / rest - 1.0) ** 2 * (bulk * rest) == pytest.approx(energy)


def test_the_compliance_of_a_shear() -> None:
    """Of the shear strain g: G/2 g^2 V, so alpha = 1/(G V); with an area in place of the volume it is no energy."""
    modulus, edge, strain = 2e4, 0.02, 0.05
    energy = 0.5 * modulus * strain**2 * edge**3
    assert 0.5 * strain**2 * (modulus * edge**2) > 40.0 * energy
    assert 0.5 * strain**2 * (modulus * edge**3) == pytest.approx(energy)


def test_symplectic_steps_conserve_a_shadow_of_the_energy() -> None:
    """Of q'' = -q by 9.4.5 with h = 0.5: p^2 + q^2 goes up and down by 6 %, p^2 + (1 - h^2/4) q^2 stays."""
    h, p, q = 0.5, 0.0, 1.0
    energy, shadow = [], []
    for _ in range(200):
        half = p - 0.5 * h * q
        q += h * half
        p = half - 0.5 * h * q
        energy.append(p * p + q * q)
        shadow.append(p * p + (1.0 - 0.25 * h * h) * q * q)
    assert np.ptp(energy) > 0.05
    assert np.ptp(shadow) < 1e-12


# ---- 9.5: materials


def _mooney(f: Floats, isochoric: bool) -> float:
    c1, c2, bulk = 3e3, 2e3, 1e5
    j, right = np.linalg.det(f), f.T @ f
    i1, i2 = np.trace(right), 0.5 * (np.trace(right) ** 2 - np.trace(right @ right))
    if isochoric:
        i1, i2 = i1 * j ** (-2.0 / 3.0), i2 * j ** (-4.0 / 3.0)
    return float(c1 * (i1 - 3.0) + c2 * (i2 - 3.0) + 0.5 * bulk * (j - 1.0) ** 2)


def test_mooney_rivlin_is_not_free_of_stress_at_rest() -> None:
    """P(I) = (2 C_1 + 4 C_2) I; with the invariants of F/J^(1/3) it is 0."""
    np.testing.assert_allclose(
        slope(lambda f: _mooney(f, False), I3), (2.0 * 3e3 + 4.0 * 2e3) * I3, rtol=1e-6, atol=1.0
    )
    np.testing.assert_allclose(slope(lambda f: _mooney(f, True), I3), 0.0 * I3, atol=1e-2)


def test_the_transversely_isotropic_matrix_lacks_its_denominators() -> None:
    """With one E and nu along and across it must be 9.2.4's: the inverse of the compliance matrix is."""
    e, nu = 2e4, 0.3
    isotropic = e / ((1.0 + nu) * (1.0 - 2.0 * nu)) * ((1.0 - 2.0 * nu) * I3 + nu * np.ones((3, 3)))
    chapter = nu * e * np.ones((3, 3)) + (1.0 - nu) * e * I3
    compliance = ((1.0 + nu) * I3 - nu * np.ones((3, 3))) / e
    assert abs(chapter[0, 0] / isotropic[0, 0] - 1.0) > 0.2
    np.testing.assert_allclose(np.linalg.inv(compliance), isotropic, rtol=1e-12)


def test_the_standard_linear_solid_is_drawn_as_another_model() -> None:
    """Strain put on at once: the equation begins with E_1 + E_2 and relaxes to E_1; the drawing, a spring k_1 in a row
    with spring and damper side by side, begins with k_1 and relaxes to k_1 k_2/(k_1 + k_2)."""
    one = two = eta = 1.0
    dt, n = 1e-3, 20_000
    stress, inner = one + two, 0.0  # of the equation just after the jump; strain of the drawing's second part
    begins = one
    for _ in range(n):
        stress += dt * (one - stress) * two / eta
        inner += dt * (one * (1.0 - inner) - two * inner) / eta
    assert stress == pytest.approx(one, abs=1e-6)
    assert one * (1.0 - inner) == pytest.approx(one * two / (one + two), abs=1e-6)
    assert begins != one + two


# ---- 9.6 and 9.7: gradients, and the model of 1987


def test_the_adjoint_of_implicit_steps_solves() -> None:
    """f(x_t, x_(t-1), u) = x_t - x_(t-1) - h (u - x_t^3) = 0, L = x_T^2. With the chapter's products in place of
    solutions, and nothing of the step before, the gradient is off by far."""
    h, n, u = 0.3, 4, 1.2

    def steps(u: float) -> list[float]:
        x = [0.5]
        for _ in range(n):
            now = x[-1]
            for _ in range(50):
                now -= (now - x[-1] - h * (u - now**3)) / (1.0 + 3.0 * h * now**2)
            x.append(now)
        return x

    x = steps(u)
    truth = (steps(u + 1e-6)[-1] ** 2 - steps(u - 1e-6)[-1] ** 2) / 2e-6
    weight, chapter = 2.0 * x[-1], 0.0
    for t in range(n, 0, -1):
        chapter += -h * weight
        weight *= 1.0 + 3.0 * h * x[t] ** 2
    adjoint, mended = -2.0 * x[-1] / (1.0 + 3.0 * h * x[-1] ** 2), 0.0
    for t in range(n, 0, -1):
        mended += -h * adjoint
        adjoint = adjoint / (1.0 + 3.0 * h * x[t - 1] ** 2)  # the step before hands on -df/dx_(t-1) = 1
    assert mended == pytest.approx(truth, rel=1e-6)
    assert abs(chapter / truth - 1.0) > 1.0


def test_small_strain_is_no_energy_of_a_sheet_that_turns() -> None:
    """Turned by 60 degrees, the strain of 9.2.1 has a norm of .7, the metric tensor of 1987 has not changed."""
    angle = np.pi / 3.0
    f = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    small = 0.5 * (f + f.T) - np.eye(2)
    assert np.linalg.norm(small) > 0.5
    np.testing.assert_allclose(f.T @ f, np.eye(2), atol=1e-12)


# ---- 9.8: material points


def test_a_material_point_has_its_volume_at_rest() -> None:
    """-dE/dx of E = V_0 Psi((I + x g^T) F), Psi = (tr F^T F - 3)/2, is -V_0 P F^T g; V = J V_0 is J times too much."""
    f, g, rest = np.diag([1.3, 1.2, 1.1]), np.array([0.4, -0.2, 0.7]), 1e-3

    def energy(x: Floats) -> float:
        moved = (I3 + np.outer(x, g)) @ f
        return float(rest * 0.5 * (np.trace(moved.T @ moved) - 3.0))

    force = -slope(energy, np.zeros(3))
    np.testing.assert_allclose(-rest * f @ f.T @ g, force, rtol=1e-6)
    chapter = -np.linalg.det(f) * rest * f @ f.T @ g
    assert (np.abs(chapter / force) > 1.5).all()


def test_pic_loses_angular_momentum_and_apic_does_not() -> None:
    """Points that turn about the origin, to a grid and back, with bilinear weights (Jiang et al. 2015)."""
    random = np.random.default_rng(1)
    x = random.uniform(1.0, 4.0, (40, 2))
    v = np.stack([-(x[:, 1] - 2.5), x[:, 0] - 2.5], axis=1)
    affine = np.broadcast_to(np.array([[0.0, -1.0], [1.0, 0.0]]), (40, 2, 2))  # C of that motion
    base = np.floor(x).astype(int)
    nodes, weights = [], []
    for corner in np.ndindex(2, 2):
        nodes.append(base + corner)
        weights.append(np.prod(1.0 - np.abs(x - nodes[-1]), axis=1))

    def transferred(with_affine: bool) -> float:
        mass, momentum = np.zeros((6, 6)), np.zeros((6, 6, 2))
        for node, weight in zip(nodes, weights, strict=True):
            here = v + (np.einsum("pij,pj->pi", affine, node - x) if with_affine else 0.0)
            np.add.at(mass, tuple(node.T), weight)
            np.add.at(momentum, tuple(node.T), weight[:, None] * here)
        velocity = momentum / np.maximum(mass, 1e-300)[..., None]
        total = 0.0
        for node, weight in zip(nodes, weights, strict=True):
            back = velocity[tuple(node.T)]
            arm = (node if with_affine else x) - 2.5
            total += float((weight * (arm[:, 0] * back[:, 1] - arm[:, 1] * back[:, 0])).sum())
        return total

    def of_points() -> float:
        return float(((x - 2.5) * np.stack([v[:, 1], -v[:, 0]], axis=1)).sum())

    own = 0.0  # what the affine motion itself carries about each point, which APIC counts
    for node, weight in zip(nodes, weights, strict=True):
        own += float((weight * ((node - x) ** 2).sum(axis=1)).sum())
    assert transferred(False) < 0.95 * of_points()
    assert transferred(True) == pytest.approx(of_points() + own, rel=1e-12)


# ---- 9.11: listings


def test_a_step_by_velocity_alone_blows_up_what_rests() -> None:
    """A chain at rest, pulled by a tenth: |v| = 0 bounds no step; dx/(c + |v|) does."""
    n, c = 20, 1.0

    def longest(dt_of: Any) -> float:
        x, v = np.arange(n, dtype=float), np.zeros(n)
        x[-1] += 0.1
        for _ in range(200):
            dt = min(dt_of(float(np.abs(v).max())), 10.0)
            pull = np.diff(x) - 1.0
            force = np.zeros(n)
            force[:-1] += c * c * pull
            force[1:] -= c * c * pull
            v += dt * force
            x += dt * v
            if not np.abs(x).max() < 1e6:
                return float("inf")
        return float(np.abs(np.diff(x) - 1.0).max())

    assert longest(lambda v: 0.5 / v if v > 0.0 else np.inf) > 0.5
    assert longest(lambda v: 0.5 / (c + v)) < 0.2


class ListedMonitor:
    """The chapter's EnergyMonitor."""

    def __init__(self) -> None:
        self.history: list[float] = []

    def compute_energy(self, system: Any) -> float:
        kinetic = 0.5 * np.sum(system.mass * system.velocity**2)
        return float(kinetic + system.compute_potential_energy())

    def check_conservation(self, tolerance: float = 0.01) -> None:
        if len(self.history) > 1:
            drift = abs(self.history[-1] - self.history[0])
            if drift / abs(self.history[0]) > tolerance:
                warnings.warn("Energy drift", stacklevel=1)


class Moving:
    def __init__(self, n: int, speed: float) -> None:
        self.mass, self.velocity = np.arange(1.0, n + 1.0), np.full((n, 3), speed)

    def compute_potential_energy(self) -> float:
        return 0.0


def test_the_energy_monitor_adds_up_the_wrong_products_and_remembers_nothing() -> None:
    monitor = ListedMonitor()
    with pytest.raises(ValueError, match="broadcast"):
        monitor.compute_energy(Moving(4, 1.0))
    three = Moving(3, 1.0)
    three.velocity[:, 1:] = 0.0
    three.velocity[:, 0] = [1.0, 0.0, 0.0]  # only the lightest moves: 1/2
    assert monitor.compute_energy(three) == 0.5
    three.velocity[0] = [0.0, 1.0, 0.0]
    assert monitor.compute_energy(three) == 1.0, "the same speed along y counts with another point's mass"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for speed in (1.0, 10.0):
            monitor.compute_energy(Moving(3, speed))
            monitor.check_conservation()
    mended = 0.5 * float((three.mass * (three.velocity**2).sum(axis=1)).sum())
    assert mended == 0.5


def test_a_constraint_whose_rest_value_is_zero_has_no_relative_error() -> None:
    """A flat hinge, a contact: the listing divides by 0; relative to a size of the scene it is a number."""
    with np.errstate(divide="raise"), pytest.raises((ZeroDivisionError, FloatingPointError)):
        _ = np.float64(1e-3) / np.float64(0.0)
    assert 1e-3 / max(0.0, 0.02) == pytest.approx(0.05)


# ---- the page


def test_every_control_is_on_the_page_and_there_is_no_other() -> None:
    here = {name for name in globals() if name.startswith("test_")} - {
        "test_every_control_is_on_the_page_and_there_is_no_other"
    }
    assert set(re.findall(r"`(test_\w+)`", PAGE.read_text(encoding="utf-8"))) == here
