"""Models that may have a part of a body: one row a model, the facts that all others need to know of it.

A model from outside is a row here, and, where softseam's own services are to run it, one in the table of solvers
(softseam_services.solvers). No line elsewhere asks for a model by its name.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

from softseam_protocol.scene.kinds import Functions
from softseam_protocol.table import Table

ModelKind = str
"""a row of MODELS"""
Matter = Literal["cells", "tetrahedra", "particles"]
"""what parts are made of: cells that are hexahedra, cells that are a file's tetrahedra, particles"""

GAUSS_POINTS, OCTANT_CENTRES = 1.0 / math.sqrt(3.0), 0.5
"""where in a cell, whose local coordinates go from -1 to 1, its octants' stress may be given [1]"""


@dataclass(frozen=True)
class ModelFacts:
    """What is to be known of a model.

    label              its name in a sentence
    short              its name in a legend; '' where that is the label
    colour             of a body that it has alone: red, green and blue, 0 to 255
    service            of somebody else, that takes its parts; '' where softseam's service of the model's name does
    takes              what its parts may be made of
    reads              keys below `models` in a scene that it reads, such as "fem.integrator"
    functions          with which it interpolates in a cell; '' where those of the element "fem.element"
    stress_at          where in a cell its octants' stress is given, GAUSS_POINTS or OCTANT_CENTRES [1]
    errs_by            what its estimates of error measure: 'mesh', what its cells lack to smaller ones
                       (`Fields.mesh_error`); 'model', what it lacks to finite elements on the same cells
                       (`Fields.model_error`); '' where it gives none
    one_side           it solves for one side of a symmetric scene
    cuts_steps         it takes a step in parts where it cannot take it at once: its reply's `n_substeps` counts these,
                       and is 1 else
    forces_at_end      its contact forces act as a step ends, not over the step
    piles              it takes several whole bodies as one part, a pile (`Configure.bodies`)
    visits_piles       its whole bodies may touch a pile, as guests: they say how nodes answer forces on them
    gives_derivatives  its kernels differentiate steps, and solve for the adjoint of a goal
    """

    label: str
    colour: tuple[int, int, int]
    short: str = ""
    service: str = ""
    takes: frozenset[Matter] = frozenset({"cells"})
    reads: frozenset[str] = frozenset()
    functions: Functions | Literal[""] = "hex8"
    stress_at: float = OCTANT_CENTRES
    errs_by: Literal["mesh", "model", ""] = ""
    one_side: bool = False
    cuts_steps: bool = False
    forces_at_end: bool = False
    piles: bool = False
    visits_piles: bool = False
    gives_derivatives: bool = False

    @property
    def legend(self) -> str:
        """Its name in a legend."""
        return self.short or self.label


def _keys(said: str) -> frozenset[str]:
    """Of "fem: element integrator": fem.element and fem.integrator."""
    settings, _, names = said.partition(":")
    return frozenset(f"{settings}.{name}" for name in names.split())


MODELS: Table[ModelFacts] = Table(
    "models",
    {
        "fem": ModelFacts(
            label="FEM",
            colour=(232, 121, 74),
            takes=frozenset({"cells", "tetrahedra"}),
            reads=_keys("fem: element integrator radius tolerance iterations step_error"),
            functions="",
            stress_at=GAUSS_POINTS,
            errs_by="mesh",
            one_side=True,
            cuts_steps=True,
            forces_at_end=True,
            visits_piles=True,
            gives_derivatives=True,
        ),
        "pbd": ModelFacts(
            label="XPBD",
            short="PBD",
            colour=(108, 148, 196),
            takes=frozenset({"cells", "particles"}),
            reads=_keys("pbd: method classic substeps sweeps residual damping hourglass coarse"),
            errs_by="model",
            piles=True,
        ),
    },
)
"""what a scene may name as a model"""

NEAR_DEFAULT: ModelKind = "fem"
"""model of cells that tools touch, and of bodies that are small, where a scene names none"""
FAR_DEFAULT: ModelKind = "pbd"
"""model of the other cells"""
PARTICLES_DEFAULT = FAR_DEFAULT
"""model of bodies of particles"""
REFERENCE = NEAR_DEFAULT
"""the model whose answer on small cells, with short steps, is what others' errors are judged by"""


def facts_of(name: str) -> ModelFacts:
    """The row of a model; of one that has none, as in a recording of somebody's who has it, plain facts."""
    return MODELS[name] if name in MODELS else ModelFacts(name.upper(), MODELS[FAR_DEFAULT].colour)


def that(fact: Callable[[ModelFacts], object]) -> list[ModelKind]:
    """Models of which a fact is true, in the table's order."""
    return [name for name, facts in MODELS.items() if fact(facts)]


def solved_here() -> tuple[ModelKind, ...]:
    """Models whose parts softseam's own services take, each the service of its name."""
    return tuple(that(lambda facts: not facts.service))


def roles() -> tuple[str, ...]:
    """What a service of softseam's may be, once extensions have added their models."""
    return ("router", *solved_here(), "orchestrator", "recorder")


def service_of(model: str) -> str:
    """The service that takes a model's parts, where no route says another. Raises MissingRow."""
    return MODELS[model].service or model


def taking(matter: Matter) -> list[ModelKind]:
    """Models whose parts may be made of this."""
    return that(lambda facts: matter in facts.takes)


def some_read(models: Iterable[str | None], key: str) -> bool:
    """Whether one of these models reads this key below `models`; None stands for a model that is not chosen yet."""
    return any(name is not None and key in facts_of(name).reads for name in models)
