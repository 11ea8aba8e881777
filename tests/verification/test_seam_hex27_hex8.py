"""How well a seam between hex27 and 8 x hex8 on the same nodes passes a constant stress.

A column of cells along z under uniaxial tension p: hex27 below, 8 hex8 an upper cell, linear elastic, rollers on
x = 0, y = 0, z = 0. Exact: sigma_zz = p, u = (-nu x, -nu y, z) p/E. A constant stress pulls a hex27 face with Simpson's
weights (1, 4, 16)/36 at corner, edge and centre nodes, and four hex8 faces with the trapezoid's (1, 2, 4)/16, so tying
the nodes cannot transmit it exactly. A mortar tie, int psi_i (u_near - u_far) = 0 for the nine biquadratic psi of each
face, can: its multipliers are tractions. The participants are tied that way; nodal tying is the failing control.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from softseam_coupling.mortar import mortar_tie

Floats = NDArray[np.float64]
YOUNG, POISSON, LOAD = 1.0, 0.45, 1.0
GAUSS = {2: np.polynomial.legendre.leggauss(2), 3: np.polynomial.legendre.leggauss(3)}


def shape_1d(order: int, t: float) -> tuple[Floats, Floats]:
    """Values and derivatives of the Lagrange polynomials on 2 or 3 equidistant nodes of [-1, 1]."""
    if order == 1:
        return np.array([0.5 * (1.0 - t), 0.5 * (1.0 + t)]), np.array([-0.5, 0.5])
    return (
        np.array([0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)]),
        np.array([t - 0.5, -2.0 * t, t + 0.5]),
    )


def strain_matrix(order: int, edge: float, point: Floats) -> Floats:
    """B (6, 3 n) of a cube: strain xx yy zz yz xz xy (engineering shears) of nodal displacements, x fastest."""
    (nx, dx), (ny, dy), (nz, dz) = (shape_1d(order, float(t)) for t in point)
    scale = 2.0 / edge
    gx = scale * np.einsum("k,j,i->kji", nz, ny, dx).ravel()
    gy = scale * np.einsum("k,j,i->kji", nz, dy, nx).ravel()
    gz = scale * np.einsum("k,j,i->kji", dz, ny, nx).ravel()
    b = np.zeros((6, 3 * len(gx)))
    b[0, 0::3], b[1, 1::3], b[2, 2::3] = gx, gy, gz
    b[3, 1::3], b[3, 2::3] = gz, gy
    b[4, 0::3], b[4, 2::3] = gz, gx
    b[5, 0::3], b[5, 1::3] = gy, gx
    return b


def elasticity() -> Floats:
    lame = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
    mu = 0.5 * YOUNG / (1.0 + POISSON)
    c = np.zeros((6, 6))
    c[:3, :3] = lame
    c[np.arange(3), np.arange(3)] += 2.0 * mu
    c[np.arange(3, 6), np.arange(3, 6)] = mu
    return c


def element_stiffness(order: int, edge: float) -> Floats:
    points, weights = GAUSS[order + 1]
    k = np.zeros((3 * (order + 1) ** 3,) * 2)
    for a, wa in zip(points, weights, strict=True):
        for b, wb in zip(points, weights, strict=True):
            for c, wc in zip(points, weights, strict=True):
                m = strain_matrix(order, edge, np.array([a, b, c]))
                k += wa * wb * wc * (edge / 2.0) ** 3 * m.T @ elasticity() @ m
    return k


@dataclass(frozen=True)
class Column:
    """n x n x 2 h cells of unit edge; lattice of half edges. The seam's nodes exist twice."""

    n: int
    h: int

    @property
    def wide(self) -> int:
        return 2 * self.n + 1

    def near(self, i: int, j: int, k: int) -> int:
        return i + self.wide * (j + self.wide * k)

    def far(self, i: int, j: int, k: int) -> int:
        return self.near(i, j, k + 1)  # one layer of copies

    @property
    def n_nodes(self) -> int:
        return self.wide**2 * (4 * self.h + 2)

    def cells(self, first: int, last: int) -> list[tuple[int, int, int]]:
        return [(i, j, k) for k in range(first, last) for j in range(self.n) for i in range(self.n)]

    def hex27(self, cell: tuple[int, int, int]) -> list[int]:
        i, j, k = (2 * c for c in cell)
        return [self.near(i + a, j + b, k + c) for c in range(3) for b in range(3) for a in range(3)]

    def hex8(self, block: tuple[int, int, int]) -> list[int]:
        i, j, k = block
        return [self.far(i + a, j + b, k + c) for c in range(2) for b in range(2) for a in range(2)]

    def blocks(self) -> list[tuple[int, int, int]]:
        m = 2 * self.n
        return [(i, j, k) for k in range(2 * self.h, 4 * self.h) for j in range(m) for i in range(m)]


def dofs(nodes: list[int]) -> NDArray[np.int64]:
    return (3 * np.array(nodes)[:, None] + np.arange(3)).ravel()


