"""The simulation behind a bus: an orchestrator serves the session, participants and recorder run elsewhere."""

import secrets
import time
from collections.abc import Mapping
from typing import TypeVar

from softseam.errors import (
    BadInput,
    BadSnapshot,
    NoConnection,
    SceneRefused,
    SchemaMismatch,
    ServicesFailed,
    SimulationFailed,
    SoftseamError,
)
from softseam.gradient import Asked, Gradient
from softseam_protocol import errors, topics
from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.liveness import CLIENT
from softseam_protocol.messages.arrays import Vector3
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Bundle, Failure
from softseam_protocol.messages.recording import FINISH, End, Recorded, SurfaceMesh
from softseam_protocol.messages.session import (
    Close,
    Closed,
    ErrorEstimate,
    Estimate,
    Estimated,
    Load,
    Observation,
    Observations,
    Open,
    Reset,
    Save,
    Saved,
    Step,
)
from softseam_protocol.scene.scene import Scene

Reply = TypeVar("Reply", Observation, Observations, Saved, Estimated, Closed, Recorded)
_MOST = 1000
"""steps asked for at once; the orchestrator answers after a tenth of a second"""
CONNECT_TIMEOUT = 5.0
_CLOSE_TIMEOUT = 10.0
RESTART = 8.0
"""longest wait for an orchestrator that is to open a session: a supervisor has restarted one by then [s]"""
_INTRODUCTION = 0.1
"""time after which an orchestrator that shows on the bus, but did not answer, is asked again [s]"""


