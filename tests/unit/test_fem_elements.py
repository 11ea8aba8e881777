"""Every element with every law on general cells, partly filled, of two materials: derivatives, invariants, tangents."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest
from element_statics import Statics, lattice
from fem_run import block
from numpy.typing import NDArray

from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.kinds import ElementKind
from softseam_protocol.scene.materials import MATERIALS
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.errors import MeshError
from softseam_services.body.lattice import LOCAL
from softseam_services.fem.elements import ELEMENTS
from softseam_services.fem.elements.hexahedra import SHARES
from softseam_services.fem.elements.hexahedra import hex8_reduced as reduced
from softseam_services.fem.kernels.elements import cauchy_stress
from softseam_services.fem.kernels.mean_volume import positive_volume

Floats = NDArray[np.float64]
KINDS: tuple[str, ...] = tuple(MATERIALS)
EDGE = 0.01


@cache
def bent(element: ElementKind, kind: str = "neo_hookean", partial: bool = True, cells: int = 2) -> Statics:
    """Cells in a row, nodes moved by up to 5 % of an edge; partial: some octants filled in part, empty, or stiffer."""
    keys: dict[str, Any] = {"ratio": 0.2} if kind == "mooney_rivlin" else {}
    rng = np.random.default_rng(5)
    shift = rng.uniform(-0.05 * EDGE, 0.05 * EDGE, (9 + 18 * cells, 3))
    beside = {"kind": "box", "position": (cells * EDGE, 0.0, 0.0), "size": (2.0 * EDGE, 1.0, 1.0)}
    other = [{"shape": beside, "material": {"young": 5e4, "poisson": 0.3}}]
    body = lattice((cells * EDGE, EDGE, EDGE), (cells, 1, 1), lambda x: shift, other, kind=kind, **keys)
    body = dataclasses.replace(body, octant_material=np.zeros_like(body.octant_material))
    if partial:
        fill = rng.uniform(0.0, 1.0, body.fill.shape)
        fill[0, :2] = 0.0
        number = rng.integers(0, 2, fill.shape).astype(np.int32)
        body = dataclasses.replace(body, fill=fill, octant_material=number)
    return Statics(body, element)


def moved(x: Floats, size: float = 0.1) -> Floats:
    rng = np.random.default_rng(0)
    return x @ (np.eye(3) + size * rng.standard_normal((3, 3))) + 2e-4 * rng.standard_normal(x.shape)


def test_every_element_of_the_scene_has_a_row() -> None:
    assert set(ELEMENTS) == set(FACTS)


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("element", ELEMENTS)
def test_forces_and_tangents_are_derivatives(element: ElementKind, kind: str) -> None:
    """Central differences along random directions; rounding of f leaves about 1e-8 of the largest entry."""
    case = bent(element, kind)
    x = moved(case.x_rest)
    way = np.random.default_rng(2).standard_normal(x.shape)
    e = 1e-7
    slope = (case.energy(x + e * way) - case.energy(x - e * way)) / (2.0 * e)
    np.testing.assert_allclose(slope, np.sum(case.forces(x) * way), rtol=1e-6)
    difference = (case.forces(x + e * way) - case.forces(x - e * way)) / (2.0 * e)
    product = (case.stiffness(x) @ way.ravel()).reshape(x.shape)
    np.testing.assert_allclose(product, difference, atol=1e-6 * np.abs(difference).max())


@pytest.mark.kernels
@pytest.mark.parametrize("element", ELEMENTS)
def test_derivatives_hold_where_elements_are_turned_over(element: ElementKind) -> None:
    case = bent(element)
    x = case.x_rest * np.array([-0.4, 1.0, 0.3]) + 1e-3 * np.random.default_rng(0).standard_normal(case.x_rest.shape)
    way = np.random.default_rng(2).standard_normal(x.shape)
    e = 1e-8
    slope = (case.energy(x + e * way) - case.energy(x - e * way)) / (2.0 * e)
    np.testing.assert_allclose(slope, np.sum(case.forces(x) * way), rtol=1e-5)
    difference = (case.forces(x + e * way) - case.forces(x - e * way)) / (2.0 * e)
    product = (case.stiffness(x) @ way.ravel()).reshape(x.shape)
    np.testing.assert_allclose(product, difference, atol=1e-5 * np.abs(difference).max())


@pytest.mark.kernels
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("element", ELEMENTS)
def test_definite_tangents_are_semi_definite_and_exact_at_rest(element: ElementKind, kind: str) -> None:
    case = bent(element, kind)
    x = moved(case.x_rest, 0.3)
    values = np.linalg.eigvalsh(case.stiffness(x, definite=True).toarray())
    assert values[0] > -1e-12 * values[-1]
    exact = case.stiffness(case.x_rest).toarray()
    assert np.abs(case.stiffness(case.x_rest, definite=True).toarray() - exact).max() < 1e-11 * np.abs(exact).max()


@pytest.mark.kernels
@pytest.mark.parametrize("partial", [False, True])
@pytest.mark.parametrize("element", ELEMENTS)
def test_six_rigid_modes_and_no_others(element: ElementKind, partial: bool) -> None:
    case = bent(element, partial=partial)
    values = np.linalg.eigvalsh(case.stiffness(case.x_rest).toarray())
    assert np.abs(values[:6]).max() < 1e-13 * values[-1]
    assert values[6] > (1e-5 if partial else 5e-4) * values[-1]


def test_a_reduced_hexahedron_without_hourglass_control_has_spurious_modes() -> None:
    """The failing control: on one octant each of the four patterns in each direction costs nothing."""
    x = 0.5 * EDGE * LOCAL[None].astype(np.float64)
    for coefficient, expected in ((0.0, 18), (1.0 / 36.0, 6)):
        table = reduced(x, 0.45, coefficient)
        G = table.gradient[0, 0, 0]
        B = np.zeros((6, 24))
        for n, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
            B[n, i::3] += G[j]
            B[n, j::3] += G[i]
        K = table.weight[0, 0, 0] * B.T @ B + np.kron(table.stabilisation[0, 0], np.eye(3))
        values = np.linalg.eigvalsh(K)
        assert np.count_nonzero(values < 1e-12 * values[-1]) == expected


@pytest.mark.kernels
@pytest.mark.parametrize("element", ELEMENTS)
def test_volume_is_exact_and_shared_by_octants(element: ElementKind) -> None:
    """Points' weights sum to the cell's volume, on boxes also octant by octant; mass is the body's, rho V."""
    box = 0.5 * EDGE * LOCAL[None].astype(np.float64)
    table = ELEMENTS[element](box, 0.3)
    np.testing.assert_allclose(table.weight.sum(), EDGE**3, rtol=1e-13)
    octants = np.einsum("bq,bqo->o", table.weight[0], table.share)
    np.testing.assert_allclose(octants, EDGE**3 / 8.0, rtol=1e-13)
    case = bent(element, partial=False)
    np.testing.assert_allclose(case.parameters.mass.sum(), 1050.0 * 2.0 * EDGE**3, rtol=1e-13)


