"""What ties two sides as a scene asks for: the scheme and its solver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.accelerated import AcceleratedSeam
from softseam_coupling.accelerations.aitken import Aitken
from softseam_coupling.accelerations.constant import Constant
from softseam_coupling.accelerations.iqn_ils import IqnIls
from softseam_coupling.accelerations.memory import Acceleration
from softseam_coupling.mortar import SeamTie
from softseam_coupling.seam import SeamSolver
from softseam_protocol.kinds import SeamAcceleration
from softseam_protocol.scene_regions import SeamSpec
from softseam_services.body.body import Body
from softseam_services.orchestrator.ramped_seam import RampedSeam
from softseam_services.orchestrator.seam_answers import SeamScheme
from softseam_services.orchestrator.seam_loop import SeamLoop
from softseam_services.orchestrator.sides import FAR, NEAR, Sides, side_mass
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
    begun: tuple[Floats, Floats] | None,
) -> SeamScheme:
    """For one epoch.

    first  multiplier that belongs to the sides' state (s, 3) [N], zero if absent
    begun  of that state, where the seam's nodes are, and by how much they move in a step (s, 3) [m]
    """
    if seam.scheme == "staggered":
        return StaggeredSeam(solver, tie, first, seam.exchanges)
    free = _mobility(body, sides, tie)
    if seam.scheme == "ph":
        return RampedSeam(solver, tie, free, first, seam.exchanges)
    loop = SeamLoop(solver, tie, free, first, sides.models[NEAR] == "fem", seam.exchanges)
    if begun is not None:
        loop.begin(*begun)
    return loop


def _mobility(body: Body, sides: Sides, tie: SeamTie) -> Floats:
    """1/mass of the seam's nodes on both sides (3s,) [1/kg]: times dt^2 the diagonal of the compliance, if nodes were
    alone; stiff bodies yield less."""
    near, far = (1.0 / side_mass(body, sides.cells[name])[sides.seam] for name in (NEAR, FAR))
    return np.repeat(near + (far if tie.p is None else tie.p**2 @ far), 3)
