"""At start: every name that a scene may say has its row in the tables of the solvers.

The protocol has tables of what a scene can say, the services tables of what does it. Who adds a name to one and forgets
the other hears of it when a service starts or a session opens in this process, not in the middle of a step.
"""

from softseam_coupling import ladder
from softseam_coupling.interfaces import KINDS
from softseam_coupling.loops import LOOPS
from softseam_protocol.models import MODELS, solved_here
from softseam_protocol.scene.bodies import BODIES
from softseam_protocol.scene.interfaces import INTERFACES
from softseam_protocol.scene.kinds import ELEMENTS, INTEGRATORS, SCHEMES
from softseam_protocol.scene.ladder import RUNGS
from softseam_protocol.scene.materials import MATERIALS
from softseam_protocol.scene.particles import CONSTRAINTS
from softseam_protocol.scene.parts import PARTS
from softseam_protocol.scene.tools import TOOLS
from softseam_services.bodies import DISCRETISATIONS
from softseam_services.body.materials import LAWS
from softseam_services.fem import elements
from softseam_services.fem.integrators import table as integrators
from softseam_services.pbd.particles import constraints
from softseam_services.shapes import SHAPES
from softseam_services.solvers import SOLVERS


def check_tables() -> None:
    """Raises MissingRow, which names the table and the row that it lacks."""
    for said, done in (
        (BODIES, DISCRETISATIONS),
        (MATERIALS, LAWS),
        (ELEMENTS, elements.ELEMENTS),
        (INTEGRATORS, integrators.INTEGRATORS),
        (SCHEMES, LOOPS),
        (INTERFACES, KINDS),
        (RUNGS, ladder.RUNGS),
        (TOOLS, SHAPES),
        (CONSTRAINTS, constraints.CONSTRAINTS),
        (PARTS, SHAPES),
    ):
        done.require(said, f"the table of {said.title}")
    SOLVERS.require(solved_here(), f"the table of {MODELS.title}")
