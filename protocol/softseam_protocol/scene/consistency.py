"""What in a scene cannot go together: one table of pairs of features, each with the sentence that refuses it.

And what goes together, yet not well, or with one model alone.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from types import UnionType
from typing import TYPE_CHECKING

from pydantic_core import PydanticCustomError

from softseam_protocol.inner_ball import inner_ball
from softseam_protocol.models import FAR_DEFAULT, NEAR_DEFAULT, ModelKind, some_read, taking, that
from softseam_protocol.quantities import QUANTITIES
from softseam_protocol.scene.bodies import AnyBody, BlockShape, MeshShape
from softseam_protocol.scene.kinds import ELEMENTS, INTEGRATORS, element_warning, integrator_problem
from softseam_protocol.scene.models import CLASSIC_PBD, DampingSpec, ModelsSpec
from softseam_protocol.scene.motion import ClosePhase, GripPhase, ReleasePhase
from softseam_protocol.scene.spec import key, not_among, wrong
from softseam_protocol.tool_borders import tool_borders

if TYPE_CHECKING:  # which stands on this
    from softseam_protocol.scene.scene import Scene

Place = tuple[str | int, ...]
"""where in a scene something is said"""


class Asked:
    """A scene with one body and a model, as features and sentences below read it.

    kinds  of all bodies of the scene: cells, particles, points
    """

    def __init__(self, scene: Scene, kinds: Collection[str]) -> None:
        self.scene, self.kinds, self.body, self.cells = scene, {*kinds}, scene.body, scene.body.in_cells
        self.fem, self.pbd, self.regions = scene.models.fem, scene.models.pbd, scene.regions
        self.models = scene.regions.models
        """of cells that are not near, and of those that are or would be"""
        self.shape = None if self.cells is None else self.cells.shape
        self.have = self.body.no_cells
        able = taking("tetrahedra" if self.body.tetrahedral else "particles" if self.cells is None else "cells")
        self.able, self.one_sided = able, " and ".join(that(lambda facts: facts.one_side))
        self.able_or, self.able_and = " or ".join(able), " and ".join(able)
        self.rough = " and ".join(name for name in that(lambda facts: facts.errs_by == "model") if name in self.models)

    def reads(self, setting: str) -> bool:
        """Whether a model of the body's cells reads this key; without cells whatever is said counts."""
        return self.cells is None or some_read(self.models, setting)

    @property
    def uneven(self) -> bool:
        """Whether cells may be no boxes of one size."""
        graded = isinstance(self.shape, BlockShape) and self.shape.graded
        return graded or (isinstance(self.shape, MeshShape) and self.shape.cells == "own")

    @property
    def follows_a_sphere(self) -> bool:
        shape = self.shape
        if self.cells is None or not isinstance(shape, BlockShape) or shape.borders != "materials":
            return False
        return inner_ball(shape.size, self.cells.position, self.cells.inclusions) is not None

    @property
    def integrator_problem(self) -> str:
        """What is wrong with FEM's integrator here, and what to do; '' where nothing is."""
        if self.cells is None or not self.reads("fem.integrator"):
            return ""
        scheme = self.scene.seam.scheme if self.regions.cut else None
        return integrator_problem(self.fem.integrator, scheme, bool(self.scene.tools), bool(self.cells.fixed))

    def quantity(self, odd: Callable[[str], bool]) -> Place | None:
        """Where the first quantity is whose name is odd."""
        return next((("quantities", i) for i, name in enumerate(self.scene.quantities) if odd(name)), None)

    def phase(self, key: str, kinds: type | UnionType) -> Place | None:
        """Where the first phase of these kinds is that says this key."""
        found = (i for i, one in enumerate(self.scene.motion) if isinstance(one, kinds) and getattr(one, key, None))
        return next((("motion", i, key) for i in found), None)


Feature = Callable[[Asked], Place | None]
"""where a scene says it; None where it does not"""


def _at(place: str, is_said: Callable[[Asked], object]) -> Feature:
    where = key(place)
    return lambda asked: where if is_said(asked) else None


