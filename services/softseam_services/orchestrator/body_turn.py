"""What steps lose of the rotation of a body in several parts, which is the body's and no part's.

Each part tells sums over its nodes (body/kernels/turning.py). As a step begins, all learn those of the whole, by whose
turn FEM predicts, and by what velocities are off after the step before: w_c about the centre and v_c, with which spin
and momentum change by what acts from outside alone. Whether a body turns is seen a step late, for the step that follows
may have begun with the correction of the one before (`StepAhead`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Advanced, BodyState, Fields, PartMesh, ToolMotion
from softseam_protocol.models import facts_of
from softseam_protocol.scene.bodies import AnyBody
from softseam_protocol.scene.models import ModelsSpec
from softseam_services.body.kernels.turning import (
    ANGULAR,
    LEAST_TURN,
    MASS,
    MOTION,
    N_SUMS,
    PLACE,
    SECOND,
    rate_of,
    spin_and_inverse,
)
from softseam_services.body.turning import sums_of, with_change

Floats = NDArray[np.float64]

Joint = tuple[Floats, Floats, Floats]
"""nodes on which other bodies act, as a step begins and as it ends, and the forces there (n, 3) [m], [m], [N]"""

_NOTHING = np.zeros(0)
_N_CHANGE = 6
_SQUEEZED = 0.25
"""of a tilt: by more than that a body is turned by what squeezes it [1]"""
_FALLS = 0.1
"""by more than that in a step, where what squeezes it turns it by more than it is tilted, a body falls over [rad]"""


class BodyTurn:
    """Of one body in parts; sums that are NaN: it is not followed.

    may  whether it is to be, see `keeps_momentum`
    """

    def __init__(self, may: bool = False) -> None:
        self._may, self._sums, self._change = may, np.full(N_SUMS, np.nan), np.zeros(_N_CHANGE)
        self._turns = False

    def start(self, meshes: Iterable[PartMesh | None], state: BodyState, dt: float) -> None:
        """The parts begin with this state of the whole body, with steps of dt [s]."""
        self._sums, self._change, self._turns = np.full(N_SUMS, np.nan), np.zeros(_N_CHANGE), False
        parts = list(meshes)
        known = [part for part in parts if part is not None and not part.fixed.any()]
        if len(known) < len(parts) or not self._may:
            return
        self._sums = np.zeros(N_SUMS)
        for part in known:
            self._sums += sums_of(part.mass, state.x[part.nodes], state.v[part.nodes])
        self._turns = self._is_turning(dt)

    def _is_turning(self, dt: float) -> bool:
        return bool(np.isfinite(self._sums[MASS]) and dt * rate_of(self._sums) > LEAST_TURN)

    def _squeeze(self, joints: Mapping[str, Joint] | None, dt: float) -> float:
        """By how much of what it is tilted forces on its joints turn it in a step of dt [s], as they stay in their
        direction [1]. What it is given back of such a turn shakes it, from `_SQUEEZED` on."""
        centre, (_, inverse) = self._sums[PLACE:MOTION] / self._sums[MASS], spin_and_inverse(self._sums)
        squeeze = -sum(float(np.vdot(ended - centre, force)) for _, ended, force in (joints or {}).values())
        return squeeze * dt * dt * float(np.trace(inverse)) / 3.0

    def longest_step(self, joints: Mapping[str, Joint], dt: float) -> float | None:
        """Where a step of dt [s] ended in which forces on its joints, which stay in their direction, threw it over: in
        which step they would turn it by no more than it is tilted [s]."""
        if not np.isfinite(self._sums[MASS]) or dt * rate_of(self._sums) < _FALLS:
            return None
        squeeze = self._squeeze(joints, dt)
        return dt / squeeze**0.5 if squeeze > 1.0 else None

    @property
    def said(self) -> Floats:
        """What parts are told of it as a step begins, see `Advance.turn`."""
        return np.concatenate([self._sums, self._change]) if self._turns or self._change.any() else _NOTHING

    def may_go_ahead(self, dt: float) -> bool:
        """Whether the step after the coming one is told nothing."""
        return not (self._turns or self._is_turning(dt))

    def end(
        self,
        replies: Mapping[str, Advanced],
        models: Mapping[str, str],
        motion: ToolMotion,
        dt: float,
        gravity: Floats,
        joints: Mapping[str, Joint] | None = None,
        moment: Floats | None = None,
    ) -> dict[str, Advanced]:
        """A step was taken: the replies, with momenta and energies as the next step makes them.

        joints  what other bodies did to each part
        moment  of that about the world's origin, where these bodies know it better (3,) [N m]
        """
        turns, start = self._turns, self._sums
        told = dict(replies)
        self._turns, self._change = self._is_turning(dt), np.zeros(_N_CHANGE)
        if not np.isfinite(start[MASS]) or not all(len(reply.coupling.sums) for reply in replies.values()):
            self._sums, self._turns = np.full(N_SUMS, np.nan), False
            return told
        self._sums = np.sum([reply.coupling.sums for reply in replies.values()], axis=0)
        if not turns and (moment is None or (not self._is_turning(dt) and self._squeeze(joints, dt) > _SQUEEZED)):
            return told
        mass, end = start[MASS], self._sums
        before, centre = start[PLACE:MOTION] / mass, end[PLACE:MOTION] / mass
        push, torque = of_tools(replies, models, motion, before, centre)
        push = push + mass * gravity
        acts = push
        for name, (began, ended, force) in ({} if joints is None else joints).items():
            at = (
                ended - centre
                if facts_of(models[name]).forces_at_end
                else 0.5 * (began + ended) - 0.5 * (before + centre)
            )
            push = push + force.sum(axis=0)
            torque = torque + (np.cross(at, force).sum(axis=0) if moment is None else 0.0)
        if moment is not None:  # the body's place took up what the force as a whole turns where the step began
            torque = torque + moment - np.cross(before, push - acts)
        momentum = start[MOTION:ANGULAR] + dt * push
        spin, _ = spin_and_inverse(start)
        found, inverse = spin_and_inverse(end)
        turn, shift = inverse @ (spin + dt * torque - found), (momentum - end[MOTION:ANGULAR]) / mass
        self._change = np.concatenate([turn, shift])
        self._sums = end.copy()
        self._sums[MOTION:ANGULAR] = momentum
        self._sums[ANGULAR:SECOND] = spin + dt * torque + np.cross(centre, momentum)
        return {name: _changed(reply, centre, turn, shift) for name, reply in told.items()}

    @property
    def sums(self) -> Floats:
        """Of all its nodes, as the next step makes them; NaN: it is not followed."""
        return self._sums

    def turned_with(self, replies: Mapping[str, Advanced], turn: Floats, shift: Floats) -> dict[str, Advanced]:
        """The replies where the body is given this angular velocity about its centre [rad/s], and velocity [m/s]."""
        mass, centre = self._sums[MASS], self._sums[PLACE:MOTION] / self._sums[MASS]
        self._change, self._turns = self._change + np.concatenate([turn, shift]), True
        self._sums[MOTION:ANGULAR] += mass * shift
        self._sums[ANGULAR:SECOND] += np.linalg.inv(spin_and_inverse(self._sums)[1]) @ turn + mass * np.cross(
            centre, shift
        )
        return {name: _changed(reply, centre, turn, shift) for name, reply in replies.items()}

    def seen(self, fields: dict[str, Fields]) -> dict[str, Fields]:
        """The parts' fields, with velocities that the next step begins with."""
        said = self.said
        if not len(said):
            return fields
        return {name: replace(one, v=with_change(said, one.x, one.v)) for name, one in fields.items()}

    def to_array(self) -> Floats:
        """All of it, for a snapshot."""
        return np.concatenate([self._sums, self._change, [float(self._turns)]])

    def take(self, array: Floats) -> None:
        """Continue from `to_array`. Raises ValueError where this is of something else."""
        if array.shape != (N_SUMS + _N_CHANGE + 1,):
            raise ValueError("it does not tell how the body turns")
        self._sums, self._change, self._turns = array[:N_SUMS].copy(), array[N_SUMS:-1].copy(), bool(array[-1])


