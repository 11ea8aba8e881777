"""Services of this machine: started, watched and asked from the command line. Loads them when they are needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from softseam.errors import BadInput, ServicesFailed, require_extra
from softseam_protocol.models import roles

if TYPE_CHECKING:
    from softseam_services.bus_options import BusOptions

PURPOSE = "running services"


def serve(
    role: str,
    connect: str | None,
    deployment: str | None,
    directory: Path | None,
    route: tuple[str, ...],
    *,
    guard: bool,
) -> int:
    """Serve one role until SIGTERM or Ctrl-C; returns the exit code."""
    from softseam_services import launch

    if role != "router":
        require_extra("solve", PURPOSE)
    options = launch.ServeOptions(_options(connect, deployment), directory or launch.RECORDINGS, guard, _routes(route))
    return launch.serve(role, options)


def up(
    connect: str | None,
    deployment: str | None,
    directory: Path | None,
    route: tuple[str, ...],
    command: tuple[str, ...],
) -> int:
    """Run all services until Ctrl-C, or until `command` has ended; returns the exit code."""
    from softseam_services import launch

    require_extra("solve", PURPOSE)
    options = launch.UpOptions(
        _options(connect, deployment), directory or launch.RECORDINGS, command=command, routes=_routes(route)
    )
    return launch.up(options)


@contextmanager
def services(connect: str, directory: Path, report: Callable[[str], None], ready: float = 900.0) -> Iterator[None]:
    """All services of this machine for as long as the context lasts; recordings go to `directory`.

    report  receives what the services say
    ready   longest wait until all of them are ready, compilation included [s]
    """
    from softseam_services import launch

    require_extra("solve", PURPOSE)
    options = launch.UpOptions(_options(connect, None), directory)
    with launch.supervisor(options, report) as supervisor:
        if not supervisor.wait_ready(ready):
            raise ServicesFailed(supervisor.failure or f"the services were not ready within {ready:g} s")
        yield


def health(connect: str | None, deployment: str | None) -> int:
    """Print which services are well; 0 if all are."""
    from softseam_services.__main__ import show_health

    return show_health(replace(_options(connect, deployment), listen="", wait=3.0), roles())


def _routes(given: tuple[str, ...]) -> dict[str, str]:
    """Raises BadInput."""
    from softseam_services import launch

    try:
        return dict(launch.route(text) for text in given)
    except ValueError as error:
        raise BadInput(str(error)) from None


def _options(connect: str | None, deployment: str | None) -> BusOptions:
    """Options from the environment, changed by what the user says. Raises BadInput."""
    from softseam_protocol.topics import checked
    from softseam_services.bus_options import BusOptions

    options = BusOptions.from_environment()
    try:
        return replace(
            options,
            connect=connect or options.connect,
            deployment=checked("deployment", deployment or options.deployment),
        )
    except ValueError as error:
        raise BadInput(str(error)) from None
