"""FEM's factor, whose memory grows with the power 1.35 of the unknowns."""

from collections.abc import Iterator

from softseam_protocol.models import some_read
from softseam_services.to_check import Cells

_MANY = 100_000
"""unknowns whose factor takes 1.5 GB, and seconds"""


def look(seen: Cells) -> Iterator[str]:
    scene, body = seen.scene, seen.body
    n = 3 * int((~body.fixed).sum()) / 2 ** len(scene.symmetry)
    if some_read([scene.regions.default], "fem.element") and n > _MANY:
        yield (
            f"body.cell: fem factors a matrix of {n:,.0f} unknowns, which takes about {1.5 * (n / _MANY) ** 1.35:.2g} "
            "GB, and a step many seconds: give a longer edge, or `symmetry` where the scene has one"
        )
