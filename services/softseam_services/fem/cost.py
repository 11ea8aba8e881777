"""What FEM's steps are expected to cost, in microseconds of one core.

ITERATIONS of forces and a solve, and FACTORS factorisations: the cells' matrices, nested dissection of the region
(times of the order of its unknowns to the power 1.95, fitted from 216 to 3993 unknowns) and the dense front of the
seam's unknowns. While no tool is near, FEM takes RESTING iterations with the factor that it has, unless the body is
round.

The constants were measured once (docs/decisions/06).
"""

from softseam_protocol.scene.kinds import ElementKind
from softseam_services.solver_row import StepWork

ITERATIONS, ITERATION = 5.0, 4.4
"""Newton iterations an exchange; one costs so much a cell [us]"""
RESTING = 2.0
"""Newton iterations of a step while no tool is near: 1.5 of boxes of 8 to 125 cells that settle on the ground, 1.9 in
their first 60 steps, 2.3 of one that is dropped on it. A round body comes to lie on other points: 4.8, as in a grip"""
FACTORS, ASSEMBLY = 0.45, 9.4
"""factorisations an exchange; the matrix costs so much a cell [us]"""
DEARER: dict[ElementKind, tuple[float, float]] = {
    "hex27": (0.0, 0.0),
    "hex27_full": (5.0, 102.0),
    "hex27_reduced": (0.0, 0.0),
    "hex8": (2.5, 2.0),
    "hex8_bbar": (11.3, 80.0),
    "hex8_full": (7.5, 43.0),
    "hex8_reduced": (2.6, 1.0),
    "tet4": (10.3, 29.0),
    "tet4_fbar": (9.0, 58.0),
    "tet10": (3.2, 22.0),
}
"""what an iteration and a matrix of other elements cost more than hex27's (docs/reference/elements.md), a cell [us]"""
UNMEASURED = max(force for force, _ in DEARER.values()), max(matrix for _, matrix in DEARER.values())
"""the dearest of these, for elements from outside"""
FACTOR = 100.0 / 375.0**1.95
"""factor of n unknowns: FACTOR n^1.95 [us]"""
DENSE = 1.0 / 3.0 / 15e3
"""dense factor of n unknowns: DENSE n^3 [us], at 15 GFLOP/s"""


def of_cells(work: StepWork) -> float:
    """What its cells cost, in a grip [us]."""
    force, matrix = DEARER.get(work.models.fem.element, UNMEASURED)
    return work.n_cells * (ITERATIONS * (ITERATION + force) + FACTORS * (ASSEMBLY + matrix))


def of_equations(work: StepWork) -> float:
    """What solving its equations as a whole costs, in a grip [us]."""
    return float(FACTORS * (FACTOR * (3 * work.n_nodes) ** 1.95 + DENSE * work.n_coupled**3))


def at_rest(work: StepWork) -> float:
    """What its cells cost while no tool is near, of a body that is not round [us]."""
    force, _ = DEARER.get(work.models.fem.element, UNMEASURED)
    return work.n_cells * RESTING * (ITERATION + force)
