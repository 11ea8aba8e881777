"""A pile: whole bodies that one solver holds in one set of arrays. One kernel advances them, each as if it were alone.

The states of all lie in one buffer, body after body, and so do their scratch positions, sums and wrenches. Those that
touch one another are at the same substep (`kernels.group`), with the contacts between them (`between`).
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Detail, Figure, Status
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    BodyState,
    Capabilities,
    Correct,
    Coupled,
    Fields,
)
from softseam_protocol.messages.pile import Begun, Meetings, Members, Note, Push
from softseam_protocol.participant.state import join_states, split_states
from softseam_services.body.body import Floats
from softseam_services.body.kernels.bounds import bound_points
from softseam_services.body.sampled_faces import SampledFaces
from softseam_services.request_check import problem_of

from . import watch
from .between import Between
from .guests import Guests
from .kernels import pile as of_pile
from .kernels import summary as k
from .kernels import trust
from .kernels.block import new_workspace
from .kernels.group import advance_touching
from .kernels.thread_team import new_team
from .pile_pieces import Piece, Pieces
from .records import PbdState, decode_state, encode_state, new_inputs
from .step import NO_FORCES, StepInputs, place_tools, share_out, start_state, stay, step
from .surfaces import Contact

if TYPE_CHECKING:  # which builds by the row that names this file
    from softseam_services.server import Setup

Integers = NDArray[np.int64]
_WHY = {of_pile.LAGGED: watch.GROWS, of_pile.FED: watch.FEEDS}
"""why a step is made again that may be believed"""


class PileSolver:
    """Whole bodies with the same tools, each a region. Implements `Solver`."""

    def __init__(
        self,
        setups: Sequence[Setup],
        states: Sequence[BodyState],
        contacts: Mapping[str, Contact] | None = None,
        guests: Sequence[SampledFaces] = (),
    ) -> None:
        """states: of each; empty: all at rest. contacts: between them, by the names of the interfaces. guests: of
        bodies of other models that these meet, too"""
        self._dt = setups[0].scene.step
        self._all = Pieces(setups)
        self.pieces = self._all.each
        """in the order of the bodies"""
        self._cut = [number for number, piece in enumerate(self.pieces) if piece.body.cut]
        self._relaxing = [number for number, piece in enumerate(self.pieces) if piece.parameters.blocks.branches]
        self._n_tools = self.pieces[0].model.n_tools
        self._now = 0  # which of each piece's states is committed
        self._tentative = False
        b = len(self.pieces)
        self._inputs, self._team, self._ws = new_inputs(self._n_tools, 0), new_team(alone=True), new_workspace()
        self._notes = np.zeros((b, of_pile.N_NOTES), dtype=np.int64)
        self._guests = Guests(guests, len(setups))
        self._between = Between(contacts or {}, self._all, self._guests)
        self._same = np.zeros(b, dtype=np.bool_)  # both states are the same: those that were asleep
        self._seen: dict[tuple[int, bool, bool], Fields] = {}  # of these, as they were asked for
        for number, piece in enumerate(self.pieces):
            handed = states[number] if states else None
            start_state(piece.model, piece.parameters, piece.body, piece.region, handed, piece.scratch, piece.states[0])
        self._make_rows()
        self._see_unshared()

    def _make_rows(self) -> None:
        """What the kernel takes: by which of the states is committed."""
        self._rows = self._all.rows()
        self._apart = np.array([piece.apart for piece in self.pieces])
        self.substeps = max(piece.scratch.planned for piece in self.pieces)
        """of a step, of the body that takes most"""

    def _see_unshared(self) -> None:
        """Which bodies have contact forces of a state that was handed over, see `step.share_out`."""
        self._unshared = set(np.flatnonzero(self._monitors[:, trust.UNSHARED] != 0.0).tolist())

    def _committed(self, piece: Piece) -> PbdState:
        return piece.states[self._now]

    @property
    def begun(self) -> Begun:
        """Energies of the bodies as they are committed."""
        rows = np.ascontiguousarray(self._monitors[:, [trust.KINETIC, trust.STRAIN, trust.GRAVITY]].T)
        return Begun(*rows)

    @property
    def strain(self) -> float:
        """Strain energy of all, as they are committed [J]."""
        return float(self.begun.strain.sum())

    @property
    def capabilities(self) -> Capabilities:
        """What it can do: nothing acts on its bodies but tools."""
        return Capabilities(False, False, False, self.substeps, True, True, 0.0)

    # ---- a step

    def advance(self, request: Advance) -> Advanced:
        began = time.perf_counter()
        asleep = request.asleep.astype(np.bool_) if len(request.asleep) else np.zeros(len(self.pieces), np.bool_)
        refused = problem_of(request, self._n_tools, 0) or self._guests.problem_of(request.guests)
        if len(asleep) != len(self.pieces):
            refused = f"the pile has {len(self.pieces)} bodies: asleep is of {len(asleep)}"
        if refused:
            raise ValueError(refused)
        self._fit(request.dt)
        fell = self._let_lie(asleep)
        awake = np.flatnonzero(~asleep)
        self._share_out(awake, request)
        place_tools(self._inputs, request.tools)
        kernels, apart = awake[~self._apart[awake]], awake[self._apart[awake]]
        rows, between, working = self._rows[self._now], self._between, (self._team, self._ws, self._notes)
        away = self._guests.take(request.guests)
        if between.any:
            between.find(rows, np.concatenate([asleep, away]), fell, self._now, request.dt)
        alone = kernels[~between.groups.tied[kernels]]
        of_pile.advance_bodies(rows, alone, self._inputs, request.dt, *working)
        if between.n_groups:
            advance_touching(
                *(rows, between.n_groups, between.groups, between.touch, between.eights, self._all.fours),
                *(self._now, between.books),
                *(self._guests.patches, self._guests.arrays, self._all.xw, self._inputs, request.dt, *working),
            )
        dissipated = np.zeros(len(self.pieces))
        for number in np.intersect1d(awake, self._relaxing).tolist():
            dissipated[number] = self.pieces[number].parameters.blocks.dissipated
        notes = {int(number): self._step_apart(int(number), request, dissipated) for number in apart}
        notes |= self._notes_of(kernels)
        for piece in (self.pieces[number] for number in self._cut if not asleep[number]):
            self._bound(piece)
        self._tentative = True
        stepped = Stepped(
            *(self._all.results, self._all.wrenches, self._notes[:, of_pile.SWEPT], self._notes[:, of_pile.SUBSTEPS]),
            *(dissipated, between.met, self._guests.felt()),
        )
        return reply_of(request.header, awake, stepped, notes, time.perf_counter() - began)

    def _fit(self, dt: float) -> None:
        """Make ready for steps of dt [s]."""
        if dt != self._dt:
            self._dt = dt
            for piece in self.pieces:
                piece.scratch.fit(piece.model, piece.parameters, dt)
            self._make_rows()

    def _let_lie(self, asleep: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Bodies that sleep are in the tentative state what they are in the committed one, and to others nodes there
        that do not give. Returns those that did not sleep before (b,)."""
        fell, woken = asleep & ~self._same, self._same & ~asleep
        if woken.any():
            self._seen = {key: fields for key, fields in self._seen.items() if asleep[key[0]]}
        for number in np.flatnonzero(fell):
            piece = self.pieces[number]
            states, xw, n = piece.states, piece.scratch.arrays.xw, piece.model.n_nodes
            np.copyto(states[1 - self._now].buffer, states[self._now].buffer)
            xw[:n, :3], xw[:n, 3] = states[self._now].x, 0.0
        for number in np.flatnonzero(woken):
            piece = self.pieces[number]
            piece.scratch.arrays.xw[: piece.model.n_nodes, 3] = piece.parameters.arrays.inverse_mass
        self._same[:] = asleep
        return fell

    def _share_out(self, awake: Integers, request: Advance) -> None:
        for number in sorted(self._unshared.intersection(awake.tolist())):
            piece = self.pieces[number]
            share_out(piece.model, piece.parameters, self._committed(piece), request.tools, piece.scratch)
            self._unshared.discard(number)

    def _step_apart(self, number: int, request: Advance, dissipated: Floats) -> Said:
        """A step of one body that the pile's kernel does not take."""
        piece, notes = self.pieces[number], self._notes[number]
        piece.scratch.next = piece.states[1 - self._now]
        inputs = StepInputs(request.tools, NO_FORCES)
        _, taken = step(piece.model, piece.parameters, self._committed(piece), inputs, request.dt, piece.scratch)
        notes[of_pile.SUBSTEPS], notes[of_pile.SWEPT] = taken.n_substeps, taken.sweeps
        dissipated[number] = taken.dissipated
        return taken.fault, dict(taken.notice)

    def _notes_of(self, awake: Integers) -> dict[int, Said]:
        """What there is to say of the bodies that the kernel advanced; a step that diverged is taken back here."""
        notes, found = self._notes, {}
        monitors = self._monitors
        odd = (notes[:, of_pile.ATTEMPT] > 0) | (notes[:, of_pile.FAULT] > 0) | (notes[:, of_pile.HALVED] > 0)
        odd |= (notes[:, of_pile.UNFINISHED] > 0) | (self._all.results[:, k.RESIDUAL] > trust.LAGGING)
        odd |= monitors[:, trust.LEAST_J] < trust.CRUSHED
        odd |= (monitors[:, trust.STRETCH] > trust.STRETCHED) | (monitors[:, trust.RESIDUAL] > trust.LAGGING)
        for number in awake[odd[awake]].tolist():
            piece, note = self.pieces[number], notes[number].tolist()
            fault, before = watch.FAULTS[note[of_pile.FAULT]], self._committed(piece)
            cause = note[of_pile.CAUSE]
            why = _WHY.get(cause) or watch.FAULTS[cause].text.split(":")[0]
            counts = note[of_pile.ATTEMPT], note[of_pile.SUBSTEPS], note[of_pile.SWEEPS], note[of_pile.UNFINISHED]
            said = watch.alarm(why, self._all.results[number], before.monitor, *counts)
            if note[of_pile.HALVED]:
                said[Detail.SHORTER] = watch.GAINS
            if fault is watch.Fault.DIVERGED:
                piece.scratch.next = piece.states[1 - self._now]
                stay(piece.parameters, before, piece.scratch)
            found[number] = fault, said
        return found

    @property
    def _monitors(self) -> Floats:
        """Of the committed states (b, N_MONITOR)."""
        return np.asarray(self._all.buffers[self._now][self._all.monitors])

    def _bound(self, piece: Piece) -> None:
        points = piece.model.indptr, piece.model.node, piece.parameters.arrays.weight
        bounds = piece.scratch.outputs.result[k.BOUNDS : k.BOUNDS + 6]
        bound_points(piece.model.n_surface, *points, piece.states[1 - self._now].x, bounds)

    def correct(self, request: Correct) -> Advanced:
        raise ValueError("a pile has no coupling nodes: nothing corrects its steps")

    def commit(self) -> None:
        """Accept the tentative step; does nothing if there is none."""
        if self._tentative:
            self._now, self._tentative = 1 - self._now, False

    def discard(self) -> None:
        """Take the tentative step back; does nothing if there is none."""
        self._tentative = False

    # ---- what is known

    def fields(self, request_header: Header, indicators: bool = False, own: bool = False) -> Fields:
        """Fields of all bodies, of the last advanced step. Those of bodies that sleep are read once."""
        each = [self._fields_of(number, request_header, indicators, own) for number in range(len(self.pieces))]
        none, no_ids = np.zeros((0, 3)), np.zeros(0, dtype=np.int32)
        nothing = no_ids, none, none, np.zeros((0, 8, 6)), no_ids, none, none, no_ids
        return Fields(request_header, *nothing, bodies=each)

    def _fields_of(self, number: int, header: Header, indicators: bool, own: bool) -> Fields:
        piece, now = self.pieces[number], 1 - self._now if self._tentative else self._now
        key = number, indicators, own
        if key in self._seen:
            return replace(self._seen[key], header=header)
        found = piece.reader.read(header, piece.parameters, piece.states[now], indicators, own)
        if self._same[number]:
            self._seen[key] = found
        return found

    def snapshot(self) -> bytes:
        """Commit, then the snapshots of all bodies, see `softseam_protocol.participant.state`."""
        self.commit()
        self._guests.forget()
        touched = (self._between.of_body(number, self._now) for number in range(len(self.pieces)))
        states = zip(map(self._committed, self.pieces), touched, strict=True)
        return join_states(encode_state(state, forces) for state, forces in states)

    def restore(self, state: bytes) -> None:
        """Take over a snapshot of the same bodies; a tentative step is dropped. Raises ValueError for others."""
        parts = split_states(state)
        if len(parts) != len(self.pieces):
            raise ValueError(f"the snapshot is of {len(parts)} bodies, the pile has {len(self.pieces)}")
        kept, between = self._all.buffers[self._now].copy(), self._between
        try:
            forces = [
                decode_state(part, self._committed(piece), between.size_of(number))
                for number, (part, piece) in enumerate(zip(parts, self.pieces, strict=True))
            ]
        except ValueError:
            self._all.buffers[self._now][:] = kept
            raise
        for number, own in enumerate(forces):
            between.load(number, self._now, own)
        self._tentative = False
        self._let_lie(np.zeros(len(self.pieces), dtype=np.bool_))
        self._guests.forget()
        self._see_unshared()