def mortar(n: int) -> Floats:
    """P of the shipped mortar tie over a seam of n x n unit faces: u_near = P u_far."""
    wide = 2 * n + 1
    faces = [[2 * i + a + wide * (2 * j + b) for b in range(3) for a in range(3)] for j in range(n) for i in range(n)]
    nodes = np.arange(wide**2, dtype=np.int32)
    edges, fill = np.ones((n * n, 2)), np.ones((n * n, 4))
    tie = mortar_tie(np.array(faces, dtype=np.int32), edges, fill, "hex27", "hex8", nodes, np.zeros((wide**2, 3)))
    assert tie.p is not None
    return tie.p


def solve(column: Column, tie: Literal["nodal", "mortar"]) -> tuple[float, Floats]:
    """Largest relative error of u_z on the loaded face; largest stress error of each layer of octants over p."""
    n_dof = 3 * column.n_nodes
    k = np.zeros((n_dof, n_dof))
    for cell in column.cells(0, column.h):
        at = dofs(column.hex27(cell))
        k[np.ix_(at, at)] += element_stiffness(2, 1.0)
    for block in column.blocks():
        at = dofs(column.hex8(block))
        k[np.ix_(at, at)] += element_stiffness(1, 0.5)
    f = np.zeros(n_dof)
    m, top = 2 * column.n, 4 * column.h
    for i in range(m):
        for j in range(m):
            face = [column.far(i + a, j + b, top) for a in range(2) for b in range(2)]
            f[3 * np.array(face) + 2] += LOAD * 0.25 / 4.0
    lattice = range(column.wide)
    layer = 2 * column.h
    near = np.array([column.near(i, j, layer) for j in lattice for i in lattice])
    far = np.array([column.far(i, j, layer) for j in lattice for i in lattice])
    slave = np.eye(len(near)) if tie == "nodal" else mortar(column.n)  # u_near = slave u_far: near is condensed
    t = np.eye(n_dof)
    for c in range(3):
        t[3 * near + c] = 0.0
        t[np.ix_(3 * near + c, 3 * far + c)] = slave
    fixed = np.zeros(n_dof, dtype=np.bool_)
    for c in range(3):
        fixed[3 * near + c] = True
    for a in lattice:
        for b in range(4 * column.h + 1):
            number = column.near if b < layer else column.far
            fixed[3 * number(0, a, b)] = fixed[3 * number(a, 0, b) + 1] = True
        for b in lattice:
            fixed[3 * column.near(a, b, 0) + 2] = True
    t = t[:, ~fixed]
    u = t @ np.linalg.solve(t.T @ k @ t, t.T @ f)

    height = 2.0 * column.h
    tip = u[[3 * column.far(i, j, top) + 2 for i in lattice for j in lattice]]
    error = float(np.abs(tip / (LOAD / YOUNG * height) - 1.0).max())
    exact = np.array([0.0, 0.0, LOAD, 0.0, 0.0, 0.0])
    stress = np.zeros(4 * column.h)
    for cell in column.cells(0, column.h):
        for octant in range(8):
            local = np.array([octant & 1, octant >> 1 & 1, octant >> 2]) - 0.5
            s = elasticity() @ strain_matrix(2, 1.0, local) @ u[dofs(column.hex27(cell))]
            layer = 2 * cell[2] + (octant >> 2)
            stress[layer] = max(stress[layer], np.abs(s - exact).max() / LOAD)
    for block in column.blocks():
        s = elasticity() @ strain_matrix(1, 0.5, np.zeros(3)) @ u[dofs(column.hex8(block))]
        stress[block[2]] = max(stress[block[2]], np.abs(s - exact).max() / LOAD)
    return error, stress


def test_face_forces_of_a_constant_stress() -> None:
    """Simpson below, trapezoid above: the whole difference of the two models at the seam."""
    stress = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    points, weights = GAUSS[3]
    f = np.zeros(81)
    for a, wa in zip(points, weights, strict=True):
        for b, wb in zip(points, weights, strict=True):
            for c, wc in zip(points, weights, strict=True):
                f += wa * wb * wc / 8.0 * strain_matrix(2, 1.0, np.array([a, b, c])).T @ stress
    assert_allclose(36.0 * f[2::3].reshape(3, 3, 3)[2], [[1, 4, 1], [4, 16, 4], [1, 4, 1]], atol=1e-12)
    block = np.zeros((3, 3))
    g = (0.5**3 * strain_matrix(1, 0.5, np.zeros(3)).T @ stress)[2::3].reshape(2, 2, 2)[1]
    for j in range(2):
        for i in range(2):
            block[j : j + 2, i : i + 2] += g
    assert_allclose(16.0 * block, [[1, 2, 1], [2, 4, 2], [1, 2, 1]], atol=1e-12)


@pytest.mark.parametrize("n", [1, 2])
def test_mortar_passes_the_patch_test(n: int) -> None:
    error, stress = solve(Column(n, 2), "mortar")
    assert error < 1e-12
    assert stress.max() < 1e-11


@pytest.mark.parametrize("n", [1, 2])
def test_nodal_tying_fails_it_locally(n: int) -> None:
    """The defect is self-equilibrated: small at the loaded face, large beside the seam, gone a cell or two away."""
    error, stress = solve(Column(n, 2), "nodal")
    assert error < 2e-2
    beside, away = stress[[3, 4]].max(), stress[[0, 7]].max()
    assert 0.05 < beside < 0.5
    assert away < 0.1 * beside
