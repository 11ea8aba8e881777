"""What solvers offer by which the error of one number, the goal, is weighed, so that who weighs it knows no solver."""

from typing import Protocol

from softseam_protocol.messages.participant import BodyState
from softseam_services.body.body import Floats


class Adjoint(Protocol):
    """Of a whole body with N nodes, C cells and t tools: what every force on it does to a number J that is read off it.
    Where J changes by g . dx, and the body answers a force f with A dx = f: A z = g, dJ = z . f."""

    def factor(self, state: BodyState, position: Floats, orientation: Floats) -> bool:
        """Make A at a state of the body between tools at (t, 3) [m], (t, 4); False where A is not positive definite."""

    def solve(self, g: Floats) -> Floats:
        """z (N, 3) for g (N, 3), with the factor at hand; 0 at clamped nodes."""

    def push(self, direction: Floats) -> Floats:
        """g (N, 3) [N/m] of J = sum over tools of direction (t, 3) . force of the body on the tool."""

    def forces(self) -> Floats:
        """Forces of each cell on its nodes (C, 27, 3) [N] at the state of `factor`, which came just before."""

    def stress(self, x: Floats) -> Floats:
        """Cauchy stress of all octants at x (N, 3), xx yy zz yz xz xy (C, 8, 6) [Pa]."""


class MeshIndicator(Protocol):
    """What the cells of one region, n nodes and c cells, are off by because they are no smaller."""

    def product(self, x: Floats, cauchy: Floats, y: Floats, other: Floats) -> Floats:
        """int_e (sigma* - sigma)_x : C^-1 : (sigma* - sigma)_y dV (c,) [J] of the errors at positions x and y (n, 3),
        with the stresses that the cells report there, cauchy and other (c, 8, 6)."""


class ModelIndicator(Protocol):
    """What a model is off by in one region, n nodes, c cells and p surface points, beside finite elements there."""

    def pull(self, x: Floats) -> Floats:
        """What the model pulls the nodes with at x (n, 3) [m], in equilibrium with it (n, 3) [N]."""

    def measure(self, x: Floats, contact_force: Floats, *, bounded: bool) -> Floats:
        """Energy of its error in each cell (c,) [J] under contact forces (p, 3) [N]; bounded: at a bounded cost, and a
        little too small."""
