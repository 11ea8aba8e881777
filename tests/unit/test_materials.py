"""Materials: derivatives against finite differences, objectivity, small strains, definite tangents, closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from softseam_protocol.scene.materials import MATERIALS, MooneyRivlinMaterial, material_spec
from softseam_services.body.body import Material
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.errors import LawError
from softseam_services.body.materials import LAWS, build_material, neo_hookean, point
from softseam_services.body.materials.invariants import invariants
from softseam_services.body.materials.law import Law as TableRow
from softseam_services.body.materials.principal import raise_to_zero, signed_svd
from softseam_services.body.materials.prototype import MAX_PARAMETERS

YOUNG, POISSON = 20e3, 0.45
SPEC = MooneyRivlinMaterial(young=YOUNG, poisson=POISSON, density=1050, ratio=0.3)
MU, LAM = YOUNG / 2.9, YOUNG * 0.45 / (1.45 * 0.1)
# every sort of state between a stretch of 0.3 and one of 3, repeated and nearly repeated stretches among them
PRINCIPAL = [
    (0.3, 1.2, 1.1),
    (0.3, 3.0, 3.0),
    (0.3, 0.3, 0.3),
    (0.6, 0.9, 1.4),
    (1.0, 1.0, 1.0),
    (1.0, 1.0 + 1e-9, 1.0 - 1e-9),
    (1.7, 0.8, 1.0),
    (3.0, 0.6, 0.7),
    (3.0, 0.577, 0.577),
    (3.0, 3.0, 3.0),
]
OBJECTIVE: list[str] = [kind for kind in MATERIALS if kind != "linear"]
# those whose energy returns an inverted state to its rest
RIGHTING: list[str] = [kind for kind in OBJECTIVE if kind != "st_venant_kirchhoff"]


def material(kind: str, poisson: float = POISSON) -> Material:
    ratio = {"ratio": 0.3} if kind == "mooney_rivlin" else {}
    return build_material(material_spec({"kind": kind, "young": YOUNG, "poisson": poisson, "density": 1050, **ratio}))


class Law:
    """`point`'s kernels of one material, with results instead of outputs."""

    def __init__(self, kind: str, poisson: float = POISSON) -> None:
        self.material = material(kind, poisson)
        self._law = (self.material.number, self.material.parameters)

    def energy(self, F: np.ndarray) -> float:
        return float(point.energy(*self._law, F))

    def _array(self, kernel: Callable[..., None], F: np.ndarray) -> np.ndarray:
        out = np.full((3, 3), np.nan)
        kernel(*self._law, F, out)
        return out

    def stress(self, F: np.ndarray) -> np.ndarray:
        return self._array(point.stress, F)

    def cauchy(self, F: np.ndarray) -> np.ndarray:
        return self._array(point.cauchy, F)

    def tangent(self, F: np.ndarray, definite: bool = False) -> np.ndarray:
        A = np.full((9, 9), np.nan)
        point.tangent(*self._law, F, A, definite)
        return A


def rotation(seed: int) -> np.ndarray:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def turned(stretches: tuple[float, ...], seed: int) -> np.ndarray:
    return np.asarray(rotation(2 * seed) @ np.diag(stretches) @ rotation(2 * seed + 1))


DEFORMATIONS = [turned(s, i) for i, s in enumerate(PRINCIPAL)]
INVERTED = [turned(s, 40 + i) for i, s in enumerate([(1.2, 0.9, -0.4), (2.0, 0.5, -0.3), (0.7, 0.6, 0.0)])]
EVERY = [*DEFORMATIONS, *INVERTED]


def test_every_kind_of_the_scene_has_a_row() -> None:
    assert list(MATERIALS) == list(LAWS)
    assert {law.number for law in LAWS.values()} >= point.BRANCHES


@pytest.mark.kernels
def test_no_law_falls_through_to_another() -> None:
    """A number without a branch is refused where the table is made; a kernel refuses 0, which is no law."""
    with pytest.raises(LawError, match=r"branch 7 of materials\.point, which has no such branch"):
        TableRow(lambda spec, elastic: (), inline=7)
    with pytest.raises(LawError, match="needs a response"):
        TableRow(lambda spec, elastic: ())
    with pytest.raises(ValueError, match="response of a material law: a kernel was given address 0"):
        point.energy(0, np.zeros(MAX_PARAMETERS), np.eye(3))
    with pytest.raises(LawError, match="at most 16 finite numbers"):
        TableRow(lambda spec, elastic: [1.0] * 17, inline=1).packed(SPEC, ElasticConstants(MU, LAM))


