"""Bodies that interfaces join: their parts step together, in one loop over the rows of all interfaces.

Each body is one part. What holds between them is made anew as a step begins, from where their nodes are.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interface import Interface
from softseam_coupling.interfaces import KINDS, Kind
from softseam_coupling.loops.loop import Correction, First, LoopSetup, Outcome, PartRequest, StepDiverged, largest
from softseam_coupling.loops.one_way import OneWay
from softseam_protocol.messages.outcomes import Detail
from softseam_protocol.messages.participant import Advanced, Capabilities, Request, ToolMotion
from softseam_protocol.messages.session import InterfaceReport
from softseam_protocol.scene.interfaces import written_key
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.errors import SettingError
from softseam_services.body.kernels.turning import MASS, MOTION, PLACE
from softseam_services.orchestrator.archive import named, under
from softseam_services.orchestrator.body_turn import BodyTurn, keeps_momentum, turn_about_one_another
from softseam_services.orchestrator.clock import Clock
from softseam_services.orchestrator.meetings import meeting_of
from softseam_services.orchestrator.part_client import StepFailed
from softseam_services.orchestrator.participants import Kept
from softseam_services.orchestrator.parts import part_mesh, resting_state, side_mass
from softseam_services.orchestrator.simulated_body import SimulatedBody
from softseam_services.orchestrator.step_warnings import Tell
from softseam_services.orchestrator.subdivided_step import Subdivision, take_step
from softseam_services.orchestrator.transport import Transport
from softseam_services.server import Setup

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Arrays = dict[str, Floats]

_NO_ROWS = np.zeros((0, 3))


@dataclass(frozen=True)
class Between:
    """An interface of the scene: its bodies, and what makes its rows."""

    bodies: tuple[str, str]
    kind: Kind


def interfaces_of(scene: Scene, setups: Mapping[str, Setup], within: Collection[str]) -> dict[str, Between]:
    """The interfaces of a scene between bodies that are built, by name, but those within piles. Raises SettingError."""
    found = {}
    for name, spec in scene.interfaces.items():
        if name in within:
            continue
        a, b = (meeting_of(setups[body]) for body in spec.between)
        try:
            kind = KINDS[spec.kind](spec, a, b)
        except ValueError as error:
            raise SettingError(f"{written_key(name)}: {error}") from error
        for body, nodes, side in zip(spec.between, kind.nodes, (a, b), strict=True):
            if not len(nodes) or (np.diff(nodes) <= 0).any() or side.fixed[nodes].any():
                raise SettingError(
                    f"{written_key(name)}: it acts on no node of {body!r}, on one twice, or on one that is clamped: "
                    "give it nodes in ascending order that may move"
                )
        found[name] = Between(spec.between, kind)
    return found


def joints_of(body: str, interfaces: Mapping[str, Between]) -> Ints:
    """Nodes of a body on which any of the interfaces acts, ascending (j,)."""
    ends = [zip(each.bodies, each.kind.nodes, strict=True) for each in interfaces.values()]
    own = [nodes for pair in ends for name, nodes in pair if name == body]
    return np.unique(np.concatenate(own)).astype(np.int32) if own else np.zeros(0, dtype=np.int32)


class JoinedBodies:
    """An island of several bodies.

    scene       with all bodies
    bodies      in it, by name
    interfaces  between them, by name
    report      receives kind and text of every event
    """

    def __init__(
        self,
        scene: Scene,
        bodies: Mapping[str, SimulatedBody],
        interfaces: Mapping[str, Between],
        transport: Transport,
        clock: Clock,
        report: Tell,
    ) -> None:
        self.name = "+".join(bodies)
        self.members = {name: body.participants for name, body in bodies.items()}
        """who holds the part of each body"""
        self._scene = scene
        self._keeps = {name: keeps_momentum(body.setup.spec, body.scene.models) for name, body in bodies.items()}
        self._bodies = {name: cast(Body, body.body) for name, body in bodies.items()}
        self._interfaces, self._transport, self._clock, self._report = interfaces, transport, clock, report
        self._joints = {name: joints_of(name, interfaces) for name in bodies}
        self._mobility = {
            name: 1.0 / side_mass(body, np.arange(body.n_cells, dtype=np.int32))[self._joints[name]]
            for name, body in self._bodies.items()
        }
        self._start = {name: between.kind.save() for name, between in interfaces.items()}
        self.reports: dict[str, InterfaceReport] = {}
        """of the last step, by interface"""
        self._before: Arrays | None = None

    def begin(self) -> None:
        """The bodies stand at the start of the scene."""
        for name, between in self._interfaces.items():
            between.kind.load(self._start[name])
        self._x = {name: self._bodies[name].x_rest[nodes] for name, nodes in self._joints.items()}
        self._pace, self._turns = Subdivision(), {name: BodyTurn(keeps) for name, keeps in self._keeps.items()}
        for name, turn in self._turns.items():
            body, parts = self._bodies[name], self.members[name].parts
            meshes = [part_mesh(body, parts, part) for part in parts.names]
            turn.start(meshes, resting_state(body), self._clock.dt)
        self._tie()
        self._loop.begin(self._able())

    def _tie(self) -> None:
        self._loop = self._loop_of(self._rows(self._clock.dt))

    def _loop_of(self, interfaces: tuple[Interface, ...]) -> OneWay:
        """A loop that knows nothing of the parts yet."""
        cell = min(self._bodies[name].resolution for name in self.members)
        seam = self._scene.seam
        return OneWay(
            LoopSetup(
                interfaces=interfaces,
                mobility={self._part(name): self._mobility[name] for name in self.members},
                tolerance=seam.tolerance * cell,
                cell=cell,
                exchanges=seam.exchanges,
            )
        )

    def _able(self) -> dict[str, Capabilities]:
        return {part: able for member in self.members.values() for part, able in member.able.items()}

    def _part(self, body: str) -> str:
        (part,) = self.members[body].parts.names
        return part

    def _of(self, between: Between) -> tuple[Floats, Floats]:
        """Where the nodes are that an interface acts on (n_a, 3), (n_b, 3) [m]."""
        a, b = (self._x[body][self._places(body, nodes)] for body, nodes in _sides(between))
        return a, b

    def _places(self, body: str, nodes: Ints) -> Ints:
        return np.searchsorted(self._joints[body], nodes).astype(np.int32)

    def _rows(self, dt: float) -> tuple[Interface, ...]:
        """Of all interfaces, for a step of dt [s] from where the bodies are."""
        found = []
        for name, between in self._interfaces.items():
            rows = between.kind.rows(self._of(between), dt)
            parts = self._part(between.bodies[0]), self._part(between.bodies[1])
            a, b = (self._places(body, nodes) for body, nodes in _sides(between))
            found.append(
                Interface(
                    name,
                    parts,
                    (a, b),
                    rows.weights,
                    rows.offset,
                    rows.compliance,
                    rows.normal,
                    rows.friction,
                    rows.ids,
                )
            )
        return tuple(found)

    # ---- one step

    def advance(self, motion: ToolMotion, fields: bool, alone: bool) -> dict[str, Outcome]:
        """Advance all bodies by a step until they agree; where they will not, in parts of the step. Raises StepFailed.

        fields  ask for the fields with the correction
        alone   no other island may fail in this step, after which this one would be withdrawn
        """
        for member in self.members.values():
            member.make_ready()
        began, kept = self._arrays(), dict[str, Kept]()
        self._before = None if alone else began

        def keep() -> None:
            if not kept:
                kept.update({name: member.keep() for name, member in self.members.items()})
                self._loop.forget_sent()

        before = self._pace.parts
        self.reports = {}
        try:
            solution = take_step(
                self._pace, motion, self._clock.dt, lambda part, dt, may: self._advance(part, dt, fields, may), keep
            )
        except BaseException as error:
            for name, before_it in kept.items():
                self.members[name].go_back(before_it)
            self._take(began)
            if isinstance(error, StepDiverged):
                raise StepFailed(f"step {self._clock.step}: {error}") from error
            raise
        self._tell_of(solution, before)
        solutions = {}
        for name, member in self.members.items():
            own = {part: solution.replies[part] for part in member.parts.names}
            solutions[name] = replace(solution, replies=own, multipliers=_NO_ROWS, note="")
            member.joined_step(solutions[name], kept.get(name))
        return solutions

    def _advance(self, motion: ToolMotion, dt: float, fields: bool, may_cut: bool) -> Outcome:
        interfaces = self._rows(dt)
        self._loop.renew(interfaces)
        turns = {name: turn.said for name, turn in self._turns.items()}

        def ask(wanted: dict[str, PartRequest]) -> dict[str, Advanced]:
            requests: dict[str, Request] = {}
            for name, member in self.members.items():
                requests |= member.asked(wanted, dt, motion, False, turns[name])
            return self._read(requests)

        def correct(corrections: dict[str, Correction], first: First) -> dict[str, Advanced]:
            requests: dict[str, Request] = {}
            for member in self.members.values():
                requests |= member.corrected(corrections, fields)
            return self._read(requests)

        solution = self._loop.solve(ask, correct, dt, may_cut)
        replies = dict(solution.replies)
        forces = self._forces(interfaces, solution.multipliers)
        after = {name: replies[self._part(name)].coupling.x for name in self.members}
        began = [turn.sums.copy() for turn in self._turns.values()]
        for name, member in self.members.items():
            part = self._part(name)
            joint = {part: (self._x[name], after[name], forces[name])}
            own = {part: replies[part]}
            gravity = np.array(self._scene.gravity)
            replies |= self._turns[name].end(own, member.parts.models, motion, dt, gravity, joint)
            member.end_step()
        ended = [turn.sums for turn in self._turns.values()]
        models = {part: model for each in self.members.values() for part, model in each.parts.models.items()}
        turn, centre = turn_about_one_another(began, ended, solution.replies, models, motion, dt)
        if turn.any():
            for name, one in self._turns.items():
                part = self._part(name)
                shift = np.cross(turn, one.sums[PLACE:MOTION] / one.sums[MASS] - centre)
                replies |= one.turned_with({part: replies[part]}, turn, shift)
        self._commit(interfaces, solution, after, dt)
        return replace(solution, replies=replies)

    def _read(self, requests: dict[str, Request]) -> dict[str, Advanced]:
        replies = self._transport.exchange(requests)
        return {part: reply for member in self.members.values() for part, reply in member.read(replies).items()}

    def _forces(self, interfaces: tuple[Interface, ...], multipliers: Floats) -> Arrays:
        """What interfaces do to the coupling nodes of each body (j, 3) [N]."""
        forces = {name: np.zeros((len(nodes), 3)) for name, nodes in self._joints.items()}
        for interface, own in zip(interfaces, _split(interfaces, multipliers), strict=True):
            bodies = self._interfaces[interface.name].bodies
            for body, places, weights, sign in zip(
                bodies, interface.nodes, interface.weights, (1.0, -1.0), strict=True
            ):
                forces[body][places] += sign * (own if weights is None else weights.T @ own)
        return forces

    def _commit(self, interfaces: tuple[Interface, ...], solution: Outcome, after: Arrays, dt: float) -> None:
        """A step of dt [s], perhaps a part of one, came to these places of the coupling nodes (j, 3) [m]."""
        before = {name: self._of(between) for name, between in self._interfaces.items()}
        self._x = after
        for interface, own in zip(interfaces, _split(interfaces, solution.multipliers), strict=True):
            between = self._interfaces[interface.name]
            x = self._of(between)
            between.kind.commit(x, own, dt)
            moved = [now - then for now, then in zip(x, before[interface.name], strict=True)]
            a, b = (m if w is None else w @ m for m, w in zip(moved, interface.weights, strict=True))
            work = float(np.vdot(own, a - b))
            force = own.sum(axis=0) * (dt / self._clock.dt)  # of a part of a step: its share of the mean
            last = self.reports.get(interface.name)
            if last is not None:
                work, force = work + last.work, force + last.total
            sizes = solution.gap, solution.exchanges, interface.n_rows, largest(own), work
            self.reports[interface.name] = InterfaceReport(*sizes, *force.tolist())

    def _tell_of(self, solution: Outcome, before: int) -> None:
        """Tell where the step was taken in parts, or a gap was kept."""
        note, gap = solution.note, f"gap {1e6 * solution.gap:.3g} um"
        names = ", ".join(self.members)
        if solution.parts > 1 and (note or self._pace.parts != before):
            text = f"taken in {solution.parts} parts, {solution.exchanges} exchanges, {gap}{': ' if note else ''}{note}"
            details = [Detail.PARTS, *([Detail.GAP_KEPT] if note else [])]
            self._report("seam", f"step {self._clock.step}, {names}: {text}", *details)
        elif note:
            text = f"{gap} after {solution.exchanges} exchanges is kept: {note}"
            self._report("seam", f"step {self._clock.step}, {names}: {text}", Detail.GAP_KEPT)

    def rests(self, asleep: Collection[str]) -> bool:
        """Whether none of its bodies is to take the next step; asleep: names of those that sleep."""
        return not self.members.keys().isdisjoint(asleep)

    def rest(self) -> None:
        """The bodies sleep from now on: their interfaces do no work."""
        self.reports = {name: replace(report, work=0.0, exchanges=0) for name, report in self.reports.items()}

    def withdraw(self) -> None:
        """Take the step back that was taken last: it failed elsewhere."""
        assert self._before is not None
        for member in self.members.values():
            member.withdraw()
        self._take(self._before)

    # ---- snapshots

    def forget_sent(self) -> None:
        """The parts took a snapshot."""
        self._loop.forget_sent()

    def save(self) -> Arrays:
        """Everything that evolves, after the bodies have saved themselves."""
        self._loop.forget_sent()
        return self._arrays()

    def check(self, arrays: Mapping[str, Floats]) -> None:
        """Raise KeyError or ValueError where a state is not this island's; changes nothing."""
        kinds = {name: between.kind.save() for name, between in self._interfaces.items()}
        for name, nodes in self._joints.items():
            if arrays[f"x.{name}"].shape != (len(nodes), 3):
                raise ValueError(f"the saved interfaces do not act on {len(nodes)} nodes of {name!r}")
            BodyTurn().take(arrays[f"turn.{name}"])
        Subdivision().take(arrays["pace"].tolist())
        self._loop_of(self._rows(self._clock.dt)).take(named(arrays, "loop."))
        try:
            for name, between in self._interfaces.items():
                between.kind.load(named(arrays, f"interface.{name}."))
        finally:
            for name, between in self._interfaces.items():
                between.kind.load(kinds[name])

    def load(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `save`, after the bodies. Raises KeyError or ValueError where it is of others."""
        self._tie()
        self._take(arrays)

    def _arrays(self) -> Arrays:
        """All that evolves, in arrays that nobody writes to."""
        found = under("loop.", self._loop.to_arrays()) | under("x.", self._x)
        found |= {f"turn.{name}": turn.to_array() for name, turn in self._turns.items()}
        for name, between in self._interfaces.items():
            found |= {f"interface.{name}.{key}": array.copy() for key, array in between.kind.save().items()}
        return found | {"pace": np.array(self._pace.to_list(), dtype=np.float64)}

    def _take(self, arrays: Mapping[str, Floats]) -> None:
        for name in self._joints:
            self._x[name] = np.array(arrays[f"x.{name}"])
        for name, turn in self._turns.items():
            turn.take(arrays[f"turn.{name}"])
        for name, between in self._interfaces.items():
            between.kind.load(named(arrays, f"interface.{name}."))
        self._pace.take(arrays["pace"].tolist())
        self._loop.take(named(arrays, "loop."))
        self._loop.begin(self._able())
        self._loop.forget_sent()


def _sides(between: Between) -> list[tuple[str, Ints]]:
    """Each body of an interface with the nodes of it."""
    return list(zip(between.bodies, between.kind.nodes, strict=True))


def _split(interfaces: tuple[Interface, ...], multipliers: Floats) -> list[Floats]:
    """Multipliers of all rows, by interface."""
    return np.split(multipliers, np.cumsum([each.n_rows for each in interfaces])[:-1])
