"""Runs services: one in this process (`serve`), or all of a machine under a supervisor (`up`). Returns exit codes."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from softseam_protocol.errors import BusError, ProtocolError
from softseam_protocol.extensions import ExtensionError, load_extensions
from softseam_protocol.models import MODELS, roles, solved_here
from softseam_protocol.table import MissingRow
from softseam_protocol.topics import checked
from softseam_services.bus_options import BusOptions
from softseam_services.child import Service, service_argv
from softseam_services.lifeline import Lifeline
from softseam_services.recorder.whole_file import RecordError
from softseam_services.supervisor import WRONG_SET_UP, Limits, Supervisor

_GRACE = {"recorder": 30.0, "orchestrator": 15.0}
RECORDINGS = Path("recordings")


def say(text: str) -> None:
    """One line for whoever runs this."""
    print(text, file=sys.stderr, flush=True)


# ---- one service -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ServeOptions:
    """What one service is told.

    listen      of the router: where everybody connects; of others: see BusOptions
    directory   of the recorder: where its files go
    guard       run the service in a child process that is restarted when it dies or freezes
    routes      of the orchestrator: the service that takes a part or a model, where that is not the model's own
    """

    bus: BusOptions = field(default_factory=BusOptions.from_environment)
    directory: Path = RECORDINGS
    guard: bool = False
    routes: Mapping[str, str] = field(default_factory=dict)


def route(text: str) -> tuple[str, str]:
    """Part, or model, and service of `--route PART=SERVICE`. Raises ValueError."""
    part, equals, service = text.partition("=")
    body, dot, side = part.partition(".")
    if not (equals and service and ((body and dot and side) or part in MODELS)):
        raise ValueError(
            f"{text!r} is no route: give PART=SERVICE with a part's id, such as body.far=my_solver, or a model's name, "
            "such as pbd=my_solver"
        )
    return part, checked("service", service)


def serve(role: str, options: ServeOptions) -> int:
    """Serve one role until SIGTERM or Ctrl-C: 0, 2 where it is set up wrongly, 1 for what should not happen."""
    try:
        load_extensions()
    except ExtensionError as error:
        say(str(error))
        return WRONG_SET_UP
    if role not in roles():
        say(f"no service is called {role!r}; there are: {', '.join(roles())}")
        return WRONG_SET_UP
    if options.guard:
        return _guard(role, options)
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    try:
        with Lifeline() as life:
            _serve(role, options, life)
    except (BusError, MissingRow, RecordError) as error:
        say(str(error))
        return WRONG_SET_UP
    except ProtocolError as error:
        say(str(error))
        return 1
    return 0


def _serve(role: str, options: ServeOptions, life: Lifeline) -> None:
    """Each role imports what it needs, and no more."""
    if role == "router":
        from softseam_protocol.bus.client import Router

        with Router(options.bus.connect):
            life.state = "ready"
            life.stop.wait()
    elif role in solved_here():
        from softseam_services.participant_service import serve_participant
        from softseam_services.tables import check_tables

        check_tables()
        serve_participant(role, options.bus, life)
    elif role == "orchestrator":
        from softseam_services.orchestrator.service import serve_orchestrator
        from softseam_services.tables import check_tables

        check_tables()
        serve_orchestrator(options.bus, life, options.routes)
    else:
        from softseam_services.recorder.service import serve_recorder

        serve_recorder(options.directory, options.bus, life)


def _options_argv(role: str, options: ServeOptions) -> tuple[str, ...]:
    bus = options.bus
    argv = ["--connect", bus.connect, "--deployment", bus.deployment, "--wait", f"{bus.wait:g}"]
    argv += ["--listen", bus.listen]
    if role == "recorder":
        argv += ["--directory", str(options.directory)]
    if role == "orchestrator":
        argv += [word for part, service in options.routes.items() for word in ("--route", f"{part}={service}")]
    return tuple(argv)


def child(role: str, options: ServeOptions) -> Service:
    """The role as a child process of a supervisor."""
    return Service(role, service_argv(role, *_options_argv(role, options)), _GRACE.get(role, 5.0))


def _guard(role: str, options: ServeOptions) -> int:
    with Supervisor([child(role, options)], say) as supervisor, supervisor.stopped_by_signals():
        supervisor.wait_stopped()
    return _verdict(supervisor)


def _verdict(supervisor: Supervisor) -> int:
    if supervisor.failure:
        say(supervisor.failure)
    return supervisor.exit_code


# ---- all services ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class UpOptions:
    """What `softseam up` is told.

    directory  where the recorder's files go
    command    argv to run once all services are ready (a client); its end stops the services
    ready      longest wait for all services to be ready, compilation included [s]
    routes     see ServeOptions
    """

    bus: BusOptions = field(default_factory=BusOptions.from_environment)
    directory: Path = RECORDINGS
    command: tuple[str, ...] = ()
    ready: float = 300.0
    limits: Limits = field(default_factory=Limits)
    routes: Mapping[str, str] = field(default_factory=dict)


def supervisor(options: UpOptions, report: Callable[[str], None] = say) -> Supervisor:
    """All services of this machine, the router first; use as a context manager."""
    serve_options = ServeOptions(options.bus, options.directory.absolute(), routes=options.routes)
    order = ("router", *solved_here(), "recorder", "orchestrator")
    return Supervisor([child(role, serve_options) for role in order], report, options.limits)


def up(options: UpOptions, report: Callable[[str], None] = say) -> int:
    """Run all services until Ctrl-C, or until the command has ended; then stop them in order.

    Returns the command's exit code, 0 without one; 2 where a service cannot run as set up (a busy port).
    """
    with supervisor(options, report) as services, services.stopped_by_signals():
        if not services.wait_ready(options.ready):
            if not services.failure and not services.stopping:
                report(f"not all services were ready within {options.ready:g} s")
                services.request_stop()
                services.wait_stopped()
                return 1
        elif options.command:
            return _run_client(options.command, services)
        else:
            report(f"all services are ready at {options.bus.connect}; Ctrl-C stops them")
        services.wait_stopped()
    return _verdict(services)


def _run_client(command: Sequence[str], services: Supervisor) -> int:
    """Run the client's command beside the services; it is stopped where they give up."""
    process = subprocess.Popen(command)

    def follow() -> None:
        process.wait()
        services.request_stop()

    threading.Thread(target=follow, daemon=True).start()
    services.wait_stopped()
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
    if services.failure:
        return _verdict(services)
    return os.EX_SOFTWARE if process.returncode is None else process.returncode