@pytest.mark.kernels
@pytest.mark.parametrize("kind", MATERIALS)
def test_stress_and_tangent_are_derivatives(kind: str) -> None:
    """Central differences, step h: the truncation is h^2 f'''/6, rounding 1e-16 f/h.

    The largest entry of A measures f'' and bounds f''' and f up to a factor of about 1e4 at these strains, so with
    h = 3e-6 both errors stay below 1e-6 of it.
    """
    law, h = Law(kind), 3e-6
    for F in EVERY:
        P, A = law.stress(F), law.tangent(F)
        P_fd, A_fd = np.empty(9), np.empty((9, 9))
        for m in range(9):
            d = np.zeros((3, 3))
            d.flat[m] = h
            P_fd[m] = (law.energy(F + d) - law.energy(F - d)) / (2 * h)
            A_fd[:, m] = ((law.stress(F + d) - law.stress(F - d)) / (2 * h)).reshape(-1)
        scale = np.abs(A).max()
        np.testing.assert_allclose(P.reshape(-1), P_fd, atol=1e-7 * scale, err_msg=f"{F}")
        np.testing.assert_allclose(A, A_fd, atol=1e-6 * scale, err_msg=f"{F}")
        np.testing.assert_allclose(A, A.T, atol=1e-13 * scale, err_msg=f"{F}")


@pytest.mark.kernels
@pytest.mark.parametrize("kind", OBJECTIVE)
def test_a_rigid_turn_changes_nothing(kind: str) -> None:
    """psi(Q F) = psi(F) = psi(F Q), P(Q F) = Q P(F), and sigma = P F^T/J is symmetric."""
    law, Q = Law(kind), rotation(99)
    for F in EVERY:
        psi, P = law.energy(F), law.stress(F)
        rounding = 1e-12 * (np.abs(law.tangent(F)).max() + np.abs(P).max())
        assert law.energy(Q @ F) == pytest.approx(psi, rel=1e-11, abs=rounding), F
        assert law.energy(F @ Q) == pytest.approx(psi, rel=1e-11, abs=rounding), F
        np.testing.assert_allclose(law.stress(Q @ F), Q @ P, rtol=0, atol=10 * rounding, err_msg=f"{F}")
        J = np.linalg.det(F)
        if abs(J) > 1e-3:
            sigma = law.cauchy(F)
            atol = 100 * rounding / abs(J)
            np.testing.assert_allclose(sigma, P @ F.T / J, rtol=1e-9, atol=atol, err_msg=f"{F}")
            np.testing.assert_allclose(sigma, sigma.T, atol=atol, err_msg=f"{F}")


@pytest.mark.kernels
def test_linear_is_not_objective() -> None:
    """The control of the test above."""
    assert Law("linear").energy(rotation(1)) > 1.0


@pytest.mark.kernels
@pytest.mark.parametrize("kind", MATERIALS)
def test_rest_is_free_of_energy_and_stress(kind: str) -> None:
    law = Law(kind)
    assert law.energy(np.eye(3)) == pytest.approx(0.0, abs=1e-10)
    np.testing.assert_allclose(law.stress(np.eye(3)), 0.0, atol=1e-10)


@pytest.mark.kernels
@pytest.mark.parametrize("kind", MATERIALS)
@pytest.mark.parametrize("poisson", [-0.5, 0.0, 0.3, 0.45, 0.4999])
def test_small_strain_limit_is_hooke(kind: str, poisson: float) -> None:
    """At rest A is Hooke's, and the stress departs from Hooke's with the strain's square (slope 2)."""
    law, linear = Law(kind, poisson), Law("linear", poisson)
    A = linear.tangent(np.eye(3))
    mu, lam = law.material.mu, law.material.lambda_
    d = np.eye(3)
    hooke = mu * (np.einsum("ik,jl->ijkl", d, d) + np.einsum("il,jk->ijkl", d, d)) + lam * np.einsum(
        "ij,kl->ijkl", d, d
    )
    np.testing.assert_allclose(A, hooke.reshape(9, 9), rtol=1e-14)
    np.testing.assert_allclose(law.tangent(np.eye(3)), A, atol=1e-12 * np.abs(A).max())
    if kind == "linear":
        return
    H = np.random.default_rng(5).normal(size=(3, 3))
    H = 0.5 * (H + H.T)
    scales = 2.0 ** -np.arange(6, 12)
    gaps = [np.abs(law.stress(np.eye(3) + e * H) - linear.stress(np.eye(3) + e * H)).max() for e in scales]
    if kind == "corotated":  # without a rotation both are the same
        np.testing.assert_allclose(gaps, 0.0, atol=1e-12 * np.abs(A).max())
    else:
        assert np.polyfit(np.log(scales), np.log(gaps), 1)[0] == pytest.approx(2.0, abs=0.1)


