"""A body's turn in a step: found where the step begins, and given back where it ends (kernels/turning.py)."""

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.kernels.turning import (
    ANGULAR,
    LEAST_TURN,
    MASS,
    MOTION,
    N_SUMS,
    PLACE,
    SECOND,
    add_field,
    add_up,
    find_rest,
    find_turn,
    flatten,
    give_back,
    spin_and_inverse,
    torque_of,
    turning_rate,
)

Floats = NDArray[np.float64]


class Turning:
    """Of the n nodes of a body that nothing clamps; mass (n,) [kg]. A step is `begins`, `start`, then `end`.

    axis: of the one plane of symmetry, of which the nodes are one side; -1: none
    """

    def __init__(self, mass: Floats, axis: int = -1) -> None:
        self.mass, self._axis = mass, axis
        self.start_sums, self.end_sums = np.zeros(N_SUMS), np.zeros(N_SUMS)
        self._torque = np.zeros(3)
        self._before, self._after = np.zeros((3, 3)), np.zeros((3, 3))
        self._dt, self._slowed = 0.0, 1.0
        self.velocity = np.zeros((len(mass), 3))
        """with which the step begins in place of v, eq. (2) (n, 3) [m/s]"""

    def begins(self, x: Floats, v: Floats, dt: float, slowed: float = 1.0) -> bool:
        """Whether the body at x with v (n, 3) turns by enough in a step of dt [s]; slowed: s of a drag."""
        self._dt, self._slowed = dt, slowed
        rate: float = turning_rate(self.mass, x, v, self._axis, self.start_sums)
        self._after[:] = 0.0
        return rate * dt > LEAST_TURN

    def carry_on(self, x: Floats, v: Floats, share: float) -> None:
        """After `begins`: a share [1] of how S changed since nodes were at x with v (n, 3) comes once more."""
        self._see(x, v)
        spins = [spin_and_inverse(sums)[0] for sums in (self.start_sums, self.end_sums)]
        self.start_sums[ANGULAR:SECOND] += share * (spins[0] - spins[1])

    def start(self, x: Floats, v: Floats) -> Floats:
        """Eq. (2) of a step of implicit Euler from x with v: `velocity`."""
        find_turn(self.start_sums, self._dt, self._slowed, self._before, self._after)
        add_field(self._before, self.start_sums, x, v, self.velocity)
        return self.velocity

    def end(self, x: Floats, v: Floats, wrench: Floats, place: Floats) -> None:
        """Eq. (3) at the end x of the step, of v = (x1 - x0)/h, in place; without `start` of w_c alone.

        wrench (t, 6): of the body on tools at place (t, 3) [N, N m], over the step
        """
        self._see(x, v)
        torque_of(wrench, place, self._axis, self.end_sums, self._dt, self._torque)
        self._turn_on(self.start_sums, x, v)

    def of_whole(self, turn: Floats, dt: float) -> None:
        """In place of `begins`, of a part: `turn` (22,) is of the whole body, as of `Advance`."""
        self._dt, self._slowed = dt, 1.0
        self.start_sums[:] = turn[:N_SUMS]
        self._after[:] = 0.0

    def end_of_part(self, x: Floats, v: Floats) -> None:
        """Eq. (3) without w_c, which is the whole body's, about where its centre flies to."""
        self.end_sums[:] = self.start_sums
        self.end_sums[PLACE:MOTION] += self._dt * self.start_sums[MOTION:ANGULAR]
        add_field(self._after, self.end_sums, x, v, v)

    def end_of_substeps(
        self, start: tuple[Floats, Floats], x: Floats, v: Floats, dt: float, n_substeps: int, alone: bool
    ) -> bool:
        """w_c of eq. (3) after a step of dt [s] in so many substeps, of v in place; whether it was given.

        start: x and v before; alone: nothing acted from outside, so that what the sweeps made of a spin goes, too
        """
        given: bool = give_back(self.mass, *start, x, v, self._axis, dt, n_substeps, alone, np.zeros(3))
        return given

    def _see(self, x: Floats, v: Floats) -> None:
        add_up(self.mass, x, v, self.end_sums)
        flatten(self._axis, self.end_sums)

    def _turn_on(self, since: Floats, x: Floats, v: Floats) -> None:
        """Give v the spin of `since`, and the torque's."""
        find_rest(since, self.end_sums, self._torque, self._slowed, self._after)
        add_field(self._after, self.end_sums, x, v, v)

    def angular(self, x: Floats, v: Floats) -> Floats:
        """Angular momentum about the origin (3,) [kg m^2/s]."""
        return np.asarray(self.mass @ np.cross(x, v))

    @property
    def centre(self) -> Floats:
        """Of mass, at the end (3,) [m]."""
        return np.asarray(self.end_sums[PLACE:MOTION] / self.end_sums[MASS])

    def given(self, moment: Floats) -> float:
        """Work of forces f at the ends x of ways, beyond that along the chords of these [J]: what rolls on a floor
        comes down to it by h^2 w^2/2 of its radius a step, and goes up as much; moment (3, 3): sum of f (x - centre)^T
        [N m]."""
        return self._dt * float(np.sum(moment * self._after))

    def kinetic(self, v: Floats) -> float:
        """[J]"""
        return 0.5 * float(self.mass @ (v * v).sum(axis=1))


def with_change(turn: Floats, x: Floats, v: Floats) -> Floats:
    """Velocities (n, 3) [m/s] of nodes at x (n, 3) [m] with what `turn` (22,) says that they are to be given."""
    centre, (spin, shift) = turn[PLACE:MOTION] / turn[MASS], turn[N_SUMS:].reshape(2, 3)
    return np.asarray(v + np.cross(spin, x - centre) + shift)


def sums_of(mass: Floats, x: Floats, v: Floats) -> Floats:
    """Of nodes with masses (n,) [kg] at x (n, 3) [m] with velocities v (n, 3) [m/s], see `kernels.turning.add_up`."""
    sums = np.zeros(N_SUMS)
    add_up(mass, x, v, sums)
    return sums