def of_tools(
    replies: Mapping[str, Advanced], models: Mapping[str, str], motion: ToolMotion, before: Floats, centre: Floats
) -> tuple[Floats, Floats]:
    """Force (3,) [N] of the tools on parts that answered so, and its torque about their centre [N m], which goes from
    `before` to `centre` (3,) [m]. FEM's forces act as a step ends, XPBD's over it."""
    push, torque = np.zeros(3), np.zeros(3)
    for name, reply in replies.items():
        arm = motion.position_next - centre
        if not facts_of(models[name]).forces_at_end:
            arm = 0.5 * (motion.position + motion.position_next) - 0.5 * (before + centre)
        push = push - reply.wrench[:, :3].sum(axis=0)
        torque -= (reply.wrench[:, 3:] + np.cross(arm, reply.wrench[:, :3])).sum(axis=0)
    return push, torque


def turn_about_one_another(
    begun: Sequence[Floats],
    ended: Sequence[Floats],
    replies: Mapping[str, Advanced],
    models: Mapping[str, str],
    motion: ToolMotion,
    dt: float,
) -> tuple[Floats, Floats]:
    """What bodies that are joined lose of their turning about their common centre in a step of dt [s]: an angular
    velocity that gives it back [rad/s], and that centre [m].

    Each body's momentum is right, and its spin; but its place goes by the velocity that the step ends with, and forces
    between models act at other times of it. begun, ended: sums of each body, as the step began and ended.
    """
    first, last = np.sum(begun, axis=0), np.sum(ended, axis=0)
    none = np.zeros(3)
    if not (np.isfinite(last).all() and dt * rate_of(first) > LEAST_TURN):
        return none, none
    before, centre = first[PLACE:MOTION] / first[MASS], last[PLACE:MOTION] / last[MASS]
    _, torque = of_tools(replies, models, motion, before, centre)
    spin, _ = spin_and_inverse(first)
    found, inverse = spin_and_inverse(last)
    return inverse @ (spin + dt * torque - found), centre


