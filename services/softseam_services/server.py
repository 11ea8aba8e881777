"""The participant's state machine: one `handle` for every transport, several sessions a process.

A request is answered once; the same request again gets the same reply; a request from the past is refused and changes
nothing. See `participant` for the states.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.names import ONLY_BODY
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    Bundle,
    Commit,
    Committed,
    Configure,
    Configured,
    Correct,
    Failure,
    Fields,
    Observe,
    Release,
    Released,
    Reply,
    Request,
    Restore,
    Restored,
    Snapshot,
    SnapshotTaken,
)
from softseam_protocol.scene.file import scene_from_bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.blas import use_one_thread
from softseam_services.body.body import Body
from softseam_services.body.build import AnyBody, build_any_body
from softseam_services.body.particles import ParticleBody
from softseam_services.body.region import build_region
from softseam_services.built import Built
from softseam_services.orchestrator.default_model import with_model
from softseam_services.participant import Solver
from softseam_services.tools.build import build_tools
from softseam_services.tools.symmetry import check_symmetry
from softseam_services.tools.tool_set import ToolSet

_BUNDLES_KEPT = 4
_SLOTS_KEPT = 64
"""of sessions whose orchestrators may have died without a Release"""
_TIMED_HERE = (Committed, Fields, SnapshotTaken, Restored)
"""replies whose seconds are those of the whole answer; a solver tells its own of a step"""
_NOT_KEPT = (Failure, Fields)
"""replies that a repeated request is given anew"""

use_one_thread()  # every process that simulates loads this module: results do not depend on the number of cores


@dataclass(frozen=True)
class Setup:
    """What a bundle describes of one body, built once a process."""

    scene: Scene
    """with that body alone, and regions that name a model"""
    body: AnyBody
    tools: ToolSet
    why: str = ""
    """why they name this model, where the scene itself names none"""


def build_setup(bundle: Bundle, name: str = ONLY_BODY) -> Setup:
    """Scene, body of that name and tools of a bundle. Raises SceneError, MeshError, ToolError or SettingError, and
    KeyError where the scene has no such body."""
    scene = scene_from_bundle(bundle).of(name)
    body = build_any_body(scene, bundle.files)
    tools = build_tools(scene, body, bundle.files)
    if isinstance(body, Body):
        check_symmetry(scene, body, tools)
    scene, why = with_model(scene, body, tools)
    return Setup(scene, body, tools, why)


def build_solver(setup: Setup, request: Configure, built: Built) -> tuple[Solver, Configured]:
    """The solver that a Configure asks for, of what is built already. Imports only the model that is asked for."""
    if isinstance(setup.body, ParticleBody):
        return _particle_solver(setup, setup.body, request)
    region = build_region(setup.body, request.cells, request.seam_nodes, request.owns_seam_points)
    solver: Solver
    moving, substeps = (0.0, 0.0), 1
    if request.model == "fem":
        from softseam_services.fem.region_tables import RegionTables
        from softseam_services.fem.solver import FemSolver

        tables = built.find(setup.body, request)
        tables = tables or RegionTables(setup.body, region, setup.tools, setup.scene, built.structures)
        fem = FemSolver(setup.scene, setup.body, region, setup.tools, request.state, tables)
        built.keep(setup.body, request, fem.tables)
        solver, moving = fem, fem.moving
    elif request.model == "pbd":
        from softseam_services.pbd.model import STRUCTURES, lay_out
        from softseam_services.pbd.solver import PbdSolver

        structure = STRUCTURES.find(lay_out(setup.body, region, setup.tools, setup.scene.models.pbd))
        pbd = PbdSolver(setup.scene, setup.body, region, setup.tools, request.state, structure)
        solver, moving, substeps = pbd, pbd.moving, pbd.substeps
    else:
        raise ValueError(f"no model is called {request.model!r}; there are: fem, pbd")
    n_nodes, n_cells = len(region.nodes), len(region.cells)
    told = Configured(request.header, n_nodes, n_cells, substeps, solver.strain, *moving, 0.0, solver.capabilities)
    return solver, told


def _particle_solver(setup: Setup, body: ParticleBody, request: Configure) -> tuple[Solver, Configured]:
    """A sheet or rope is one region, whole."""
    if request.model != "pbd":
        raise ValueError(
            f"a {body.kind} is made of particles: the model {request.model!r} cannot take it, only pbd can"
        )
    from softseam_services.pbd.particles.model import STRUCTURES, lay_out
    from softseam_services.pbd.particles.solver import ParticleSolver

    structure = STRUCTURES.find(lay_out(body, setup.scene.models.pbd))
    solver = ParticleSolver(setup.scene, body, setup.tools, request.state, structure)
    return solver, Configured(request.header, body.n_nodes, 0, solver.substeps, solver.strain, *solver.moving)


@dataclass
class _Slot:
    """One participant of one session."""

    solver: Solver
    epoch: int
    committed: int
    """steps committed"""
    exchange: int = -1
    """exchange of the tentative step `committed`, -1 where there is none"""
    replies: dict[type, tuple[Request, Reply]] = field(default_factory=dict)
    """last request and reply of each kind, for repeats"""


class ParticipantServer:
    """Answers requests for any number of sessions; not thread-safe: one thread owns it."""

    def __init__(self) -> None:
        self._slots: dict[tuple[str, str], _Slot] = {}
        self._setups: dict[bytes, dict[str, Setup]] = {}  # these two in the order of their last use
        self._built = Built()

    def adopt(self, bundle: Bundle, setups: Mapping[str, Setup]) -> None:
        """Share set-ups, by their bodies, that the same process has built already."""
        self._setups_of(bundle).update(setups)

    def solver(self, session: str, part: str) -> Solver:
        """What computes a part that is configured here. Raises KeyError where none is."""
        return self._slots[session, part].solver

    def handle(self, request: Request) -> Reply:
        """Serve one request; every failure is a `Failure`, never an exception."""
        header = request.header
        if header.schema != SCHEMA_VERSION:
            return Failure(
                FailureKind.SCHEMA,
                f"the request has schema version {header.schema}, this participant speaks {SCHEMA_VERSION}: "
                "install the same version of softseam on both sides",
            )
        try:
            return self._serve(request)
        except MemoryError:
            return Failure(FailureKind.INTERNAL, "out of memory: use larger cells or give the participant more")
        except Exception as error:  # a service must answer; the text names the cause
            return Failure(FailureKind.INVALID, f"{type(error).__name__}: {error}")

    def _serve(self, request: Request) -> Reply:
        key = (request.header.session, request.header.part)
        slot = self._used(key)
        if isinstance(request, Configure):
            if slot is not None:
                kept = slot.replies.get(Configure)
                untouched = slot.committed == request.header.step and slot.exchange < 0
                if kept is not None and kept[0].header == request.header and untouched:
                    return kept[1]
                if request.header.epoch < slot.epoch:
                    return _stale(request, slot)
            return self._configure(key, request)
        if isinstance(request, Release):
            self._slots.pop(key, None)
            return Released(request.header)
        if slot is None:
            return Failure(FailureKind.NOT_CONFIGURED, f"no part {key[1]!r} of session {key[0]!r} is configured here")
        kept = slot.replies.get(type(request))
        if kept is not None and kept[0].header == request.header:
            return kept[1]
        began = perf_counter()
        reply = self._answer(slot, request)
        if isinstance(reply, _TIMED_HERE):
            reply = replace(reply, seconds=perf_counter() - began)
        if not isinstance(reply, _NOT_KEPT):
            slot.replies[type(request)] = (request, reply)
        return reply

    def _used(self, key: tuple[str, str]) -> _Slot | None:
        """A slot, which is then the last of all to be given up."""
        slot = self._slots.pop(key, None)
        if slot is not None:
            self._slots[key] = slot
        return slot

    def _configure(self, key: tuple[str, str], request: Configure) -> Reply:
        began = perf_counter()
        setups, name = self._setups_of(request.bundle), request.body
        setup = setups[name] = setups.get(name) or build_setup(request.bundle, name)
        solver, reply = build_solver(setup, request, self._built)
        reply = replace(reply, seconds=perf_counter() - began)
        self._slots.pop(key, None)
        while len(self._slots) >= _SLOTS_KEPT:
            self._slots.pop(next(iter(self._slots)))  # an orchestrator that still wants it configures it again
        self._slots[key] = _Slot(solver, request.header.epoch, request.header.step, -1, {Configure: (request, reply)})
        return reply

    def _setups_of(self, bundle: Bundle) -> dict[str, Setup]:
        """What is built of a bundle, by body; those of the latest bundles are kept."""
        digest = _digest(bundle)
        setups = self._setups.pop(digest, {})
        while len(self._setups) >= _BUNDLES_KEPT:
            self._setups.pop(next(iter(self._setups)))
        self._setups[digest] = setups
        return setups

    def _answer(self, slot: _Slot, request: Request) -> Reply:
        header = request.header
        if header.epoch != slot.epoch:
            return _stale(request, slot)
        if isinstance(request, Advance):
            began = perf_counter()
            if header.step == slot.committed + 1 and slot.exchange >= 0:
                _commit(slot)
            if header.step != slot.committed or header.exchange <= slot.exchange:
                return _stale(request, slot)
            return _with_fields(slot, request, slot.solver.advance(request), began)
        if isinstance(request, Correct):
            began = perf_counter()
            if header.step != slot.committed or not 0 <= slot.exchange < header.exchange:
                return _stale(request, slot)
            if request.then is not None and not _follows(request.then.header, header):
                return Failure(FailureKind.INVALID, "Correct.then is not the first Advance of the step that follows")
            corrected = _with_fields(slot, request, slot.solver.correct(request), began)
            after = None if request.then is None else self.handle(request.then)
            return replace(corrected, then=after) if isinstance(after, Advanced) else corrected
        if isinstance(request, Observe):
            return slot.solver.fields(header, request.indicators, request.own)
        if isinstance(request, Commit | Snapshot):
            if header.step == slot.committed + 1 and slot.exchange >= 0:
                _commit(slot)
            if header.step != slot.committed:
                return _stale(request, slot)
            if slot.exchange >= 0:  # a step that failed on the other side
                slot.solver.discard()
                slot.exchange = -1
            if isinstance(request, Commit):
                return Committed(header, slot.solver.fields(header) if request.fields else None)
            return SnapshotTaken(header, slot.solver.snapshot())
        if isinstance(request, Restore):
            slot.solver.restore(request.state)
            slot.committed, slot.exchange = header.step, -1
            slot.replies = {Configure: slot.replies[Configure]}
            return Restored(header)
        return Failure(FailureKind.INVALID, f"a participant does not answer {type(request).__name__}")


def _with_fields(slot: _Slot, request: Advance | Correct, reply: Advanced, began: float) -> Advanced:
    """The reply to a tentative step, with the fields where they are asked for."""
    if request.fields:  # the solver's clock runs while it advances only
        reply = replace(reply, fields=slot.solver.fields(request.header), seconds=perf_counter() - began)
    slot.exchange = request.header.exchange
    return reply


def _follows(header: Header, before: Header) -> bool:
    """Whether a request is the first for the step that follows that of another, of the same part."""
    return header == replace(before, step=before.step + 1, exchange=0, time=header.time)


def _commit(slot: _Slot) -> None:
    """Commit the tentative step."""
    slot.solver.commit()
    slot.committed += 1
    slot.exchange = -1


def _digest(bundle: Bundle) -> bytes:
    digest = hashlib.sha256(bundle.scene.encode())
    for path, data in sorted(bundle.files.items()):
        digest.update(path.encode() + b"\0" + data)
    return digest.digest()


def _stale(request: Request, slot: _Slot) -> Failure:
    header = request.header
    return Failure(
        FailureKind.STALE,
        f"{type(request).__name__} of epoch {header.epoch}, step {header.step}, exchange {header.exchange} does not "
        f"follow epoch {slot.epoch}, {slot.committed} committed steps, exchange {slot.exchange}",
    )
