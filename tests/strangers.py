"""Who has no business on a bus, and everything that they try there; each attempt says whether it was obeyed."""

from __future__ import annotations

import base64
import json
import os
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from softseam.connected import ConnectedBackend
from softseam_protocol.bus.client import Bus
from softseam_protocol.errors import ProtocolError
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import EventKind, FailureKind
from softseam_protocol.messages.participant import Bundle, Failure, Release, Released
from softseam_protocol.messages.recording import Begin, End, Recorded
from softseam_protocol.messages.session import (
    Close,
    Closed,
    Event,
    Load,
    Observation,
    Open,
    Progress,
    Reset,
    Save,
    Saved,
    Step,
    StepReport,
)
from softseam_protocol.topics import Keys
from softseam_protocol.wire.codec import decode, encode

KEYS = Keys()
_PAUSE = 0.3
"""until what a stranger did is heard, or is not [s]"""
_SOON = 10.0
FORGED = "by a stranger"


def listeners(pid: int) -> set[int]:
    """Ports of the loopback at which a process of this machine listens."""
    sockets = set()
    for fd in Path(f"/proc/{pid}/fd").iterdir():
        try:
            sockets.add(os.readlink(fd))
        except FileNotFoundError:
            continue  # it was closed meanwhile
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return {int(row[1].rpartition(":")[2], 16) for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in sockets}


def join(endpoint: str, credentials: tuple[str, str] | None, authority: str = "", mode: str = "client") -> Any:
    """A session of zenoh, by a user and a password or without, or None where it is not let in.

    authority  the certificate (PEM) by which it knows an encrypted door
    mode       of zenoh: what it says that it is
    """
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": mode,
        "listen/endpoints": [],
        "connect/endpoints": [endpoint],
        "connect/exit_on_failure": True,
        "connect/timeout_ms": 1500,
        "scouting/multicast/enabled": False,
    }
    if credentials is not None:
        user, password = credentials
        settings |= {"transport/auth/usrpwd/user": user, "transport/auth/usrpwd/password": password}
    if authority:
        settings["transport/link/tls/root_ca_certificate_base64"] = base64.b64encode(authority.encode()).decode()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError:
        return None


@dataclass
class Attack:
    """A stranger beside a client's session: what it reaches by, whom it is after, and what it has seen."""

    session: Any
    victim: ConnectedBackend
    friend: Bus
    """a service's, which hears what services hear"""
    bundle: Bundle

    def __post_init__(self) -> None:
        self.names = {self.victim.session}
        self.payloads: list[bytes] = []
        self.watched: set[str] = set()
        self._number = 10**6

    def header(self, session: str, part: str = "") -> Header:
        self._number += 1
        return Header(SCHEMA_VERSION, session, part, 0, 0, self._number, 0.0)

    def ask(self, key: str, message: Any) -> object:
        """The answer, None where nobody answered."""
        for reply in self.session.get(key, payload=encode(message), timeout=_SOON):
            try:
                return decode((reply.ok or reply.err).payload.to_bytes())
            except ProtocolError:
                return "an answer that is no message"
        return None

    def asks_by_every_name(self, key: str, make: Callable[[str], Any], good: type) -> bool:
        """Whether one of the names that it has heard opens anything."""
        return any(isinstance(self.ask(key, make(name)), good) for name in sorted(self.names))


def looks(attack: Attack) -> None:
    """Everything that can be seen from here, with the names in it."""
    tokens = [
        str(reply.ok.key_expr)
        for key in ("softseam/*/@live/**", "softseam/@node/*", "@/**")
        for reply in attack.session.liveliness().get(key, timeout=1.0)
        if reply.ok is not None
    ]

    def seen(sample: Any) -> None:
        attack.watched.add(str(sample.key_expr))
        attack.payloads.append(sample.payload.to_bytes())

    keys = ("softseam/**", KEYS.session_all(attack.victim.session), KEYS.every_progress)
    handlers = [zenoh.handlers.Callback(seen, None, indirect=False) for _ in keys]
    watches = [attack.session.declare_subscriber(key, each) for key, each in zip(keys, handlers, strict=True)]
    time.sleep(_PAUSE)
    attack.victim.step(1, None, False)
    time.sleep(_PAUSE)
    for watch in watches:
        watch.undeclare()
    attack.watched |= set(tokens)
    attack.names |= {word for key in attack.watched for word in key.split("/") if len(word) >= 12}