def keeps_momentum(spec: AnyBody, models: ModelsSpec) -> bool:
    """Whether nothing but tools and gravity acts on the body, by steps that have no memory of velocities, and its laws
    know turns."""
    if any(material.kind == "linear" for material in spec.cell_materials):
        return False
    drag = spec.said("damping", 0.0) if spec.has_cells else 0.0
    return drag == 0.0 and models.pbd.damping.mass == 0.0 and models.fem.integrator == "implicit_euler"


def _changed(reply: Advanced, centre: Floats, turn: Floats, shift: Floats) -> Advanced:
    """The reply of a part whose nodes go by turn x (x - centre) + shift faster."""
    sums = reply.coupling.sums
    mass, place, motion = sums[MASS], sums[PLACE:MOTION], sums[MOTION:ANGULAR]
    a, b, c, d, e, f = sums[SECOND:]
    second = np.array([[a, f, e], [f, b, d], [e, d, c]])
    offset = shift - np.cross(turn, centre)  # the field is turn x x + offset
    inertia = np.trace(second) * np.eye(3) - second
    by_field = np.cross(turn, place) + mass * offset
    moment = inertia @ turn + np.cross(place, offset)
    power = turn @ sums[ANGULAR:SECOND] + offset @ motion
    again = 0.5 * (turn @ inertia @ turn + 2.0 * offset @ np.cross(turn, place) + mass * offset @ offset)
    return replace(
        reply,
        kinetic=reply.kinetic + float(power + again),
        momentum=reply.momentum + by_field,
        angular_momentum=reply.angular_momentum + moment,
    )