@pytest.mark.kernels
@pytest.mark.parametrize("element", ELEMENTS)
def test_rotation_costs_nothing(element: ElementKind) -> None:
    case = bent(element)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    f = case.forces(case.x_rest @ turn.T + np.array([0.3, -0.2, 0.1]))
    assert np.abs(f).max() < 1e-11 * case.parameters.mu.max() * EDGE**2
    f = case.forces(moved(case.x_rest))
    np.testing.assert_allclose(f.sum(axis=0), 0.0, atol=1e-13 * np.abs(f).sum())


@pytest.mark.kernels
@pytest.mark.parametrize("element", ELEMENTS)
def test_a_body_that_is_all_inclusion_is_of_that_material(element: ElementKind) -> None:
    """Forces, tangents, energy and masses are those of the same body whose own material it is."""
    other: dict[str, Any] = {"young": 6e4, "density": 1300.0}
    everywhere = {"kind": "sphere", "position": (0.0, 0.0, 0.0), "radius": 1.0}
    whole = Statics(
        lattice((2 * EDGE, EDGE, EDGE), (2, 1, 1), None, [{"shape": everywhere, "material": other}]), element
    )
    plain = Statics(lattice((2 * EDGE, EDGE, EDGE), (2, 1, 1), **other), element)
    x = moved(plain.x_rest)
    f, K = plain.forces(x), plain.stiffness(x).toarray()
    np.testing.assert_allclose(whole.forces(x), f, atol=1e-13 * np.abs(f).max())
    np.testing.assert_allclose(whole.stiffness(x).toarray(), K, atol=1e-13 * np.abs(K).max())
    assert whole.energy(x) == pytest.approx(plain.energy(x), rel=1e-13)
    np.testing.assert_allclose(whole.parameters.mass, plain.parameters.mass, rtol=1e-13)
    np.testing.assert_allclose(whole.parameters.swiftness, plain.parameters.swiftness, rtol=1e-13)
    np.testing.assert_allclose(whole.parameters.point_stiffness, plain.parameters.point_stiffness, rtol=1e-13)


