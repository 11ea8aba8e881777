"""Which regions are given back what steps lose of a rotation."""

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats
from softseam_services.body.kernels.turning import ANGULAR, MOTION, N_SUMS, PLACE, SECOND, add_up, find_rest, find_turn
from softseam_services.body.turning import Turning

from .differential import Differential
from .face_forces import point_positions
from .integrators.bdf2 import kept_on
from .integrators.scheme import BDF2, STATIC, SYMPLECTIC_EULER, Scheme
from .kernels.contact_columns import FORCE
from .model import FemModel
from .parameters import FemParameters
from .state import FemState
from .structures import Tables


def free_to_turn(kind: int, model: FemModel, parameters: FemParameters) -> Turning | None:
    """What gives a rotation back; None of a region that is held, whose law knows no turns, or whose integrator, of this
    kind, loses nothing."""
    planes = np.unique(model.rollers[:, 1])
    held = len(planes) > 1 or bool((model.order < 0).any())
    if held or model.linear or kind in (STATIC, SYMPLECTIC_EULER):
        return None
    return Turning(parameters.mass, int(planes[0]) if len(planes) else -1)


def begins(turning: Turning, scheme: Scheme, now: FemState, dt: float) -> bool:
    """Whether a step of dt [s] of a whole region is given its rotation back.

    Integrators with a history weigh the torques of several steps. So with them only a body that flies is: BDF2's spin
    goes on as its momentum does, by eq. (1) of integrators/bdf2.py without forces, that of generalised-alpha stays.
    """
    slowed = 1.0 + scheme.parameters[0] * scheme.drag * dt
    if not turning.begins(now.x, now.v, dt, slowed):
        return False
    if not scheme.n_history:
        return True
    if now.contact[:, :, FORCE : FORCE + 3].any():
        return False
    if scheme.kind == BDF2 and now.past:
        turning.carry_on(now.history[0], now.history[1], kept_on(dt, now.past))
    return True


Complexes = NDArray[np.complex128]

_TINY = 1e-30
"""complex step: its square is nothing beside any sum"""