FEATURES: dict[str, Feature] = {
    "cells": _at("body", lambda a: a.cells is not None),
    "no cells": _at("body", lambda a: a.cells is None),
    "bodies in cells alone": _at("bodies", lambda a: a.kinds == {"cells"}),
    "no body in cells": _at("bodies", lambda a: "cells" not in a.kinds),
    "held by friction": _at("body", lambda a: a.body.held_by_friction),
    "constraints": _at("body.constraints", lambda a: a.body.said("constraints", ())),
    "uneven friction": _at("body.friction_field", lambda a: a.body.uneven_friction),
    "drag": _at("body.damping", lambda a: a.cells is not None and a.cells.damping > 0.0),
    "viscosity": _at("body.material", lambda a: a.cells is not None and a.cells.material.retardation_time > 0.0),
    "tetrahedra": _at("body.shape.cells", lambda a: a.body.tetrahedral),
    "own hexahedra": _at("body.shape.cells", lambda a: isinstance(a.shape, MeshShape) and a.shape.cells == "own"),
    "cells round a sphere": _at("body.shape.borders", lambda a: a.follows_a_sphere),
    "uneven cells": _at("body.shape", lambda a: a.uneven),
    "uneven cells of a rough model": _at("body.shape", lambda a: a.uneven and a.rough),
    "symmetry": _at("symmetry", lambda a: a.scene.symmetry),
    "near": _at("regions.near", lambda a: a.regions.near),
    "near.error": _at("regions.near.error", lambda a: a.regions.near and a.regions.near.error is not None),
    "goal": _at("regions.goal", lambda a: a.regions.goal is not None),
    "goal grip_force": _at("regions.goal", lambda a: a.regions.goal == "grip_force"),
    "goal of a probe": _at("regions.goal", lambda a: a.regions.goal not in (None, "grip_force")),
    "no such probe": _at("probes", lambda a: a.regions.goal not in a.scene.probes),
    "no closing": _at("motion", lambda a: a.phase("close", ClosePhase) is None),
    "probes": _at("probes", lambda a: a.scene.probes),
    "default of others": _at("regions.default", lambda a: a.models[0] not in a.able),
    "near of others": _at("regions.near.model", lambda a: a.models[1] not in a.able),
    "no model for one side": _at("regions", lambda a: not {*a.models} & {*that(lambda facts: facts.one_side)}),
    "model_error": lambda a: a.quantity(lambda name: name == "model_error"),
    "quantity of others": lambda a: a.quantity(lambda name: QUANTITIES[name].of not in ("any", a.body.made_of)),
    "quantity of strength": lambda a: a.quantity(lambda name: QUANTITIES[name].of_strength),
    "no strength": _at("body.material", lambda a: a.cells is not None and not a.cells.says_strength),
    "grip": lambda a: a.phase("grip", GripPhase) or a.phase("release", ReleasePhase),
    "held force": lambda a: a.phase("force", ClosePhase),
    "force_limit": lambda a: next(
        (("tools", name, "force_limit") for name, tool in a.scene.tools.items() if getattr(tool, "force_limit", None)),
        None,
    ),
    "tools": _at("tools", lambda a: a.scene.tools),
    "element of tetrahedra": _at("models.fem.element", lambda a: a.fem.element.startswith("tet")),
    "element of hexahedra": _at("models.fem.element", lambda a: ELEMENTS[a.fem.element].functions[:3] == "hex"),
    "symplectic_euler": _at("models.fem.integrator", lambda a: a.fem.integrator == "symplectic_euler"),
    "integrator out of place": _at("models.fem.integrator", lambda a: a.integrator_problem),
    "integrator without viscosity": _at(
        "models.fem.integrator", lambda a: a.reads("fem.integrator") and not INTEGRATORS[a.fem.integrator].viscous
    ),
    "step_error": _at("models.fem.step_error", lambda a: a.fem.step_error is not None and a.reads("fem.step_error")),
    "leapfrog": _at("models.pbd.method", lambda a: a.pbd.method == "leapfrog" and a.reads("pbd.method")),
    "classic pbd": _at("models.pbd.method", lambda a: a.pbd.method == CLASSIC_PBD),
    "residual": _at("models.pbd.residual", lambda a: a.pbd.residual is not None),
    "coarse": _at("models.pbd.coarse", lambda a: a.pbd.coarse is not None and a.reads("pbd.coarse")),
    "pbd.damping": _at("models.pbd.damping", lambda a: a.pbd.damping != DampingSpec()),
    "damping by mass": _at("models.pbd.damping.mass", lambda a: a.pbd.damping.mass > 0.0 and a.reads("pbd.damping")),
    "damping by stiffness": _at(
        "models.pbd.damping.stiffness", lambda a: a.pbd.damping.stiffness > 0.0 and a.reads("pbd.damping")
    ),
}
"""what scenes may say or be, by name"""

_ONE_MODEL = "have one model, for a seam runs along faces that are rectangles: leave out regions.near, or"
_OF_A_FILE = "cells that are a file's tetrahedra"
_ROUGH = "the model error of {a.rough} is measured on boxes of one size: leave out"
_COARSE = "the model error of pbd is measured on cells of eight blocks: leave out"
_EVEN = "errors of a goal are known of boxes of one size: leave out body.shape.grading, or goal"
_TWICE = "says the same for both models: leave one of them out"
_EXPLICIT = "leapfrog solves no equations and cannot meet"

