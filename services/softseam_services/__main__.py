"""python -m softseam_services: serve one service, run all of them, warm kernels, ask for their health."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from softseam_protocol.errors import ProtocolError
from softseam_protocol.extensions import ExtensionError, load_extensions
from softseam_protocol.models import roles, solved_here
from softseam_services.bus_options import BusOptions
from softseam_services.launch import RECORDINGS, ServeOptions, UpOptions, route, say, serve, up
from softseam_services.supervisor import WRONG_SET_UP

_SOON = 30
"""days before the end of a certificate at which `health` says so"""


def main(argv: Sequence[str] | None = None) -> int:
    try:
        load_extensions()
    except ExtensionError as error:
        say(str(error))
        return WRONG_SET_UP
    parser = argparse.ArgumentParser(prog="python -m softseam_services", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)

    one = commands.add_parser("serve", help="run one service until SIGTERM or Ctrl-C")
    one.add_argument("role", choices=roles())
    one.add_argument("--guard", action="store_true", help="restart it when it dies or freezes")
    every = commands.add_parser("up", help="run all services of this machine until Ctrl-C")
    for command in (one, every):
        _add_bus(command)
        command.add_argument("--directory", type=Path, default=RECORDINGS, help="where recordings go")
        command.add_argument(
            "--route", type=route, action="append", default=[], metavar="PART=SERVICE", help="who takes a part"
        )
    every.add_argument("client", nargs="*", help="a command to run once all services are ready")

    warm = commands.add_parser("warm", help="compile every kernel into numba's cache")
    warm.add_argument("--whole", action="store_true", help="of models: only what a whole body's first step needs")
    warm.add_argument("what", nargs="+", choices=(*solved_here(), "particles", "orchestrator"))

    health = commands.add_parser("health", help="say which services are well; 0 if all are")
    _add_bus(health)
    health.add_argument("--role", action="append", choices=roles(), help="only this one; may be given several times")

    args = parser.parse_args(argv)
    if args.command == "serve":
        return serve(args.role, ServeOptions(_bus(args), args.directory, args.guard, dict(args.route)))
    if args.command == "up":
        return up(UpOptions(_bus(args), args.directory, tuple(args.client), routes=dict(args.route)))
    if args.command == "warm":
        return _warm(args.what, args.whole)
    return show_health(_bus(args), tuple(args.role or roles()))


def _add_bus(parser: argparse.ArgumentParser) -> None:
    default = BusOptions.from_environment()
    parser.add_argument("--connect", default=default.connect, help="the router's endpoint (%(default)s)")
    parser.add_argument("--listen", default=default.listen, help="of a direct link; '' for none (%(default)s)")
    parser.add_argument("--deployment", default=default.deployment, help="(%(default)s)")
    parser.add_argument("--wait", type=float, default=None, help="longest wait for the router [s]")


def _bus(args: argparse.Namespace) -> BusOptions:
    wait = args.wait if args.wait is not None else (3.0 if args.command == "health" else BusOptions.wait)
    listen = "" if args.command == "health" else args.listen
    return BusOptions(args.connect, listen, args.deployment, wait)


def _warm(what: Sequence[str], whole: bool) -> int:
    from softseam_services import warm_up

    for name in what:
        try:
            if name == "orchestrator":
                warm_up.warm_orchestrator()
            elif name == "particles":
                warm_up.warm_particles()
            elif whole:
                warm_up.warm_whole(name)
            else:
                warm_up.warm_participant(name, mesh=True)
                warm_up.warm_pile(name, touching=True)
        except warm_up.WarmUpFailed as error:
            say(f"{name}: {error}")
            return 1
    return 0


def show_health(options: BusOptions, roles: Sequence[str]) -> int:
    """Print the health of services; 0 if all are well, 1 if not, 2 where no router answers."""
    from softseam_protocol.bus.doors import days_left
    from softseam_protocol.bus.keys import VIEWER
    from softseam_services.health import probe

    services = tuple(role for role in roles if role != "router")
    try:
        with options.open(VIEWER) as bus:
            found = probe(bus, options.keys, services) if services else []
            left = days_left(bus.endpoints, bus.key)
    except ProtocolError as error:
        say(str(error))
        return 2
    if "router" in roles:
        print("router: well")
        if left is not None and left < _SOON:
            print(
                f"router: its certificate ends in {left:.0f} days: run `softseam keys --host NAME` where it runs, and "
                "start it and all services anew"
            )
    for one in found:
        print(one)
    return 0 if all(one.state == "well" for one in found) else 1


if __name__ == "__main__":
    sys.exit(main())