class ConnectedBackend:
    """One session of an orchestrator. A request whose answer is lost is repeated: the orchestrator answers it once."""

    def __init__(
        self,
        bundle: Bundle,
        endpoint: str,
        *,
        record: bool,
        timeout: float,
    ) -> None:
        self._keys = topics.Keys(topics.DEFAULT_DEPLOYMENT)
        self._key = self._keys.orchestrator
        self._record = record
        self.recorded: Recorded | None = None
        self.unrecorded = ""
        self._endpoint, self._timeout = endpoint, timeout
        self._count = 0
        self.secret = secrets.token_hex(16)
        """opens the session; what everybody may know, its name on the bus and of its recording, is `session`"""
        self.session = topics.shown(self.secret)
        try:
            self._bus = Bus(endpoint, min(timeout, CONNECT_TIMEOUT))
        except errors.BusError as error:
            raise NoConnection(str(error)) from None
        try:
            self._bus.declare_live(self._keys.live("client", CLIENT, self.session))
            self._asker = self._bus.asker(self._key, timeout)
            self._first: Observation | None = self._ask(Open(self._header(), bundle, record), Observation, SceneRefused)
        except BaseException:  # nothing is kept back: whoever interrupts leaves no bus behind
            self._bus.close()
            raise

    def doubts(self, scene: Scene) -> list[str]:
        from softseam.checks import doubts

        return doubts(scene, {})  # bodies are built elsewhere

    def reset(self, seed: int, bundle: Bundle | None = None) -> Observation:
        refused = SimulationFailed if bundle is None else SceneRefused
        return self._ask(Reset(self._header(), seed, bundle), Observation, refused)

    def step(self, count: int, velocities: Mapping[str, Vector3] | None, fields: bool) -> Observation:
        ways, turns, grips = {}, {}, {}
        for name, velocity in (velocities or {}).items():
            ways[name] = velocity[:3].copy()
            if len(velocity) > 3:
                turns[name] = velocity[3:6].copy()
            if len(velocity) > 6:
                grips[name] = float(velocity[6])
        request = Step(self._header(), count, velocities is None, ways, fields, turns, gripping=grips)
        return self._ask(request, Observation, SimulationFailed)

    def follow(self, most: int | None) -> list[Observation]:
        request = Step(self._header(), _MOST if most is None else min(most, _MOST), True, {}, fields=False, each=True)
        return self._ask(request, Observations, SimulationFailed).steps

    def save(self) -> bytes:
        return self._ask(Save(self._header()), Saved, SimulationFailed).state

    def load(self, state: bytes) -> Observation:
        return self._ask(Load(self._header(), state), Observation, BadSnapshot)

    def estimate(self) -> ErrorEstimate | None:
        return self._ask(Estimate(self._header()), Estimated, SimulationFailed).estimate

    def surface_meshes(self) -> Mapping[str, SurfaceMesh]:
        raise BadInput("surfaces to draw need the simulation in this process: open the session without connect")

    def differentiate(self, asked: Asked) -> tuple[Gradient, Observation]:
        raise BadInput("gradients need the simulation in this process: open the session without connect")

    def close(self) -> None:
        """Close the session there; one that is away for seconds, or at work, closes it itself once it is idle."""
        self._timeout = min(self._timeout, FINISH if self._record else _CLOSE_TIMEOUT)
        try:
            why = self._hang_up()
            if self._record:  # what became of it: it ends with the session, if not before
                self.recorded = self._ask(End(self._header(), "closed"), Recorded, SimulationFailed)
        except SimulationFailed as error:
            self.unrecorded = f"{error}{why}"
        except NoConnection as error:
            self.unrecorded = f"no recorder answered: {error}"
        finally:
            self._bus.close()

    def _hang_up(self) -> str:
        """Ask the orchestrator to close the session; why it did not, '' where it did. Raises NoConnection."""
        try:
            self._ask(Close(self._header()), Closed, SimulationFailed)
        except SimulationFailed as error:
            return f"; the session was not closed either: {error}"
        return ""

    def _header(self) -> Header:
        """Each request has a number of its own; its repetition has the same."""
        self._count += 1
        return Header(SCHEMA_VERSION, self.secret, "", 0, 0, self._count, 0.0)

    def _ask(
        self,
        request: Open | Reset | Step | Save | Load | Estimate | Close | End,
        kind: type[Reply],
        invalid: type[SoftseamError],
    ) -> Reply:
        """Send a request, repeat it while its answer gets lost, and translate what goes wrong."""
        end = time.monotonic() + self._timeout
        hoping = end
        repeated = False
        lost = NoConnection if isinstance(request, Open) else ServicesFailed
        last = isinstance(request, Close | End)
        while True:
            try:
                reply: Reply
                if repeated or last:
                    left = end - time.monotonic()
                    # a router that hangs takes a request along, and is back before a session's last ones are given up
                    reply = self._bus.call(self._key, request, kind, max(0.1, left / 2.0 if last else left))
                else:
                    reply = self._asker.call(request, kind)
                return reply
            except errors.Refused as error:
                raise _refusal(error.failure, invalid) from None
            except errors.SchemaMismatch as error:
                raise SchemaMismatch(str(error)) from None
            except errors.NoReply as error:
                # an orchestrator that is being restarted by its supervisor is back within seconds
                if isinstance(request, Open) and not repeated:
                    hoping = min(end, time.monotonic() + RESTART)
                if time.monotonic() + 0.2 > hoping:
                    raise lost(
                        f"no orchestrator answers at {self._endpoint} ({error}): start one with `softseam up`"
                    ) from None
                self._wait_for_orchestrator(hoping)
                repeated = True
            except (errors.BusTimeout, errors.BusError) as error:
                if last and isinstance(error, errors.BusTimeout) and time.monotonic() + 0.2 < end:
                    continue
                raise lost(f"{self._endpoint}: {error}") from None
            except errors.EncodeError as error:
                raise BadInput(str(error)) from None
            except errors.ProtocolError as error:
                raise lost(f"{self._endpoint}: {error}") from None

    def _wait_for_orchestrator(self, end: float) -> None:
        """Until an orchestrator shows on the bus and may have been introduced, or the time is over."""
        watch = self._bus.watch_live(self._keys.every_live("orchestrator"))
        try:
            while (left := end - time.monotonic()) > 0.0:
                change = watch.get(left)
                if change is None or change.alive:
                    # it did not answer just now: it goes, or is still to be heard
                    pause = min(end, time.monotonic() + _INTRODUCTION)
                    while (left := pause - time.monotonic()) > 0.0:
                        change = watch.get(left)
                        if change is not None and not change.alive:
                            return
                    return
        finally:
            watch.close()


def _refusal(failure: Failure, invalid: type[SoftseamError]) -> SoftseamError:
    """The client's error for an orchestrator's refusal."""
    if failure.kind == FailureKind.SCHEMA:
        return SchemaMismatch(failure.message)
    if failure.kind == FailureKind.INVALID:
        return invalid(failure.message)
    return SimulationFailed(failure.message)
