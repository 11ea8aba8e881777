"""Every key expression of softseam: who sends what where, and what a recorder keeps.

    softseam/<deployment>/participant/<service>/request     query   Request -> Reply
    softseam/<deployment>/participant/<service>/echo        query   bytes -> the same bytes
    softseam/<deployment>/orchestrator/request              query   Open, Reset, ... -> Observation(s), Saved, Closed
    softseam/<deployment>/recorder/request                  query   Begin, End, Commit -> Recorded; services ask
    softseam/<deployment>/progress/<role>/<service>         put     Progress, a few a second
    softseam/<deployment>/session/<session>/<topic>         put     SessionTopic below
    softseam/<deployment>/@live/<role>/<service>/<instance> token   exists while the process does
    softseam/<deployment>/@live/client/session/<session>    token   exists while the client of a session does
    softseam/@node/<name>                                   token   exists while others may reach a process directly

A `service` is the name of a process (`fem`, `pbd`, `fem2`); the part that a request is for (`body.far`) stands in its
header. A `session` is what everybody may know of it, `shown`; a client's requests name the session's secret instead.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

from softseam_protocol.messages.recording import Begin, End, Recorded
from softseam_protocol.messages.session import Event, Frame, StepReport
from softseam_protocol.wire.codec import is_name

ROOT = "softseam"
EVERY_NODE = f"{ROOT}/@node/*"
DEFAULT_DEPLOYMENT = "local"
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


def shown(secret: str) -> str:
    """The name of a session by its secret: in keys, tokens, messages and recordings, where it opens nothing."""
    return hashlib.sha256(secret.encode()).hexdigest()[:24]


def node(name: str) -> str:
    """Token of a process that others reach directly, whatever its deployment."""
    return f"{ROOT}/@node/{name}"


@dataclass(frozen=True)
class SessionTopic:
    """What an orchestrator publishes about a session."""

    name: str
    message: type
    recorded: bool
    droppable: bool
    """may be dropped under congestion: only what a later message replaces"""
    rate: str


SESSION_TOPICS = (
    SessionTopic("begin", Begin, recorded=True, droppable=False, rate="once a session"),
    SessionTopic("report", StepReport, recorded=True, droppable=False, rate="every step"),
    SessionTopic("frame", Frame, recorded=True, droppable=False, rate="every step, or fewer"),
    SessionTopic("event", Event, recorded=True, droppable=False, rate="when something happens"),
    SessionTopic("end", End, recorded=True, droppable=False, rate="once a session"),
    SessionTopic("recorded", Recorded, recorded=False, droppable=True, rate="a few a second"),
)
_TOPIC_OF = {topic.message: topic for topic in SESSION_TOPICS}

ROLES = ("router", "participant", "orchestrator", "recorder", "client")


def checked(what: str, name: str) -> str:
    """`name`, if it may stand in a key expression. Raises ValueError."""
    if not name or not is_name(name):
        raise ValueError(f"{what} {name!r} is not a name: letters, digits, _ and -, at most 64")
    return name


@dataclass(frozen=True)
class Live:
    """What a liveliness token says."""

    role: str
    service: str
    instance: str


class Keys:
    """The key expressions of one deployment."""

    def __init__(self, deployment: str = DEFAULT_DEPLOYMENT) -> None:
        self.deployment = checked("deployment", deployment)
        self.root = f"{ROOT}/{deployment}"

    def participant(self, service: str) -> str:
        """Requests to a participant."""
        return f"{self.root}/participant/{checked('service', service)}/request"

    def echo(self, service: str) -> str:
        """A participant sends back what it gets: measures the bus."""
        return f"{self.root}/participant/{checked('service', service)}/echo"

    @property
    def orchestrator(self) -> str:
        """Requests of clients."""
        return f"{self.root}/orchestrator/request"

    @property
    def recorder(self) -> str:
        """Requests to the recorder, answered when what came before is in the file."""
        return f"{self.root}/recorder/request"

    def progress(self, role: str, service: str) -> str:
        """A service's heartbeats."""
        return f"{self.root}/progress/{_role(role)}/{checked('service', service)}"

    @property
    def every_progress(self) -> str:
        return f"{self.root}/progress/*/*"

    def session(self, session: str, message: type) -> str:
        """Where messages of a class about a session are published."""
        return f"{self.root}/session/{checked('session', session)}/{_TOPIC_OF[message].name}"

    def session_all(self, session: str | None = None) -> str:
        """Everything about one session, or about all."""
        return f"{self.root}/session/{checked('session', session) if session else '*'}/*"

    def live(self, role: str, service: str, instance: str) -> str:
        """Liveliness token of a process."""
        return f"{self.root}/@live/{_role(role)}/{checked('service', service)}/{checked('instance', instance)}"

    def every_live(self, role: str | None = None, service: str | None = None) -> str:
        """Tokens of all processes, of a role, or of a service."""
        return f"{self.root}/@live/{_role(role) if role else '*'}/{checked('service', service) if service else '*'}/*"

    def read_live(self, key: str) -> Live | None:
        """What a token's key says, or None if it is not one of this deployment's."""
        head, _, tail = key.partition("/@live/")
        parts = tail.split("/")
        return Live(*parts) if head == self.root and len(parts) == 3 else None


def topic_of(message: type) -> SessionTopic:
    """The session topic of a message class. Raises KeyError."""
    return _TOPIC_OF[message]


def _role(role: str) -> str:
    if role not in ROLES:
        raise ValueError(f"role {role!r} is not one of {', '.join(ROLES)}")
    return role


def table() -> Iterator[tuple[str, str, str, bool]]:
    """Key, kind, message types, recorded: for the documentation and its test."""
    keys = Keys("DEPLOYMENT")
    yield keys.participant("SERVICE"), "query", "Request -> Reply", False
    yield keys.echo("SERVICE"), "query", "bytes -> the same bytes", False
    requests = "Open, Reset, Step, Save, Load, Estimate, Close, End"
    replies = "Observation(s), Saved, Estimated, Closed, Recorded"
    yield keys.orchestrator, "query", f"{requests} -> {replies}", False
    yield keys.recorder, "query", "Begin, End, Commit -> Recorded", False
    yield keys.progress("participant", "SERVICE"), "put", "Progress", False
    for topic in SESSION_TOPICS:
        yield keys.session("SESSION", topic.message), "put", topic.message.__name__, topic.recorded
    yield keys.live("participant", "SERVICE", "INSTANCE"), "token", "", False