def watches(attack: Attack) -> bool:
    return KEYS.session(attack.victim.session, StepReport) in attack.watched


def learns_the_secret(attack: Attack) -> bool:
    secret = getattr(attack.victim, "secret", attack.victim.session)
    return any(secret in key for key in attack.watched) or any(secret.encode() in each for each in attack.payloads)


def reads_the_state(attack: Attack) -> bool:
    return attack.asks_by_every_name(KEYS.orchestrator, lambda name: Save(attack.header(name)), Saved)


def steps(attack: Attack) -> bool:
    push = {"front": np.array([0.0, 0.01, 0.0])}
    return attack.asks_by_every_name(
        KEYS.orchestrator, lambda name: Step(attack.header(name), 1, False, push), Observation
    )


def loads(attack: Attack) -> bool:
    """Refused for its bytes would be obeyed, too: somebody read them."""
    names = sorted(attack.names)
    found = [attack.ask(KEYS.orchestrator, Load(attack.header(name), b"no state")) for name in names]
    return any(isinstance(each, Failure) and each.kind == FailureKind.INVALID for each in found)


def resets(attack: Attack) -> bool:
    return attack.asks_by_every_name(KEYS.orchestrator, lambda name: Reset(attack.header(name), 1), Observation)


def drops_a_part(attack: Attack) -> bool:
    """The participant forgets the victim's part."""
    make = lambda name: Release(attack.header(name, "body.near"))  # noqa: E731
    return attack.asks_by_every_name(KEYS.participant("fem"), make, Released)


def forges_an_event(attack: Attack) -> bool:
    heard = attack.friend.subscribe(KEYS.session_all())
    time.sleep(_PAUSE)
    name = attack.victim.session
    attack.session.put(KEYS.session(name, Event), encode(Event(attack.header(name), EventKind.BUS, FORGED)))
    end, found = time.monotonic() + _PAUSE, False
    while not found and (received := heard.get(end - time.monotonic())) is not None:
        found = FORGED.encode() in received.payload
    heard.close()
    return found


def forges_a_heartbeat(attack: Attack) -> bool:
    heard = attack.friend.subscribe(KEYS.every_progress)
    time.sleep(_PAUSE)
    beat = Progress("forged", "i", "", 0, 0, 0.0)
    attack.session.put(KEYS.progress("participant", "forged"), encode(beat))
    end, found = time.monotonic() + _PAUSE, False
    while not found and (received := heard.get(end - time.monotonic())) is not None:
        found = b"forged" in received.payload
    heard.close()
    return found


def has_the_recorder_write(attack: Attack) -> bool:
    name = f"flood{os.urandom(4).hex()}"
    begin = Begin(attack.header(name), attack.bundle, 0, {}, {})
    return isinstance(attack.ask(KEYS.recorder, begin), Recorded)


def ends_the_recording(attack: Attack) -> bool:
    keys = (KEYS.recorder, KEYS.orchestrator)
    make = lambda name: End(attack.header(name), FORGED)  # noqa: E731
    return any(attack.asks_by_every_name(key, make, Recorded) for key in keys)


def passes_for(role: str, service: str) -> Callable[[Attack], bool]:
    def attempt(attack: Attack) -> bool:
        forged = KEYS.live(role, service, os.urandom(8).hex())
        token = attack.session.liveliness().declare_token(forged)
        time.sleep(_PAUSE)
        found = forged in attack.friend.live("softseam/*/@live/**")
        token.undeclare()
        return found

    return attempt


def makes_the_victim_seem_gone(attack: Attack) -> bool:
    """Show its token, and take it back."""
    key = KEYS.live("client", "session", attack.victim.session)
    changes = attack.friend.watch_live(key)
    token = attack.session.liveliness().declare_token(key)
    time.sleep(_PAUSE)
    token.undeclare()
    end, gone = time.monotonic() + 2.0 * _PAUSE, False
    while not gone and (change := changes.get(end - time.monotonic())) is not None:
        gone = not change.alive
    changes.close()
    return gone or key not in attack.friend.live_at_router(key)


