"""A spring that yields, at a point: derivatives, invariants, cycles of a bar, and radial return in small strains."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from relaxing import MU, POISSON, YIELDING_CASES, YOUNG, Floats, Point

from softseam_protocol.scene.materials import MaterialSpec, material_spec
from softseam_services.body.materials import build_material, build_materials, plasticity
from softseam_services.body.materials.point import stress

pytestmark = pytest.mark.kernels

SOFTENS = {"yield_stress": 1500.0, "share": 0.6}
HARDENS = {"yield_stress": 1300.0, "share": 0.7, "hardening": 4000.0}


def spec(**own: Any) -> MaterialSpec:
    return material_spec({"kind": "neo_hookean", "young": YOUNG, "poisson": POISSON, "density": 1e3} | own)


def some(seed: int, size: float) -> Floats:
    return np.eye(3) + size * np.random.default_rng(seed).normal(size=(3, 3))


def begun(slider: dict[str, float], **own: Any) -> Point:
    """Somewhere on its way, and past its yield stress."""
    point = Point((), plasticity=slider, **own)
    for seed in range(3):
        point.go(some(seed, 0.15), 0.05)
    assert point.slipped > 0.1
    return point


@pytest.mark.parametrize("slider", [SOFTENS, HARDENS])
@pytest.mark.parametrize("relaxation", [(), ({"share": 0.2, "time": 0.1},)])
def test_the_tangent_is_the_derivative_of_the_stress_and_symmetric(slider: dict[str, float], relaxation: Any) -> None:
    """Central differences, h = 1e-6: rounding and truncation are 1e-9 both."""
    point = begun(slider, relaxation=list(relaxation))
    for seed in range(3, 9):
        F = some(seed, 0.15)
        _, lost, _, A, following = point.respond(F, 0.05)
        assert following[-1] > point.slipped, "it yields"
        assert lost > 0.0
        of_differences, h = np.empty((9, 9)), 1e-6
        for m in range(9):
            d = np.zeros((3, 3))
            d.flat[m] = h
            of_differences[:, m] = ((point.respond(F + d, 0.05)[2] - point.respond(F - d, 0.05)[2]) / (2.0 * h)).ravel()
        scale = np.abs(A).max()
        np.testing.assert_allclose(A, of_differences, atol=1e-7 * scale)
        np.testing.assert_allclose(A, A.T, atol=1e-12 * scale)
        assert np.linalg.eigvalsh(point.respond(F, 0.05, True)[3]).min() > -1e-9 * scale


def test_a_slip_is_the_root_and_the_only_one() -> None:
    """Eq. (2) of `plasticity`, far beyond its yield stress, with and without hardening."""
    rng, mu, strength = np.random.default_rng(5), 6300.0, 900.0
    for hardening in (0.0, 400.0, 4e3, 1e5):
        for size in (0.05, 0.2, 0.6):
            X = np.eye(3) + size * rng.normal(size=(3, 3))
            C = X.T @ X / np.abs(np.linalg.det(X)) ** (2.0 / 3.0)
            p, r = np.trace(C) - 3.0, np.trace(np.linalg.inv(C)) - 3.0

            def off(a: float, p: float = p, r: float = r, hardening: float = hardening) -> float:
                A = np.cbrt((1.0 + a) ** 3 + a * p + a * a * r)
                slope = (A - 1.0) / a**2 - (1.0 + a) ** 2 / (a * A * A) - (p + 2.0 * a * r) / (3.0 * a * A * A)
                return float(slope - (strength / (1.0 - a * hardening / (3.0 * mu))) ** 2 / (9.0 * mu * mu))

            a, sigma, curvature = plasticity.slip(p, r, mu, strength, hardening)
            if a == 0.0:
                assert off(1e-4) < 0.0
                continue
            scale = (sigma / mu) ** 2 / 9.0
            assert off(a) == pytest.approx(0.0, abs=1e-9 * scale)
            assert off(0.9 * a) > 0.0 > off(min(1.1 * a, 0.5 * (a + 3.0 * mu / max(hardening, 1e-9))))
            assert curvature > 0.0


@pytest.mark.parametrize("name", ["j2_isotropic", "j2_kinematic"])
def test_a_bar_through_cycles(name: str) -> None:
    """Pulled and squeezed by 15 to 30 %, beside roots of one equation a leg: of first order in the strain of a step."""
    case, errors = YIELDING_CASES[name], []
    most = np.abs(case["P"]).max()
    for steps in (5, 10, 20):
        point, found, slipped, stretch = Point((), **case["material"]), [], [], 1.0
        for turn in case["turns"]:
            for to in np.linspace(stretch, turn, 5 * steps + 1)[1:]:
                found.append(point.pull(float(to), 0.01))
                slipped.append(point.slipped)
            stretch = turn
        errors.append(float(np.abs(np.array(found)[steps - 1 :: steps] - case["P"]).max() / most))
        np.testing.assert_allclose(slipped[steps - 1 :: steps], case["alpha"], atol=3e-3 / steps)
    assert errors[0] < 0.005
    for coarse, fine in pairwise(errors):
        assert fine == pytest.approx(coarse / 2.0, rel=0.05)


def test_small_strains_are_those_of_radial_return() -> None:
    """Sheared to and fro by ten times the strain at which it yields, with both kinds of hardening."""
    share, strength, hardening = 0.8, 1e-3 * MU, 0.05 * MU
    slider = {"yield_stress": strength, "share": share, "hardening": hardening}
    point, mu = Point((), plasticity=slider), share * MU
    plastic = alpha = 0.0
    for gamma in 1e-3 * np.concatenate([np.arange(0, 6, 0.2), np.arange(6, -6, -0.2), np.arange(-6, 3, 0.2)]):
        trial = mu * (gamma - plastic)
        over = np.sqrt(3.0) * abs(trial) - (share * strength + hardening * alpha)
        if over > 0.0:
            more = over / (3.0 * mu + hardening)
            alpha += more
            plastic += np.sqrt(3.0) * more * np.sign(trial)
        shear = np.eye(3)
        shear[0, 1] = gamma
        stress = point.go(shear, 0.01)[0, 1]
        assert stress == pytest.approx(mu * (gamma - plastic) + (1.0 - share) * MU * gamma, abs=2e-6 * MU)
        assert point.slipped == pytest.approx(alpha, rel=1e-3, abs=1e-8)


def test_work_is_stored_or_dissipated() -> None:
    """Around a closed path that yields, in small steps: what is left of the work is of second order in them."""
    left = []
    for steps in (400, 800):
        point, work = Point((), plasticity=HARDENS), 0.0
        before, P_before = np.eye(3), np.zeros((3, 3))
        for n in range(steps + 1):
            phase = 2.0 * np.pi * n / steps
            F = np.array(
                [[1.0 + 0.2 * np.sin(phase), 0.3 * np.sin(phase), 0.0], [0.0, 1.0, 0.1 * np.sin(phase)], [0, 0, 1.0]]
            )
            P = point.go(F, 0.01)
            work += float(np.sum(0.5 * (P + P_before) * (F - before)))
            before, P_before = F, P
        left.append(abs(work - point.stored - point.dissipated) / point.dissipated)
    assert left[0] < 0.01
    assert left[1] < 0.6 * left[0]


def test_a_turn_changes_nothing() -> None:
    point, turned = begun(HARDENS), begun(HARDENS)
    for seed in range(5):
        F = some(10 + seed, 0.1)
        Q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
        Q *= np.sign(np.linalg.det(Q))
        P, T = point.go(F, 0.02), turned.go(Q @ F, 0.02)
        np.testing.assert_allclose(T, Q @ P, atol=1e-9 * MU)
        np.testing.assert_allclose(turned.state, point.state, atol=1e-11)
    assert turned.dissipated == pytest.approx(point.dissipated, rel=1e-9)


def test_nothing_changes_where_the_state_is_looked_at() -> None:
    point = begun(HARDENS)
    before = point.state.copy()
    point.go(some(2, 0.15), 0.0)
    np.testing.assert_array_equal(point.state, before)


def test_below_its_yield_stress_it_is_elastic() -> None:
    """The deviator of stress is neo_hookean's at one volume; and what has yielded is elastic on its way back."""
    point, elastic, P = Point((), plasticity={"yield_stress": 1e9}), build_material(spec()), np.empty((3, 3))
    for seed in range(4):
        F = some(seed, 0.1)
        F /= np.cbrt(np.linalg.det(F))
        stress(elastic.number, elastic.parameters, F, P)
        apart = (point.go(F, 0.01) - P) @ F.T
        np.testing.assert_allclose(apart, np.eye(3) * np.trace(apart) / 3.0, atol=1e-9 * MU)
    assert point.dissipated == 0.0
    point = Point((), plasticity=HARDENS)
    for stretch in np.linspace(1.0, 1.3, 31):
        point.pull(float(stretch), 0.01)
    lost, slipped = point.dissipated, point.slipped
    assert slipped > 0.1
    for stretch in (1.29, 1.27, 1.28):
        point.pull(stretch, 0.01)
    assert (point.dissipated, point.slipped) == (lost, slipped)


