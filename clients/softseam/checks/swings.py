"""Bodies that were to be found at rest, and have parts by XPBD, which knows no rest but what motion ends in."""

from collections.abc import Iterator

from softseam.to_check import Ended
from softseam_protocol.models import some_read
from softseam_protocol.scene.kinds import INTEGRATORS


def look(run: Ended) -> Iterator[str]:
    integrator = run.scene.models.fem.integrator
    others = [model for model in run.columns.models.values() if not some_read([model], "fem.integrator")]
    if others and not INTEGRATORS[integrator].moves:
        yield (
            f"models.fem.integrator: {integrator}: the run is by {others[0]}, which moves the body, so its values "
            "swing until something damps them: say body.damping, or take fem"
        )