def gets_requests(attack: Attack) -> bool:
    """Serve what the orchestrator and a participant serve, and wait for the victim's request."""
    took: list[str] = []
    take = lambda query: took.append(str(query.key_expr))  # noqa: E731
    served = [
        attack.session.declare_queryable(key, zenoh.handlers.Callback(take, None, indirect=False), complete=True)
        for key in (KEYS.orchestrator, KEYS.participant("fem"), KEYS.participant("pbd"), KEYS.recorder, "softseam/**")
    ]
    time.sleep(_PAUSE)
    try:
        attack.victim.step(1, None, False)
    except Exception as error:
        took.append(str(error))
    for each in served:
        each.undeclare()
    return bool(took)


def reads_the_router(attack: Attack) -> bool:
    """zenoh's own keys, of any session but its own."""
    own = str(attack.session.info.zid())
    found = [str(reply.ok.key_expr) for reply in attack.session.get("@/**", timeout=1.0) if reply.ok is not None]
    return any(not key.startswith(f"@/{own}/") for key in found)


def opens_a_session(attack: Attack) -> bool:
    """A place of the orchestrator; given back at once."""
    name = f"taken{os.urandom(8).hex()}"
    opened = attack.ask(KEYS.orchestrator, Open(attack.header(name), attack.bundle, False))
    if isinstance(opened, Observation):
        attack.ask(KEYS.orchestrator, Close(attack.header(name)))
    return isinstance(opened, Observation)


def closes(attack: Attack) -> bool:
    for name in sorted(attack.names):
        attack.ask(KEYS.orchestrator, Close(attack.header(name)))  # no error where there is no such session
    try:
        attack.victim.step(1, None, False)
    except Exception:
        return True
    return False


ATTEMPTS: dict[str, Callable[[Attack], bool]] = {
    "watches": watches,
    "learns the secret": learns_the_secret,
    "reads the state": reads_the_state,
    "steps": steps,
    "loads": loads,
    "resets": resets,
    "drops a part": drops_a_part,
    "forges an event": forges_an_event,
    "forges a heartbeat": forges_a_heartbeat,
    "has the recorder write": has_the_recorder_write,
    "ends the recording": ends_the_recording,
    "passes for an orchestrator": passes_for("orchestrator", "orchestrator"),
    "passes for a participant": passes_for("participant", "forged"),
    "makes the victim seem gone": makes_the_victim_seem_gone,
    "gets requests": gets_requests,
    "reads the router": reads_the_router,
    "opens a session": opens_a_session,
    "closes": closes,
}


def obeyed(attack: Attack, attempts: Iterable[str] = tuple(ATTEMPTS)) -> set[str]:
    """The attempts that were obeyed."""
    looks(attack)
    return {name for name in attempts if ATTEMPTS[name](attack)}


def mumbles(attack: Attack, frames: int, seed: int) -> int:
    """Send the orchestrator what are no requests, or hardly; how many were answered otherwise than by a Failure."""
    random = np.random.default_rng(seed)
    name = attack.victim.session
    whole = [encode(make(attack.header(name))) for make in (Save, Close)]
    whole += [encode(Step(attack.header(name), 1, True, {})), encode(Load(attack.header(name), bytes(300)))]
    whole += [encode(Reset(attack.header(name), 1, attack.bundle)), encode(End(attack.header(name), "mumbled"))]
    obeyed = 0
    for _ in range(frames):
        frame = bytearray(whole[random.integers(len(whole))])
        for place in random.integers(len(frame), size=random.integers(1, 9)):
            frame[place] = random.integers(256)
        del frame[random.integers(1, 2 * len(frame)) :]
        for reply in attack.session.get(KEYS.orchestrator, payload=bytes(frame), timeout=_SOON):
            obeyed += reply.ok is not None and not isinstance(decode(reply.ok.payload.to_bytes()), Closed)
    return obeyed