Said = tuple[watch.Fault, dict[Detail, str]]
"""what is wrong with a body's step, and what its monitor says"""


class Stepped(NamedTuple):
    """What became of all b bodies of a pile in a step between t tools."""

    results: Floats
    """(b, N_RESULTS)"""
    wrenches: Floats
    """(b, t, 6) [N, N m]"""
    sweeps: NDArray[np.int64]
    """(b,)"""
    substeps: NDArray[np.int64]
    dissipated: Floats
    """(b,) [J]"""
    met: Meetings
    """what contacts between them, and with guests, did"""
    on_guests: list[Push]


def reply_of(
    header: Header, awake: NDArray[np.int64], stepped: Stepped, said: Mapping[int, Said], seconds: float
) -> Advanced:
    """Of the bodies that took the step; said: of those of which there is something to say, by their numbers."""
    rows = np.ascontiguousarray(stepped.results[awake].T)
    wrench, dissipated = stepped.wrenches[awake], stepped.dissipated[awake]
    places = {number: place for place, number in enumerate(awake.tolist())} if said else {}
    notes = [
        Note(places[number], fault.status, fault.why, dict(text))
        for number, (fault, text) in sorted(said.items())
        if text or fault is not watch.Fault.NONE
    ]
    members = Members(
        rows[k.KINETIC],
        rows[k.STRAIN],
        rows[k.GRAVITY],
        rows[k.TOOL_WORK],
        dissipated,
        np.ascontiguousarray(rows[k.MOMENTUM : k.MOMENTUM + 3].T),
        np.ascontiguousarray(rows[k.ANGULAR : k.ANGULAR + 3].T),
        rows[k.PENETRATION],
        rows[k.SLIP],
        rows[k.RESIDUAL],
        rows[k.N_CONTACTS].astype(np.int32),
        stepped.sweeps[awake].astype(np.int32),
        stepped.substeps[awake].astype(np.int32),
        wrench,
        np.ascontiguousarray(rows[k.BOUNDS : k.BOUNDS + 3].T),
        np.ascontiguousarray(rows[k.BOUNDS + 3 : k.BOUNDS + 6].T),
        notes,
        interface_work=rows[k.SEAM_WORK],
        meetings=stepped.met,
        on_guests=stepped.on_guests,
        fastest=rows[k.FASTEST],
    )
    bounds = np.zeros((2, 3))
    if len(awake):
        bounds = np.stack((members.low.min(axis=0), members.high.max(axis=0)))
    wrong = [note for note in notes if note.status is not Status.CONVERGED]
    return Advanced(
        header,
        wrong[0].status if wrong else Status.CONVERGED,
        wrench.sum(axis=0),
        float(rows[k.KINETIC].sum()),
        float(rows[k.STRAIN].sum()),
        float(rows[k.GRAVITY].sum()),
        float(rows[k.TOOL_WORK].sum()),
        members.momentum.sum(axis=0),
        members.angular_momentum.sum(axis=0),
        bounds,
        seconds,
        np.zeros(0),
        Coupled(),
        extras={
            Figure.CONTACTS: float(members.n_contacts.sum()),
            Figure.PENETRATION: float(members.penetration.max(initial=0.0)),
            Figure.SLIP: float(members.slip.max(initial=0.0)),
            Figure.ITERATIONS: float(members.iterations.max(initial=0)),
            Figure.SUBSTEPS: float(members.n_substeps.max(initial=1)),
            Figure.RESIDUAL: float(members.residual.max(initial=0.0)),
            Figure.DISSIPATED: float(dissipated.sum()),
            Figure.FASTEST: float(members.fastest.max(initial=0.0)),
        },
        why=wrong[0].why if wrong else "",
        members=members,
    )