@pytest.mark.kernels
@pytest.mark.parametrize("kind", MATERIALS)
def test_energy_of_small_strains_is_not_rounded_away(kind: str) -> None:
    """psi = strain : A : strain/2; at strains of 1e-8 a logarithm of J, not of J - 1, would lose all of it."""
    law = Law(kind)
    H = 1e-8 * np.array([[1.0, 0.5, 0.0], [0.5, -0.7, 0.2], [0.0, 0.2, 0.4]])
    quadratic = 0.5 * H.reshape(-1) @ law.tangent(np.eye(3)) @ H.reshape(-1)
    assert law.energy(np.eye(3) + H) == pytest.approx(quadratic, rel=1e-6, abs=0.0)


@pytest.mark.kernels
@pytest.mark.parametrize("kind", MATERIALS)
def test_definite_tangent(kind: str) -> None:
    """Eigenvalues of the definite tangent are those of the exact one with the negative ones raised to zero."""
    law = Law(kind)
    for F in EVERY:
        values, vectors = np.linalg.eigh(law.tangent(F))
        A = law.tangent(F, definite=True)
        scale = np.abs(values).max()
        assert np.linalg.eigvalsh(A).min() >= -1e-13 * scale, F
        wanted = (vectors * np.maximum(values, 0.0)) @ vectors.T
        np.testing.assert_allclose(A, wanted, atol=1e-10 * scale, err_msg=f"{F}")


@pytest.mark.kernels
def test_where_the_exact_tangent_is_indefinite() -> None:
    """The clamp has work to do: a crushed state has negative eigenvalues in every objective law."""
    F = np.diag([0.5, 0.5, 0.5])
    for kind in OBJECTIVE:
        values = np.linalg.eigvalsh(Law(kind, 0.3).tangent(F))
        assert values.min() < -1e-2 * values.max(), kind


@pytest.mark.kernels
def test_signed_svd() -> None:
    """F = U diag(s) V^T, rotations on both sides, and stretches to full relative precision over 12 decades."""
    for seed in range(200):
        rng = np.random.default_rng(seed)
        wanted = np.sort(10.0 ** rng.uniform(-6, 6, 3))[::-1] * [1.0, 1.0, rng.choice([-1.0, 1.0])]
        if seed % 4 == 0:
            wanted[1] = wanted[0]
        V0, U0 = rotation(1000 + seed), rotation(3000 + seed)
        F = U0 @ np.diag(wanted) @ V0.T
        U, s, V = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
        signed_svd(F, U, s, V)
        which = f"seed {seed}"
        np.testing.assert_allclose(U @ U.T, np.eye(3), atol=1e-14, err_msg=which)
        np.testing.assert_allclose(V @ V.T, np.eye(3), atol=1e-14, err_msg=which)
        assert np.linalg.det(U) == pytest.approx(1.0, abs=1e-14), which
        assert np.linalg.det(V) == pytest.approx(1.0, abs=1e-14), which
        np.testing.assert_allclose(U @ np.diag(s) @ V.T, F, atol=1e-14 * wanted[0], err_msg=which)
        np.testing.assert_allclose(s, wanted, atol=2e-15 * wanted[0], err_msg=which)


