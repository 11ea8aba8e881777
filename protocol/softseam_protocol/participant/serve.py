"""A participant's process: on the bus until it is asked to stop."""

import argparse
import os
import queue
import secrets
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.bus.server import LAST_ANSWERS, Handler
from softseam_protocol.errors import BusError
from softseam_protocol.messages.participant import Configure
from softseam_protocol.models import MODELS
from softseam_protocol.participant.handler import ParticipantHandler
from softseam_protocol.participant.part import Part
from softseam_protocol.participant.part_solver import participant_of
from softseam_protocol.participant.requests import Participant
from softseam_protocol.topics import DEFAULT_DEPLOYMENT, DEFAULT_ENDPOINT, Keys

STOPPING = (signal.SIGTERM, signal.SIGINT)
"""signals that ask a participant to stop"""
_WAIT = 20.0
"""longest wait for the router [s]"""

Solver = Callable[[Configure], Part] | Participant
"""a subclass of Part, what makes one, or a participant of its own"""


@contextmanager
def serving(
    solver: Solver,
    service: str,
    *,
    connect: str = DEFAULT_ENDPOINT,
    deployment: str = DEFAULT_DEPLOYMENT,
    models: tuple[str, ...] = (),
    wait: float = _WAIT,
) -> Iterator[queue.SimpleQueue[BaseException | None]]:
    """Answer in a thread of its own while the context lasts; as `serve`.

    Yields a queue that gets what ended the thread before, as SystemExit does: it serves no more.
    """
    keys = Keys(deployment)
    participant = solver if isinstance(solver, Participant) else participant_of(solver)
    handler = ParticipantHandler(participant, models or (service, *MODELS))
    handlers: dict[str, Handler] = {keys.participant(service): handler, keys.echo(service): bytes}
    ended: queue.SimpleQueue[BaseException | None] = queue.SimpleQueue()
    with Bus(connect, wait, role=SERVICE) as bus:
        server = bus.serve(handlers, name=f"softseam {service}")

        def run() -> None:
            try:
                server.run()
            except BaseException as error:
                ended.put(error)

        thread = threading.Thread(target=run, name=server.name, daemon=True)
        thread.start()
        bus.declare_live(keys.live("participant", service, secrets.token_hex(6)))
        try:
            yield ended
        finally:
            server.close()
            thread.join(LAST_ANSWERS)


def serve(
    solver: Solver,
    service: str,
    *,
    connect: str = DEFAULT_ENDPOINT,
    deployment: str = DEFAULT_DEPLOYMENT,
    models: tuple[str, ...] = (),
) -> None:
    """Answer requests as this service until the process gets SIGTERM or SIGINT (Ctrl-C); call it in the main thread.

    connect  the router's endpoint
    models   by which scenes may call the part: the service's name, fem and pbd, in whose place it moves the part

    One thread, not the main one, calls the solver. Raises NoRouter, ValueError for names that are none, and what a
    solver raises that is no Exception, as SystemExit.
    """
    before: dict[signal.Signals, Any] = {}
    try:
        with serving(solver, service, connect=connect, deployment=deployment, models=models) as ended:
            before = {number: signal.signal(number, lambda *_: ended.put(None)) for number in STOPPING}
            print(f"{service} answers at {connect}; Ctrl-C stops it", flush=True)
            error = ended.get()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if error is not None:
        raise error


def main(solver: Solver, service: str, models: tuple[str, ...] = ()) -> None:
    """`serve` by the command line: `--connect`, `--service` and `--deployment`, or SOFTSEAM_CONNECT and
    SOFTSEAM_DEPLOYMENT."""
    parser = argparse.ArgumentParser()
    setting = os.environ.get
    parser.add_argument("--connect", default=setting("SOFTSEAM_CONNECT", DEFAULT_ENDPOINT), help="router (%(default)s)")
    parser.add_argument("--service", default=service, help="its name on the bus (%(default)s)")
    parser.add_argument(
        "--deployment", default=setting("SOFTSEAM_DEPLOYMENT", DEFAULT_DEPLOYMENT), help="(%(default)s)"
    )
    args = parser.parse_args()
    try:
        serve(solver, args.service, connect=args.connect, deployment=args.deployment, models=models)
    except (BusError, ValueError) as error:
        sys.exit(str(error))