REFUSED: dict[tuple[str, str], str] = {
    ("symmetry", "tetrahedra"): "tetrahedra of a file are not each other's images: leave it out",
    ("uneven friction", "symmetry"): "friction varies over both sides as neither's image: leave it out, or `symmetry`",
    ("symmetry", "no model for one side"): (
        "only {a.one_sided} solves for one side, and no region is {a.one_sided}'s: leave it out"
    ),
    ("symmetry", "element of tetrahedra"): (
        "{a.fem.element} divides cells otherwise on either side: leave it out, or use hex27"
    ),
    ("symmetry", "symplectic_euler"): "symplectic_euler solves no equations: leave it out",
    ("grip", "held by friction"): "a {a.body.kind} is held by friction: close two tools on it",
    ("classic pbd", "constraints"): "classic pbd has no compliance: constraints need xpbd",
    ("leapfrog", "no cells"): "{a.have}: leapfrog moves cells, use xpbd",
    ("residual", "no cells"): "{a.have}: only blocks have a residual, leave it out",
    ("coarse", "no cells"): "{a.have}: leave it out",
    ("pbd.damping", "no cells"): "{a.have}: say body.damping",
    ("default of others", "no cells"): "{a.have}: only {a.able_and} can simulate it",
    ("near", "no cells"): "{a.have}, and is not cut into regions: leave `near` out",
    ("goal", "no cells"): "{a.have}, and has no goal: leave it out",
    ("probes", "no cells"): "{a.have}, and has no stress to probe",
    ("quantity of others", "no cells"): "{a.have}, and has no {said}",
    ("held force", "no body in cells"): "{a.have}: close on it by time, or grip it",
    ("force_limit", "no body in cells"): "{a.have}: drives with a force_limit need cells",
    ("near", "tetrahedra"): f"{_OF_A_FILE} have one model, fem: leave out regions.near, or `cells: tetrahedra`",
    ("default of others", "tetrahedra"): (
        f"{_OF_A_FILE} are fem's: pbd moves a file's tetrahedra as particles (body: {{{{kind: tet_mesh}}}}), or leave "
        "out `cells: tetrahedra`, which lets the solid lie in cells of both models"
    ),
    ("element of hexahedra", "tetrahedra"): (
        f"{{a.fem.element}} is made of hexahedra, and {_OF_A_FILE} of none: use tet10, tet4_fbar or tet4"
    ),
    ("default of others", "cells"): "{a.models[0]} does not take these cells: use {a.able_or}",
    ("near of others", "near"): "{a.models[1]} does not take these cells: use {a.able_or}",
    ("integrator out of place", "cells"): "{a.integrator_problem}",
    ("integrator without viscosity", "viscosity"): (
        "{a.fem.integrator} does not know body.material.retardation_time: use implicit_euler or midpoint"
    ),
    ("leapfrog", "viscosity"): "leapfrog's substep would shrink with body.material.retardation_time: use xpbd",
    ("damping by stiffness", "viscosity"): f"body.material.retardation_time {_TWICE}",
    ("integrator without viscosity", "drag"): (
        "{a.fem.integrator} does not know body.damping: use implicit_euler or midpoint"
    ),
    ("damping by mass", "drag"): f"body.damping {_TWICE}",
    ("own hexahedra", "near"): f"hexahedra of a file {_ONE_MODEL} `cells: own`",
    ("cells round a sphere", "near"): f"cells that follow a sphere {_ONE_MODEL} `borders`",
    ("near.error", "uneven cells of a rough model"): (
        f"{_ROUGH} regions.near.error, or body.shape.grading, towards and borders"
    ),
    ("model_error", "uneven cells of a rough model"): f"{_ROUGH} this quantity, or cells of other shapes",
    ("goal", "uneven cells"): _EVEN,
    ("goal", "tetrahedra"): _EVEN,
    ("goal grip_force", "no closing"): "no phase closes two tools: name a probe instead, or add a phase with `close`",
    ("goal of a probe", "no such probe"): "{a.regions.goal!r} is not among the goals: {goals}",
    ("goal", "coarse"): "errors of a goal are known of cells of eight blocks: leave out models.pbd.coarse, or goal",
    ("near.error", "coarse"): f"{_COARSE} regions.near.error, or models.pbd.coarse",
    ("model_error", "coarse"): f"{_COARSE} this quantity, or models.pbd.coarse",
    ("quantity of others", "cells"): "only sheets and ropes have {said}",
    ("quantity of strength", "no strength"): (
        "no material of this body says its strength: give body.material.strength, or a food that has one"
    ),
    ("leapfrog", "near"): f"{_EXPLICIT} a seam: use xpbd, or leave out regions.near",
    ("leapfrog", "tools"): f"{_EXPLICIT} tools: use xpbd",
    ("classic pbd", "cells"): (
        "classic pbd moves particles: a body in cells needs xpbd; for a block of particles write "
        "body: {{kind: tet_mesh, size, divisions, ...}}"
    ),
    ("grip", "bodies in cells alone"): "a body in cells is held by friction: close two tools on it",
    ("step_error", "near"): (
        "substeps by error cannot meet a seam, whose compliance is that of one step: leave out step_error and shorten "
        "`step`, or give all cells to fem without regions.near"
    ),
}
"""by two features what is wrong where the first is said, and the remedy; the first row that a scene has counts"""


