"""A part of a participant that is being checked: a block of two cells, configured, asked and released."""

from __future__ import annotations

import itertools
import secrets
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.bus.client import TIMEOUT, Bus
from softseam_protocol.errors import BusTimeout, ProtocolError, Refused
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.names import ONLY_BODY, within
from softseam_protocol.messages.outcomes import FailureKind, Status
from softseam_protocol.messages.participant import (
    Advance,
    Advanced,
    BodyState,
    Capabilities,
    Commit,
    Committed,
    Configure,
    Configured,
    Correct,
    Fields,
    Observe,
    PartMesh,
    Release,
    Released,
    Reply,
    ToolMotion,
)
from softseam_protocol.models import NEAR_DEFAULT, taking
from softseam_protocol.scene.file import bundle_scene, parse_scene
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.wire.codec import decode, encode

Floats = NDArray[np.float64]
Kind = TypeVar("Kind")
Vector = tuple[float, float, float]

BLOCK = parse_scene((Path(__file__).parent / "block.yaml").read_text(encoding="utf-8"))
_BODY = next(body for each in BLOCK.bodies.values() if (body := each.in_cells))
EDGE, STEP = _BODY.wanted_edges[0], BLOCK.step
"""of a cell [m]; length of a step [s]"""
YOUNG, POISSON, DENSITY = _BODY.material.young, _BODY.material.poisson, _BODY.material.density
"""of the block [Pa], [1], [kg/m^3]"""
_EPOCH = 1
"""that all seats are configured in: there is an older one"""
_GRID = np.array([(i, j, k) for k in range(3) for j in range(3) for i in range(5)])
"""the block's nodes, two cells along x (45, 3)"""
REST = 0.5 * EDGE * _GRID - np.array([EDGE, 0.5 * EDGE, 0.0])
"""their positions (45, 3) [m]"""
FAR_END = np.flatnonzero(_GRID[:, 0] == 4).astype(np.int32)
"""the nine nodes of the face at the larger x"""
ENDS = np.flatnonzero(_GRID[:, 0] % 4 == 0).astype(np.int32)
"""the nodes of both faces across x"""
MASS = 2.0 * EDGE**3 * DENSITY
"""of the block [kg]"""


class Unmet(Exception):
    """A check failed: what was expected, and what came."""

    def __init__(self, expected: str, came: str) -> None:
        super().__init__(f"expected {expected}, came {came}")
        self.expected, self.came = expected, came


class Silent(Unmet):
    """No answer came in time: whatever else is asked would wait as long."""


def expect(met: bool, expected: str, came: object) -> None:
    """Raises Unmet where it is not met."""
    if not met:
        raise Unmet(expected, str(came))


def near(expected: str, came: Any, wanted: Any, atol: float) -> None:
    """As many numbers, each within `atol`. Raises Unmet."""
    expect(np.shape(came) == np.shape(wanted), f"{expected}, of shape {np.shape(wanted)}", np.shape(came))
    error = float(np.abs(np.asarray(came) - np.asarray(wanted)).max(initial=0.0))
    expect(error <= atol, f"{expected} (within {atol:.2g})", f"{error:.3g} off")


@dataclass
class Service:
    """A participant's service on the bus, asked for one of its models."""

    bus: Bus
    key: str
    model: str
    wait: float = TIMEOUT
    """longest wait for an answer [s]"""
    seats: list[ExaminedPart] = field(default_factory=list)
    """that were configured since `release` was called"""
    _names: Any = field(default_factory=itertools.count)
    _run: str = field(default_factory=lambda: secrets.token_hex(4))

    def session(self) -> str:
        """A name that no session had."""
        return f"conform-{self._run}-{next(self._names)}"

    def ask(self, request: Any, kind: type[Kind]) -> Kind:
        """The answer. Raises Unmet where there is none, or another."""
        expected = f"{kind.__name__} in answer to {type(request).__name__}"
        reply = self._reply(encode(request), expected)
        if isinstance(reply, ProtocolError):
            raise Unmet(expected, str(reply))
        expect(isinstance(reply, kind), expected, type(reply).__name__)
        expect(reply.header == request.header, "the header of the request in its answer", reply.header)
        return reply  # type: ignore[no-any-return]

    def refusal(self, payload: bytes, kinds: tuple[str, ...]) -> bool:
        """The payload must be refused by a Failure of one of these kinds, or as a step that is `refused`, with a
        remedy. Whether it was by a Failure. Raises Unmet."""
        failure = True
        expected = f"a Failure of kind {' or '.join(kinds)}"
        reply = self._reply(payload, expected)
        if isinstance(reply, Refused):
            kind, text = reply.failure.kind, reply.failure.message
        elif isinstance(reply, ProtocolError):
            raise Unmet(expected, str(reply))
        else:
            refused = isinstance(reply, Advanced) and reply.status is Status.REFUSED and "invalid" in kinds
            expect(refused, expected, type(reply).__name__)
            failure, kind, text = False, FailureKind(kinds[0]), reply.why
        expect(kind in kinds, expected, f"{kind}: {text}")
        expect(len(text.split()) >= 4, "a text that says what is wrong and the remedy", repr(text))
        return failure

    def release(self) -> None:
        """Release the seats of a check, however it ended."""
        while self.seats:
            with suppress(Unmet):
                self.seats.pop().release()

    def _reply(self, payload: bytes, expected: str) -> Any:
        """The reply, or the error that came instead. Raises Silent."""
        try:
            return decode(self.bus.request(self.key, payload, self.wait), Reply)
        except BusTimeout as error:
            raise Silent(expected, str(error)) from None
        except ProtocolError as error:
            return error


