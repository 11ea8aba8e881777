"""python -m softseam.examples.participant [--connect ENDPOINT] [--service NAME] [--deployment NAME]"""

from __future__ import annotations

import argparse
import secrets

from softseam.examples.participant.requests import Participant
from softseam_protocol.bus.client import Bus
from softseam_protocol.topics import DEFAULT_DEPLOYMENT, DEFAULT_ENDPOINT, Keys


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m softseam.examples.participant", description=__doc__)
    parser.add_argument("--connect", default=DEFAULT_ENDPOINT, help="the router's endpoint (%(default)s)")
    parser.add_argument("--service", default="block", help="its name on the bus (%(default)s)")
    parser.add_argument("--deployment", default=DEFAULT_DEPLOYMENT, help="(%(default)s)")
    args = parser.parse_args()
    keys = Keys(args.deployment)
    with Bus(args.connect) as bus:
        server = bus.serve({keys.participant(args.service): Participant(), keys.echo(args.service): bytes})
        bus.declare_live(keys.live("participant", args.service, secrets.token_hex(6)))
        print(f"{args.service} answers at {args.connect}; Ctrl-C stops it", flush=True)
        try:
            server.run()
        except KeyboardInterrupt:
            server.close()


if __name__ == "__main__":
    main()