@pytest.mark.kernels
@pytest.mark.parametrize("F", [np.zeros((3, 3)), np.diag([0.0, 2.0, 0.0]), np.ones((3, 3)), np.diag([0.0, 2.0, -3.0])])
def test_signed_svd_of_flat_states(F: np.ndarray) -> None:
    U, s, V = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    signed_svd(F, U, s, V)
    np.testing.assert_allclose(U @ U.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(U @ np.diag(s) @ V.T, F, atol=1e-14)
    assert np.linalg.det(U) == pytest.approx(1.0)
    assert np.linalg.det(V) == pytest.approx(1.0)


@pytest.mark.kernels
def test_raise_to_zero_is_the_nearest_definite_matrix() -> None:
    for seed in range(20):
        h = np.random.default_rng(seed).normal(size=(3, 3))
        h = h + h.T
        values, vectors = np.linalg.eigh(h)
        raise_to_zero(h)
        np.testing.assert_allclose(h, (vectors * np.maximum(values, 0.0)) @ vectors.T, atol=1e-13)


@pytest.mark.kernels
def test_invariants_are_differences_from_rest() -> None:
    for F in EVERY:
        C = F.T @ F
        first, J = np.trace(C), np.linalg.det(F)
        second = 0.5 * (first**2 - np.trace(C @ C))
        scale = max(1.0, abs(second))
        np.testing.assert_allclose(invariants(F), (first - 3, second - 3, J - 1), atol=1e-13 * scale)


@pytest.mark.kernels
@pytest.mark.parametrize("kind", RIGHTING)
def test_inverted_states_are_finite_and_pushed_back(kind: str) -> None:
    law, F = Law(kind), np.diag([-0.5, 1.0, 1.0])
    assert np.isfinite(law.energy(F))
    assert np.isfinite(law.tangent(F)).all()
    assert law.stress(F)[0, 0] < 0.0  # energy falls as F_xx grows back through zero


@pytest.mark.kernels
@pytest.mark.parametrize("kind", MATERIALS)
def test_states_without_volume_are_finite(kind: str) -> None:
    law = Law(kind)
    for F in (np.zeros((3, 3)), np.diag([1.0, 0.0, 0.0]), np.ones((3, 3)), -np.eye(3)):
        assert np.isfinite(law.energy(F))
        assert np.isfinite(law.stress(F)).all()
        assert np.isfinite(law.tangent(F)).all()
        assert np.linalg.eigvalsh(law.tangent(F, definite=True)).min() >= -1e-9 * np.abs(law.tangent(F)).max()


def lateral_stretch(law: Law, stretch: float) -> float:
    """The sideways stretch that leaves the sides of a pulled bar free, by bisection."""
    low, high = 0.4, 2.0
    for _ in range(80):
        b = 0.5 * (low + high)
        low, high = (b, high) if law.stress(np.diag([stretch, b, b]))[1, 1] < 0 else (low, b)
    return b


# Uniaxial stress of the matrix (its fibres carry nothing in compression), and stress at a held cross-section; from a
# collection of closed forms of material laws, E 20 kPa, nu 0.45.
COMPRESSED = 0.9, 1.04831324899, -2214.25799232
HELD = 0.9, -8722.18115648, -6539.61821324


@pytest.mark.kernels
def test_reference_values_of_neo_hookean() -> None:
    law = Law("neo_hookean")
    stretch, lateral, nominal = COMPRESSED
    assert lateral_stretch(law, stretch) == pytest.approx(lateral, rel=1e-11)
    assert law.stress(np.diag([stretch, lateral, lateral]))[0, 0] == pytest.approx(nominal, rel=1e-9)
    stretch, along, across = HELD
    np.testing.assert_allclose(law.stress(np.diag([stretch, 1.0, 1.0])), np.diag([along, across, across]), rtol=1e-11)


@pytest.mark.kernels
def test_uniaxial_closed_forms() -> None:
    """Bars with free sides and bars with held ones, where a formula is short.

    Hooke: P = E (a - 1). St. Venant-Kirchhoff, sides free: P = E a (a^2 - 1)/2; held: (lambda + 2 mu) a (a^2 - 1)/2.
    Corotated, sides free: P = E (a - 1). neo-Hookean, sides free: P = mu (a - b^2/a).
    """
    for a in (0.6, 0.85, 1.3, 1.5):
        forces: dict[str, float] = {
            "linear": YOUNG * (a - 1),
            "corotated": YOUNG * (a - 1),
            "st_venant_kirchhoff": YOUNG * a * (a * a - 1) / 2,
        }
        for kind, force in forces.items():
            law = Law(kind)
            b = lateral_stretch(law, a)
            np.testing.assert_allclose(law.stress(np.diag([a, b, b])), np.diag([force, 0, 0]), atol=1e-8 * YOUNG)
        law = Law("neo_hookean")
        b = lateral_stretch(law, a)
        assert law.stress(np.diag([a, b, b]))[0, 0] == pytest.approx(MU * (a - b * b / a), rel=1e-9)
        held = Law("st_venant_kirchhoff").stress(np.diag([a, 1, 1]))[0, 0]
        assert held == pytest.approx((LAM + 2 * MU) * a * (a * a - 1) / 2, rel=1e-12)


@pytest.mark.kernels
@pytest.mark.parametrize(("kind", "force"), [("neo_hookean", 8.80), ("st_venant_kirchhoff", 5.90), ("corotated", 7.50)])
def test_a_cube_squeezed_between_smooth_plates(kind: str, force: float) -> None:
    """5 cm, E 20 kPa, nu 0.45, by 15 %: forces [N] that independent codes give; the law alone is worth 40 %."""
    law = Law(kind)
    b = lateral_stretch(law, 0.85)
    assert -law.stress(np.diag([0.85, b, b]))[0, 0] * 0.05**2 == pytest.approx(force, abs=0.01)


@pytest.mark.kernels
def test_mooney_rivlin_of_an_incompressible_bar() -> None:
    """nu -> 1/2, sides free: P = 2 (a - 1/a^2)(c10 + c01/a) (Treloar, The Physics of Rubber Elasticity)."""
    law = Law("mooney_rivlin", 0.49999)
    mu = law.material.mu
    for a in (0.5, 0.8, 1.5, 2.5):
        b = lateral_stretch(law, a)
        expected = 2 * (a - 1 / a**2) * (0.35 * mu + 0.15 * mu / a)
        assert law.stress(np.diag([a, b, b]))[0, 0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.kernels
@pytest.mark.parametrize("ratio", [0.0, 0.5, 1.0])
def test_mooney_rivlin_takes_volume_change_apart(ratio: float) -> None:
    """A pure change of volume has no isochoric energy: psi = U(J) = K/4 (J^2 - 1 - 2 ln J), whatever the ratio."""
    spec = MooneyRivlinMaterial(young=YOUNG, poisson=POISSON, density=1050, ratio=ratio)
    law = build_material(spec)
    for J in (0.3, 0.9, 1.2, 3.0):
        psi = point.energy(law.number, law.parameters, np.eye(3) * J ** (1 / 3))
        assert psi == pytest.approx(law.elastic.bulk / 4 * (J * J - 1 - 2 * np.log(J)), rel=1e-9)


@pytest.mark.kernels
def test_functions_of_volume_are_continued_twice_differentiably() -> None:
    """Value, slope and curvature agree from both sides of J_MIN; the third derivative jumps."""
    limits: dict[str, float] = {"neo_hookean": neo_hookean.J_MIN, "mooney_rivlin": neo_hookean.J_MIN}
    for kind, least in limits.items():
        law = Law(kind)
        below, above = (np.diag([1.1, 0.9, (least + d) / 0.99]) for d in (-1e-9, 1e-9))
        assert law.energy(below) == pytest.approx(law.energy(above), rel=1e-6)
        np.testing.assert_allclose(law.stress(below), law.stress(above), rtol=1e-6)
        np.testing.assert_allclose(law.tangent(below), law.tangent(above), rtol=1e-6)


@pytest.mark.kernels
def test_volumetric_part_of_neo_hookean_has_its_derivatives() -> None:
    for J in (-1.0, 0.0, 0.1, 0.5, 2.0):
        h = 1e-6
        upper, middle, lower = (neo_hookean.volumetric(J + d, MU, LAM) for d in (h, 0.0, -h))
        assert (upper[0] - lower[0]) / (2 * h) == pytest.approx(middle[1], rel=1e-6, abs=1e-6 * MU)
        assert (upper[1] - lower[1]) / (2 * h) == pytest.approx(middle[2], rel=1e-6)


@pytest.mark.kernels
def test_st_venant_kirchhoff_weakens_where_it_says() -> None:
    """With held sides the force is greatest at a stretch of 1/sqrt(3): the tangent there is zero."""
    A = Law("st_venant_kirchhoff").tangent(np.diag([1 / np.sqrt(3), 1.0, 1.0]))
    assert A[0, 0] == pytest.approx(0.0, abs=1e-9 * YOUNG)
