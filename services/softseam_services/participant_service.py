"""A participant's process: answers requests for one model on the bus, for several sessions.

One thread owns the solvers; zenoh's threads only enqueue. The kernels are warm before the service shows itself.
"""

from softseam_protocol.participant.handler import ParticipantHandler
from softseam_services.bus_options import BusOptions, new_instance
from softseam_services.lifeline import Lifeline
from softseam_services.progress import tell_progress
from softseam_services.server import ParticipantServer
from softseam_services.warm_up import settle, warm_participant, warm_pile

ROLE = "participant"


def serve_participant(model: str, options: BusOptions, life: Lifeline, name: str | None = None) -> None:
    """Serve requests until the process is asked to stop. `name` of the service is the model's by default."""
    service = name or model
    life.state = "compiling"
    warm_participant(model)
    warm_pile(model)
    settle()
    handler = ParticipantHandler(ParticipantServer(), (model,))
    keys, instance = options.keys, new_instance()
    with options.open() as bus:
        server = bus.serve({keys.participant(service): handler, keys.echo(service): bytes}, name=f"softseam {service}")
        tell_progress(life, bus, keys, server, ROLE, service, instance, handler.last)
        life.when_stopping(server.close)
        bus.declare_live(keys.live(ROLE, service, instance))
        life.state = "ready"
        server.run()