def implied_model(body: AnyBody, models: ModelsSpec, symmetry: Sequence[str]) -> tuple[ModelKind, str] | None:
    """A model and why it is meant; None where the scene leaves open which.

    Whoever sets one model's keys alone means that model: with the other they would do nothing.
    """
    cells = body.in_cells
    if cells is None:
        return body.usual_model, body.no_cells.removesuffix(", not cells")
    if body.tetrahedral:
        able = taking("tetrahedra")
        return able[0], f"only {' and '.join(able)} takes tetrahedra of a file for cells"
    if symmetry:
        able = that(lambda facts: facts.one_side)
        return able[0], f"only {' and '.join(able)} solves for one side (symmetry)"
    changed = {name: keys for name, keys in models.changed(cells).items() if keys}
    if len(changed) != 1:
        return None
    ((name, keys),) = changed.items()
    others = " and of ".join(f"models.{other}" for other in ModelsSpec.model_fields if other != name)
    model, *_ = that(lambda facts: f"{name}.{keys[0]}" in facts.reads)
    return model, f"the scene sets models.{name}.{keys[0]}, and nothing of {others}"


def check_body(scene: Scene, name: str, kinds: Collection[str]) -> None:
    """Raise if a scene asks something of its body that cannot be: where its regions name no model, with any that it
    may get.

    scene  with that body alone (`Scene.of`)
    name   of the body where it is one of several; '' where it is given as `body`
    kinds  of all bodies of the scene: cells, particles, points
    """
    try:
        best, *others = candidates(scene)
        try:
            _check_body(best, kinds)
        except PydanticCustomError:
            if not any(fits(other, kinds) for other in others):
                raise
    except PydanticCustomError as error:
        if not name:
            raise
        context = dict(error.context or {})
        first, *rest = context.get("at") or ("",)
        if first == "body":
            context["at"] = ("bodies", name, *rest)
        elif first == "regions" and scene.body.regions is not None:
            context["at"] = ("bodies", name, first, *rest)
        context["message"] = f"{name}: {context['message']}"
        raise PydanticCustomError("scene", "{message}", context) from None


def candidates(scene: Scene) -> list[Scene]:
    """The scene with each model that its body may get, that of near cells first: one where regions or words name it."""
    if scene.regions.default is not None:
        return [scene]
    implied = implied_model(scene.body, scene.models, scene.symmetry)
    kinds = [NEAR_DEFAULT, FAR_DEFAULT] if implied is None else [implied[0]]
    return [scene.with_regions(scene.regions.model_copy(update={"default": kind})) for kind in kinds]


def fits(scene: Scene, kinds: Collection[str]) -> bool:
    """Whether a scene whose regions name a model asks nothing of its body that cannot be; kinds: as of `check_body`."""
    try:
        _check_body(scene, kinds)
    except PydanticCustomError:
        return False
    return True


def _check_body(scene: Scene, kinds: Collection[str]) -> None:
    asked = Asked(scene, kinds)
    if len({*scene.symmetry}) < len(scene.symmetry):
        raise wrong("an axis is named twice: name each once", "symmetry")
    for (feature, beside), text in REFUSED.items():
        at = FEATURES[feature](asked)
        if at is not None and FEATURES[beside](asked) is not None:
            said = scene.quantities[int(at[1])] if at[0] == "quantities" else ""
            goals = ", ".join(["grip_force", *scene.probes])
            raise wrong(text.format(a=asked, said=said, goals=goals), *at)
    if asked.cells is not None and isinstance(asked.shape, BlockShape):
        check_tools(scene, asked.shape.towards, "body", "shape", "towards")
        tool_borders(asked.shape.size, asked.cells.position, scene.tools, asked.shape.towards)


def check_tools(scene: Scene, names: tuple[str, ...], *at: str | int, by_name: bool = False) -> None:
    """Raise if one of the names, which stand at `at` in a list, or by_name as keys, is not a tool."""
    for i, name in enumerate(names):
        if name not in scene.tools:
            raise not_among(f"no tool is called {name!r}", list(scene.tools), *at, name if by_name else i)


def locking(scene: Scene) -> str:
    """That FEM's element locks with the material of a scene's body; '' where it does not, or FEM has no part."""
    near, body = scene.regions.near, scene.body
    if not body.has_cells or not some_read((scene.regions.default, near.model if near else None), "fem.element"):
        return ""
    return element_warning(
        scene.models.fem.element, max(material.poisson for material in body.cell_materials), body.tetrahedral
    )