def test_one_body_may_have_what_yields_beside_what_fades_and_what_does_neither() -> None:
    """All of them remember alike, and do what they do alone."""
    parts: list[dict[str, Any]] = [{}, {"relaxation": [{"share": 0.3, "time": 0.1}] * 2}, {"plasticity": HARDENS}]
    both = build_materials([spec(**part) for part in parts])
    assert {material.n_state for material in both} == {6 * 3 + 1}
    for part, material in zip(parts[1:], both[1:], strict=True):
        alone, together = Point((), **part), Point((), **part)
        together.material, together.state = material, np.zeros(material.n_state)
        for seed in range(4):
            F = some(seed, 0.15)
            np.testing.assert_allclose(together.go(F, 0.02), alone.go(F, 0.02), rtol=1e-12, atol=1e-9)
        assert together.dissipated == pytest.approx(alone.dissipated, rel=1e-12)


@pytest.mark.parametrize(
    ("own", "says"),
    [
        ({"plasticity": {"yield_stress": 0.0}}, "yield_stress"),
        ({"plasticity": {"yield_stress": 1.0, "share": 1.2}}, "share"),
        ({"plasticity": HARDENS, "relaxation": [{"share": 0.4, "time": 1.0}]}, "are 1.1 of the shear"),
        ({"plasticity": SOFTENS, "relaxation": [{"share": 0.05, "time": 1.0}] * 5}, "4 branches at most"),
        ({"plasticity": HARDENS, "kind": "linear"}, "use neo_hookean"),
    ],
)
def test_what_cannot_yield_is_refused_by_name(own: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        spec(**own)