def unsplit(body: Body) -> Body:
    """The same body, whose law does not say that mu/2 I1 splits off."""
    materials = tuple(dataclasses.replace(material, splits=False) for material in body.materials)
    return dataclasses.replace(body, materials=materials)


@pytest.mark.kernels
@pytest.mark.parametrize("cells", [1, 2])
@pytest.mark.parametrize("kind", ["neo_hookean", "linear"])
@pytest.mark.parametrize("element", SHARES)
def test_the_fast_path_is_the_general_one(element: ElementKind, kind: str, cells: int) -> None:
    """hex27 and its kin have kernels of their own with these materials, on boxes and on cells of any shape, filled in
    part and of two materials too; a shape that is a hair off a box has a box's numbers."""
    size, counts = (cells * EDGE, EDGE, EDGE), (cells, 1, 1)
    exact = lattice(size, counts, kind=kind)
    hair = lattice(size, counts, lambda x: 1e-8 * EDGE * np.sin(1e5 * x), kind=kind)
    cases = [Statics(exact, element), Statics(hair, element), bent(element, kind, cells=cells)]
    general = [Statics(unsplit(case.body), element) for case in cases]
    assert not any(case.model.general for case in cases) and all(case.model.general for case in general)
    assert (cases[0].model.cut < 0).all() and (cases[1].model.cut >= 0).all()
    for one, other, off in ((cases[0], cases[1], 1e-6), *((a, b, 1e-12) for a, b in zip(cases, general, strict=True))):
        x = moved(one.x_rest)
        f, K = one.forces(x), one.stiffness(x).toarray()
        np.testing.assert_allclose(other.forces(x), f, atol=off * np.abs(f).max())
        np.testing.assert_allclose(other.stiffness(x).toarray(), K, atol=off * np.abs(K).max())
        assert other.energy(x) == pytest.approx(one.energy(x), rel=off)
        stress = np.empty((2, cells, 8, 6))
        for out, case in zip(stress, (one, other), strict=True):
            cauchy_stress(x, case.model, case.parameters, case.work, out)
        np.testing.assert_allclose(stress[0], stress[1], atol=off * np.abs(stress[0]).max())


@pytest.mark.kernels
@pytest.mark.parametrize("element", SHARES)
def test_one_graded_cell_has_its_own_volume(element: ElementKind) -> None:
    """One that is no box of the body's edges, which are the shortest: its weights sum to its volume."""
    size = (0.03, 0.03, 0.06)
    shape = {"kind": "block", "size": size, "grading": 2.0}
    body = build_body(block(size, size, body={"shape": shape}), {})
    assert body.n_cells == 1
    assert Statics(body, element).parameters.weight.sum() == pytest.approx(5.4e-5, rel=1e-12)


@pytest.mark.kernels
@pytest.mark.parametrize("element", ELEMENTS)
def test_a_cell_turned_over_is_refused(element: ElementKind) -> None:
    x = 0.5 * EDGE * LOCAL[None].astype(np.float64)
    x[..., 0] *= -1.0
    with pytest.raises(MeshError, match="turned over"):
        ELEMENTS[element](x, 0.3)


@pytest.mark.kernels
def test_the_volume_of_a_patch_stays_positive_and_smooth() -> None:
    for J in (-2.0, -0.3, 0.0, 0.1, 0.19, 0.21, 1.0):
        j, a, da = positive_volume(J)
        h = 1e-6
        upper, lower = positive_volume(J + h), positive_volume(J - h)
        assert j > 0.09
        assert (upper[0] - lower[0]) / (2 * h) == pytest.approx(a * j, rel=1e-6, abs=1e-9)
        assert (upper[1] - lower[1]) / (2 * h) == pytest.approx(da, rel=1e-5, abs=1e-6)