class ExaminedPart:
    """One session's part: the block with these coupling nodes, in this state (rest where absent)."""

    def __init__(
        self,
        service: Service,
        *,
        gravity: Vector = (0.0, 0.0, 0.0),
        x: Floats | None = None,
        v: Floats | None = None,
        coupling: NDArray[np.int32] = FAR_END,
    ) -> None:
        self.service, self.session, self.coupling = service, service.session(), coupling
        state = None
        if x is not None or v is not None:
            none = np.zeros((len(REST), 3))
            body = BodyState(REST if x is None else x, none if v is None else v, none[:0], np.zeros(0, np.int32))
            n_points = 42  # nodes on the surface: all but the three inside
            state = replace(
                body, contact_force=np.zeros((n_points, 3)), contact_tool=np.full(n_points, -1, dtype=np.int32)
            )
        model = service.model if service.model in taking("cells") else NEAR_DEFAULT
        scene = BLOCK.model_copy(update={"gravity": gravity, "regions": RegionsSpec(default=model)})
        cells = np.arange(2, dtype=np.int32)
        self.configure = Configure(
            self.header(0), bundle_scene(scene), service.model, cells, coupling, state, True, ONLY_BODY, mesh()
        )
        self.configured: Configured = service.ask(self.configure, Configured)
        service.seats.append(self)

    def header(self, step: int, exchange: int = 0) -> Header:
        return Header(SCHEMA_VERSION, self.session, within(ONLY_BODY, "near"), _EPOCH, step, exchange, step * STEP)

    def request(self, step: int, exchange: int = 0, force: Floats | None = None, compliance: bool = False) -> Advance:
        """A step under a force on the coupling nodes (s, 3) [N], zero where absent."""
        none = np.zeros((0, 3))
        motion = ToolMotion(none, np.zeros((0, 4)), none, np.zeros((0, 4)))
        force = np.zeros((len(self.coupling), 3)) if force is None else force
        return Advance(self.header(step, exchange), STEP, force, motion, compliance)

    def advance(self, step: int, exchange: int = 0, force: Floats | None = None, compliance: bool = False) -> Advanced:
        """The answer to `request`, which must have converged. Raises Unmet."""
        return self._stepped(self.request(step, exchange, force, compliance))

    def correct(self, step: int, exchange: int, push: Floats, force: Floats, then: Advance | None = None) -> Advanced:
        """The tentative step, moved on by the answer to a push; that force acts from then on. Raises Unmet."""
        return self._stepped(Correct(self.header(step, exchange), push, force, then=then))

    def _stepped(self, request: Advance | Correct) -> Advanced:
        reply = self.service.ask(request, Advanced)
        expect(reply.status is Status.CONVERGED, "a step that converges", f"{reply.status}: {reply.why}")
        wanted = (len(self.coupling), 3)
        expect(reply.coupling.x.shape == wanted, f"Coupled.x of shape {wanted}", reply.coupling.x.shape)
        return reply

    def commit(self, step: int) -> None:
        self.service.ask(Commit(self.header(step)), Committed)

    def observe(self, step: int) -> Fields:
        return self.service.ask(Observe(self.header(step)), Fields)

    def release(self) -> None:
        self.service.ask(Release(self.header(0)), Released)


def capabilities(service: Service) -> Capabilities:
    """What it declares of the block. Raises Unmet."""
    able = ExaminedPart(service).configured.capabilities
    service.release()
    if able is None:
        raise Unmet("Capabilities in Configured, of a part with coupling nodes", "none")
    return able


def mesh() -> PartMesh:
    """The block's."""
    cells = np.array(
        [[2 * c + i + 5 * (j + 3 * k) for k in range(3) for j in range(3) for i in range(3)] for c in (0, 1)]
    )
    simpson = np.array([1.0, 4.0, 1.0]) / 6.0
    share = np.einsum("k,j,i->kji", simpson, simpson, simpson).ravel()
    mass = np.zeros(len(REST))
    np.add.at(mass, cells.ravel(), np.tile(0.5 * MASS * share, 2))
    local = _GRID - 1.0 - 2.0 * np.column_stack([_GRID[:, 0] > 2, np.zeros((len(REST), 2))])
    outside = np.flatnonzero((np.abs(_GRID - (2, 1, 1)) == (2, 1, 1)).any(axis=1))
    return PartMesh(
        np.arange(len(REST), dtype=np.int32),
        REST,
        mass,
        np.zeros(len(REST), dtype=np.int8),
        cells.astype(np.int32),
        np.arange(len(outside), dtype=np.int32),
        (_GRID[outside, 0] > 2).astype(np.int32),
        local[outside],
    )


def some_force(size: float = 1e-3, seed: int = 0) -> Floats:
    """On the nodes of the far end (9, 3) [N]; moves them by some micrometres a step."""
    return size * np.random.default_rng(seed).standard_normal((len(FAR_END), 3))
