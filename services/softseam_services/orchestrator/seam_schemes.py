"""What ties two sides as a scene asks for: the scheme and its solver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.accelerated import AcceleratedSeam
from softseam_coupling.accelerations.aitken import Aitken
from softseam_coupling.accelerations.constant import Constant
from softseam_coupling.accelerations.iqn_ils import IqnIls
from softseam_coupling.accelerations.memory import Acceleration
from softseam_coupling.interface import Interface
from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import SeamSolver
from softseam_protocol.scene.kinds import SeamAcceleration
from softseam_protocol.scene.regions import SeamSpec
from softseam_services.body.body import Body
from softseam_services.orchestrator.accelerated_seam import AccelerationLoop
from softseam_services.orchestrator.one_way_seam import OneWaySeam
from softseam_services.orchestrator.ramped_seam import RampedSeam
from softseam_services.orchestrator.seam_answers import SeamScheme
from softseam_services.orchestrator.sides import Sides, side_mass
from softseam_services.orchestrator.staggered_seam import StaggeredSeam

Floats = NDArray[np.float64]

_ACCELERATIONS: dict[SeamAcceleration, type[Acceleration]] = {
    "iqn_ils": IqnIls,
    "aitken": Aitken,
    "constant": Constant,
}


def build_seam_solver(acceleration: SeamAcceleration, tolerance: float) -> SeamSolver:
    """With both sides' compliance, or with none; tolerance of the gap [m]."""
    if acceleration == "exact":
        return SeamSolver(tolerance=tolerance)
    return AcceleratedSeam(tolerance=tolerance, acceleration=_ACCELERATIONS[acceleration]())


def build_scheme(
    seam: SeamSpec,
    solver: SeamSolver,
    body: Body,
    sides: Sides,
    tie: SeamTie,
    first: Floats | None,
) -> SeamScheme:
    """For one epoch.

    first  multiplier that belongs to the sides' state (s, 3) [N], zero if absent
    """
    if seam.scheme == "staggered":
        return StaggeredSeam(solver, tie, first, seam.exchanges)
    mobility = {name: 1.0 / side_mass(body, sides.cells[name])[sides.seam] for name in (sides.near, sides.far)}
    other = mobility[sides.far] if tie.p is None else tie.p**2 @ mobility[sides.far]
    both = np.repeat(mobility[sides.near] + other, 3)
    if seam.scheme == "ph":
        return RampedSeam(solver, tie, both, first, seam.exchanges)
    if isinstance(solver, AcceleratedSeam):
        return AccelerationLoop(solver, tie, both, first, seam.exchanges)
    nodes = np.arange(len(sides.seam), dtype=np.int32)
    interface = Interface(sides.interface, (sides.near, sides.far), (nodes, nodes), (None, tie.p), tie.c)
    return OneWaySeam(interface, mobility, solver.tolerance, body.resolution, first, seam.exchanges)
