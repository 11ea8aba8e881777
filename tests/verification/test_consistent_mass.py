"""What a consistent mass matrix would change: the frequencies of a bar beside those of the lumped masses in use.

M = int rho N^T N has frequencies above the true ones, the masses in use, Simpson's rule for the same integral, below.
Of cells H of degree 2 and the wave number k, to leading order (Ainsworth and Wajid, SIAM J. Numer. Anal. 48, 2010, doi
10.1137/090754017; Lobatto's points of degree 2 are Simpson's)
    omega_h/omega - 1 = (k H)^4/1440 of the consistent mass, -(k H)^4/2880 of the lumped one,                      (1)
so that a third of the one and two thirds of the other are of sixth order.
"""

from __future__ import annotations

import numpy as np
import pytest
from element_statics import Statics, lattice
from numpy.typing import NDArray
from scipy.linalg import eigh

from softseam_services.body.body import Body
from softseam_services.body.kernels.shape_functions import hex27

Floats = NDArray[np.float64]
LENGTH, WIDTH, CELLS = 1.0, 0.05, (4, 8, 16)
MODE = 3
WAVE_NUMBER = (MODE - 0.5) * np.pi / LENGTH
"""of a bar that is held at one end and free at the other [1/m]"""


def consistent_mass(body: Body) -> Floats:
    """int rho N_a N_b over cells that are boxes, by three Gauss points an axis, exact for N of degree 2 (n, n) [kg]."""
    at, weight = np.polynomial.legendre.leggauss(3)
    value, slope = np.zeros(27), np.zeros((27, 3))
    of_cell = np.zeros((27, 27))
    for i, j, k in np.ndindex(3, 3, 3):
        hex27(np.array([at[i], at[j], at[k]]), value, slope)
        of_cell += weight[i] * weight[j] * weight[k] * np.outer(value, value)
    of_cell *= body.material.density * float(np.prod(body.edges)) / 8.0
    mass = np.zeros((body.n_nodes, body.n_nodes))
    for nodes in body.cell_nodes:
        mass[np.ix_(nodes, nodes)] += of_cell
    return mass


def errors(n: int) -> dict[str, float]:
    """omega_h/omega - 1 of the third mode along a bar of n cells that keeps its width, by its mass matrix."""
    body = lattice((LENGTH, WIDTH, WIDTH), (n, 1, 1), poisson=0.0)
    case = Statics(body, "hex27")
    lumped, whole = np.diag(case.parameters.mass), consistent_mass(body)
    assert whole.sum(axis=1) == pytest.approx(case.parameters.mass, rel=1e-12), "its sums of rows are the masses in use"
    free = np.flatnonzero(body.x_rest[:, 0] > 1e-9)
    along = case.stiffness(case.x_rest).toarray()[0::3, 0::3][np.ix_(free, free)]
    omega = WAVE_NUMBER * np.sqrt(body.material.young / body.material.density)
    masses = {"consistent": whole, "lumped": lumped, "blended": (whole + 2.0 * lumped) / 3.0}
    found = {}
    for name, mass in masses.items():
        squares = eigh(along, mass[np.ix_(free, free)], eigvals_only=True, subset_by_index=[MODE - 1, MODE - 1])
        found[name] = float(np.sqrt(squares[0]) / omega - 1.0)
    return found


def test_consistent_and_lumped_mass_enclose_the_frequencies_of_a_bar() -> None:
    """Eq. (1) within 3 % on the finest bar, and fitted slopes of 4, 4 and 6."""
    found = {n: errors(n) for n in CELLS}
    for one in found.values():
        assert one["lumped"] < 0.0 < one["consistent"]
    leading = (WAVE_NUMBER * LENGTH / CELLS[-1]) ** 4
    assert found[CELLS[-1]]["consistent"] == pytest.approx(leading / 1440.0, rel=0.03)
    assert found[CELLS[-1]]["lumped"] == pytest.approx(-leading / 2880.0, rel=0.03)
    for name, order in (("consistent", 4.0), ("lumped", 4.0), ("blended", 6.0)):
        slope = np.polyfit(np.log(CELLS), np.log([abs(found[n][name]) for n in CELLS]), 1)[0]
        assert -slope == pytest.approx(order, abs=0.25), name