class TurningDerivative:
    """Of the step looked at last, of length dt [s], of a whole body that nothing clamps."""

    def __init__(self, turning: Turning, tables: Tables, dt: float) -> None:
        self._turning, self._tables, self._dt = turning, tables, dt

    def look(self, now: FemState, end: FemState) -> FemState | None:
        """The start with the velocity that the step began with; None where nothing was given back in it."""
        turning, dt = self._turning, self._dt
        if not turning.begins(now.x, now.v, dt):
            return None
        begun = now.copy()
        begun.v[:] = turning.start(now.x, now.v)
        self._now, self._end = now, end
        self._start_sums = turning.start_sums.copy()
        self._raw = (end.x - now.x) / dt
        self._sums = np.zeros(N_SUMS)
        add_up(turning.mass, end.x, self._raw, self._sums)
        self._force = end.contact[:, :, :3].sum(axis=1)
        self._centre, self._middle = self._start_sums[PLACE:MOTION] / self._mass, self._sums[PLACE:MOTION] / self._mass
        self._point_x = point_positions(self._tables.model, self._tables.parameters, end.x)
        torque = dt * np.cross(self._point_x - self._middle, self._force).sum(axis=0)
        self._before, self._after = np.zeros((3, 3)), np.zeros((3, 3))
        inputs = np.concatenate([self._start_sums, self._sums, torque])
        self._by_start, self._by_end = np.empty((9, N_SUMS)), np.empty((9, len(inputs)))
        for at in range(len(inputs)):
            moved = inputs.astype(np.complex128)
            moved[at] += 1j * _TINY
            before, after = self._matrices(moved)
            self._by_end[:, at] = after.imag.ravel() / _TINY
            if at < N_SUMS:
                self._by_start[:, at] = before.imag.ravel() / _TINY
        self._before[:], self._after[:] = before.real, after.real
        return begun

    @property
    def _mass(self) -> float:
        return float(self._turning.start_sums[0])

    def _matrices(self, inputs: Complexes) -> tuple[Complexes, Complexes]:
        """G and D (3, 3) by the sums at the start, at the end, and the torque."""
        before, after = np.zeros((2, 3, 3), dtype=inputs.dtype)
        start, sums, torque = np.split(inputs, [N_SUMS, 2 * N_SUMS])
        find_turn(start, self._dt, 1.0, before, after)
        find_rest(start, sums, torque, 1.0, after)
        return before, after

    # ---- the adjoint

    def end_back(self, owed: Differential) -> None:
        """What v1 owes goes over to u, x1 and forces, in place; what is owed to sums at the start is kept."""
        arms = self._end.x - self._middle
        by_inputs = self._by_end.T @ (owed.v.T @ arms).ravel()
        self._owed_sums, sums, torque = np.split(by_inputs, [N_SUMS, 2 * N_SUMS])
        push = self._dt * torque
        at_points = np.cross(self._force, push)
        sums[PLACE:MOTION] -= (self._after.T @ owed.v.sum(axis=0) + at_points.sum(axis=0)) / self._mass
        lever = np.cross(push, self._point_x - self._middle)
        owed.force[:] += np.where(self._end.contact[:, :, :3].any(axis=2, keepdims=True), lever[:, None], 0.0)
        owed.x[:] += owed.v @ self._after + self._from_points(at_points)
        x, v = self._pull_sums(sums, self._end.x, self._raw)
        owed.x[:] += x
        owed.v[:] += v

    def start_back(self, owed: Differential) -> None:
        """What the step's velocity owes goes over to x0 and v0, with what is owed to sums, in place."""
        sums = self._owed_sums + self._by_start.T @ (owed.v.T @ (self._now.x - self._centre)).ravel()
        sums[PLACE:MOTION] -= self._before.T @ owed.v.sum(axis=0) / self._mass
        x, v = self._pull_sums(sums, self._now.x, self._now.v)
        owed.x[:] += owed.v @ self._before + x
        owed.v[:] += v

    def _pull_sums(self, sums: Floats, x: Floats, v: Floats) -> tuple[Floats, Floats]:
        """What sums owe to x and v (n, 3)."""
        mass, angular, (a, b, c, d, e, f) = self._turning.mass[:, None], sums[ANGULAR:SECOND], sums[SECOND:].tolist()
        second = np.array([[2.0 * a, f, e], [f, 2.0 * b, d], [e, d, 2.0 * c]])
        by_x = mass * (sums[PLACE:MOTION] + np.cross(v, angular) + x @ second)
        return by_x, mass * (sums[MOTION:ANGULAR] + np.cross(angular, x))

    def _from_points(self, at_points: Floats) -> Floats:
        """What points owe (p, 3) to nodes (n, 3)."""
        model, weight = self._tables.model, self._tables.parameters.point_weight
        rows = np.repeat(np.arange(len(at_points)), np.diff(model.point_ptr))
        out = np.zeros_like(self._now.x)
        np.add.at(out, model.point_node, weight[:, None] * at_points[rows])
        return out

    # ---- forward

    def start_forward(self, change: Differential) -> None:
        """change.v of v0 becomes that of the step's velocity, in place; that of the sums is kept."""
        self._changed = self._push_sums(self._now.x, self._now.v, change.x, change.v)
        turned = (self._by_start @ self._changed).reshape(3, 3)
        arms = change.x - self._changed[PLACE:MOTION] / self._mass
        change.v[:] += (self._now.x - self._centre) @ turned.T + arms @ self._before.T

    def end_forward(self, change: Differential) -> None:
        """change.v of u becomes that of v1, in place."""
        sums = self._push_sums(self._end.x, self._raw, change.x, change.v)
        moved = sums[PLACE:MOTION] / self._mass
        went = point_positions(self._tables.model, self._tables.parameters, change.x) - moved
        torque = np.cross(went, self._force) + np.cross(self._point_x - self._middle, change.force.sum(axis=1))
        inputs = np.concatenate([self._changed, sums, self._dt * torque.sum(axis=0)])
        turned = (self._by_end @ inputs).reshape(3, 3)
        change.v[:] += (self._end.x - self._middle) @ turned.T + (change.x - moved) @ self._after.T

    def _push_sums(self, x: Floats, v: Floats, by_x: Floats, by_v: Floats) -> Floats:
        """Change of the sums of x and v by theirs (N_SUMS,)."""
        mass, y, z = self._turning.mass, [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]
        angular = mass @ (np.cross(by_x, v) + np.cross(x, by_v))
        second = mass @ (x[:, y] * by_x[:, z] + by_x[:, y] * x[:, z])
        return np.concatenate([[0.0], mass @ by_x, mass @ by_v, angular, second])
