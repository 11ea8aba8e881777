"""The loops of the study as rows of the product's tables, as any extension adds its own.

To run a scene by one of them, of the names in `ROWS`:

    PYTHONPATH=tests SOFTSEAM_EXTENSIONS=analysis.extension softseam run cantilever --set seam.scheme=ph
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from analysis.accelerations.aitken import Aitken
from analysis.accelerations.constant import Constant
from analysis.accelerations.iqn_ils import IqnIls
from analysis.loops.accelerated import Accelerated
from analysis.loops.prakash_hjelmstad import PrakashHjelmstad
from softseam_coupling.loops import LOOPS
from softseam_coupling.loops.loop import Loop, LoopSetup
from softseam_protocol.scene.kinds import INTEGRATORS, SCHEMES, IntegratorKind, SchemeFacts

MEET_PH: tuple[IntegratorKind, ...] = ("implicit_euler", "midpoint", "bdf2", "newmark", "generalised_alpha")
"""FEM's integrators to which a multiplier that is linear over a step gives no energy"""
ACCELERATED = ("iqn_ils", "aitken", "constant")
"""rows that close the product's gap without a compliance"""
ROWS: dict[str, tuple[SchemeFacts, Callable[[LoopSetup], Loop]]] = {
    "ph": (SchemeFacts(), PrakashHjelmstad),
    "ph_iqn_ils": (SchemeFacts(like="ph"), lambda setup: PrakashHjelmstad(setup, IqnIls())),
    "iqn_ils": (SchemeFacts(like="position"), lambda setup: Accelerated(setup, IqnIls())),
    "aitken": (SchemeFacts(like="position"), lambda setup: Accelerated(setup, Aitken())),
    "constant": (SchemeFacts(like="position"), lambda setup: Accelerated(setup, Constant())),
}
"""by the name that `seam.scheme` takes: what a scene may say of a loop, and what builds it"""


def add() -> None:
    """Add all rows, and let integrators meet `ph`."""
    for name, (facts, build) in ROWS.items():
        SCHEMES.add(name, facts)
        LOOPS.add(name, build)
    for integrator, met in dict(INTEGRATORS).items():  # all anew, so that they keep their order
        INTEGRATORS.remove(integrator)
        seams = met.seams | {"ph"} if integrator in MEET_PH else met.seams
        INTEGRATORS.add(integrator, replace(met, seams=seams))


def remove() -> None:
    """Take them out again."""
    for name in ROWS:
        SCHEMES.remove(name)
        LOOPS.remove(name)
    for integrator, met in dict(INTEGRATORS).items():
        INTEGRATORS.remove(integrator)
        INTEGRATORS.add(integrator, replace(met, seams=met.seams - {"ph"}))


@contextmanager
def added() -> Iterator[None]:
    """The tables with these rows."""
    add()
    try:
        yield
    finally:
        remove()
