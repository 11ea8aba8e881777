"""What a scene may not ask of a body: what its kind, its cells and its models cannot do."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Protocol

from pydantic_core import PydanticCustomError

from softseam_protocol.inner_ball import inner_ball
from softseam_protocol.models import FAR_DEFAULT, NEAR_DEFAULT, some_read, taking, that
from softseam_protocol.quantities import QUANTITIES
from softseam_protocol.scene.bodies import AnyBody, BlockShape, BodySpec, MeshShape
from softseam_protocol.scene.implied import implied_model
from softseam_protocol.scene.kinds import ELEMENTS, integrator_problem
from softseam_protocol.scene.models import CLASSIC_PBD, DampingSpec, ModelsSpec
from softseam_protocol.scene.motion import ClosePhase, GripPhase, Phase, ReleasePhase
from softseam_protocol.scene.regions import OwnRegions, RegionsSpec, SeamSpec
from softseam_protocol.scene.spec import Vector, key, not_among, wrong
from softseam_protocol.scene.tools import PlaneTool, ToolSpec
from softseam_protocol.tool_borders import tool_borders


class OneBody(Protocol):
    """What is read of a scene with one body (`Scene.of`)."""

    @property
    def body(self) -> AnyBody: ...
    @property
    def tools(self) -> Mapping[str, ToolSpec]: ...
    @property
    def motion(self) -> Sequence[Phase]: ...
    @property
    def regions(self) -> RegionsSpec: ...
    @property
    def models(self) -> ModelsSpec: ...
    @property
    def seam(self) -> SeamSpec: ...
    @property
    def symmetry(self) -> Sequence[str]: ...
    @property
    def quantities(self) -> tuple[str, ...]: ...
    @property
    def probes(self) -> Mapping[str, Vector]: ...
    def with_regions(self, regions: RegionsSpec) -> OneBody: ...


def check_body(scene: OneBody, name: str, kinds: Collection[str]) -> None:
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


def candidates(scene: OneBody) -> list[OneBody]:
    """The scene with each model that its body may get, that of near cells first: one where regions or words name it."""
    if scene.regions.default is not None:
        return [scene]
    implied = implied_model(scene.body, scene.models, scene.symmetry)
    kinds = [NEAR_DEFAULT, FAR_DEFAULT] if implied is None else [implied[0]]
    return [scene.with_regions(scene.regions.model_copy(update={"default": kind})) for kind in kinds]


def fits(scene: OneBody, kinds: Collection[str]) -> bool:
    """Whether a scene whose regions name a model asks nothing of its body that cannot be; kinds: as of `check_body`."""
    try:
        _check_body(scene, kinds)
    except PydanticCustomError:
        return False
    return True


def _check_body(scene: OneBody, kinds: Collection[str]) -> None:
    body = scene.body
    if body.in_cells is not None:
        _check_cells(scene, body.in_cells, {*kinds} != {"cells"})
    else:
        _check_particles(scene, body, "cells" in kinds)


def check_tools(scene: OneBody, names: tuple[str, ...], *at: str | int, by_name: bool = False) -> None:
    """Raise if one of the names, which stand at `at` in a list, or by_name as keys, is not a tool."""
    for i, name in enumerate(names):
        if name not in scene.tools:
            raise not_among(f"no tool is called {name!r}", list(scene.tools), *at, name if by_name else i)


def _symmetry_is_used(scene: OneBody) -> None:
    """Raise if `symmetry` names an axis twice, or asks what no solver of this scene can do."""
    if not scene.symmetry:
        return
    if len({*scene.symmetry}) < len(scene.symmetry):
        raise wrong("an axis is named twice: name each once", "symmetry")
    body, fem = scene.body, scene.models.fem
    if body.tetrahedral:
        raise wrong("tetrahedra of a file are not each other's images: leave it out", "symmetry")
    if body.uneven_friction is not None:
        text = "friction varies over both sides as neither's image: leave it out, or `symmetry`"
        raise wrong(text, "body", "friction_field")
    able = that(lambda facts: facts.one_side)
    if not {*scene.regions.models} & {*able}:
        only = " and ".join(able)
        raise wrong(f"only {only} solves for one side, and no region is {only}'s: leave it out", "symmetry")
    if fem.element.startswith("tet"):
        raise wrong(f"{fem.element} divides cells otherwise on either side: leave it out, or use hex27", "symmetry")
    if fem.integrator == "symplectic_euler":
        raise wrong("symplectic_euler solves no equations: leave it out", "symmetry")


def _check_particles(scene: OneBody, body: OwnRegions, beside_cells: bool) -> None:
    """Raise if the scene asks something of a body without cells that only one in cells can do."""
    _symmetry_is_used(scene)
    have = body.no_cells
    if body.held_by_friction:
        for i, phase in enumerate(scene.motion):
            if isinstance(phase, GripPhase | ReleasePhase):
                does = "grip" if isinstance(phase, GripPhase) else "release"
                raise wrong(f"a {body.kind} is held by friction: close two tools on it", "motion", i, does)
    if body.said("constraints", ()) and scene.models.pbd.method == CLASSIC_PBD:
        raise wrong("classic pbd has no compliance: constraints need xpbd", *key("models.pbd.method"))
    if scene.models.pbd.method == "leapfrog":
        raise wrong(f"{have}: leapfrog moves cells, use xpbd", *key("models.pbd.method"))
    if scene.models.pbd.residual is not None:
        raise wrong(f"{have}: only blocks have a residual, leave it out", *key("models.pbd.residual"))
    if scene.models.pbd.coarse is not None:
        raise wrong(f"{have}: leave it out", *key("models.pbd.coarse"))
    if scene.models.pbd.damping != DampingSpec():
        raise wrong(f"{have}: say body.damping", *key("models.pbd.damping"))
    able = taking("particles")
    if scene.regions.default not in able:
        raise wrong(f"{have}: only {' and '.join(able)} can simulate it", "regions", "default")
    if scene.regions.near is not None:
        raise wrong(f"{have}, and is not cut into regions: leave `near` out", "regions", "near")
    if scene.regions.goal is not None:
        raise wrong(f"{have}, and has no goal: leave it out", "regions", "goal")
    if scene.probes:
        raise wrong(f"{have}, and has no stress to probe", "probes")
    for i, quantity in enumerate(scene.quantities):
        if QUANTITIES[quantity].of not in ("any", body.made_of):
            raise wrong(f"{have}, and has no {quantity}", "quantities", i)
    for i, phase in enumerate(scene.motion):
        if isinstance(phase, ClosePhase) and phase.force is not None and not beside_cells:
            raise wrong(f"{have}: close on it by time, or grip it", "motion", i, "force")
    for name, tool in scene.tools.items():
        if not isinstance(tool, PlaneTool) and tool.force_limit is not None and not beside_cells:
            raise wrong(f"{have}: drives with a force_limit need cells", "tools", name, "force_limit")


def _check_cells(scene: OneBody, body: BodySpec, beside_others: bool) -> None:
    """Raise if integrator, models, seam, symmetry and tools do not go together."""
    _symmetry_is_used(scene)
    if body.tetrahedral:
        _check_tetrahedra(scene)
    near = scene.regions.near
    problem = integrator_problem(
        scene.models.fem.integrator, scene.seam.scheme if near else None, bool(scene.tools), bool(body.fixed)
    )
    models = {scene.regions.far, near.model if near else scene.regions.far}
    able = taking("tetrahedra" if body.tetrahedral else "cells")
    for model, *at in ((scene.regions.far, "default"), *([(near.model, "near", "model")] if near else [])):
        if model not in able:
            raise wrong(f"{model} does not take these cells: use {' or '.join(able)}", "regions", *at)
    if problem and some_read(models, "fem.integrator"):
        raise wrong(problem, *key("models.fem.integrator"))
    if body.material.retardation_time > 0.0:
        scene.models.check_viscous(models)
    if body.damping > 0.0:
        scene.models.check_drag(models)
    own = isinstance(body.shape, MeshShape) and body.shape.cells == "own"
    if own and near:
        raise wrong(
            "hexahedra of a file have one model, for a seam runs along faces that are rectangles: leave out "
            "regions.near, or `cells: own`", "body", "shape", "cells",
        )  # fmt: skip
    round_cells = (
        isinstance(body.shape, BlockShape)
        and body.shape.borders == "materials"
        and inner_ball(body.shape.size, body.position, body.inclusions) is not None
    )
    if round_cells and near:
        raise wrong(
            "cells that follow a sphere have one model, for a seam runs along faces that are rectangles: leave out "
            "regions.near, or `borders`", "body", "shape", "borders",
        )  # fmt: skip
    rough = [name for name in that(lambda facts: facts.errs_by == "model") if name in models]
    if (own or (isinstance(body.shape, BlockShape) and body.shape.graded)) and rough:
        said = f"the model error of {' and '.join(rough)} is measured on boxes of one size"
        if near and near.error is not None:
            raise wrong(
                f"{said}: leave out regions.near.error, or body.shape.grading, towards and borders",
                "regions",
                "near",
                "error",
            )
        if "model_error" in scene.quantities:
            place = ("quantities", scene.quantities.index("model_error"))
            raise wrong(f"{said}: leave out this quantity, or cells of other shapes", *place)
    _has_goal(scene, own or body.tetrahedral or (isinstance(body.shape, BlockShape) and body.shape.graded))
    if scene.models.pbd.coarse is not None and some_read(models, "pbd.coarse"):
        if scene.regions.goal is not None:
            said = "errors of a goal are known of cells of eight blocks"
            raise wrong(f"{said}: leave out models.pbd.coarse, or goal", "regions", "goal")
        said = "the model error of pbd is measured on cells of eight blocks"
        if near and near.error is not None:
            raise wrong(f"{said}: leave out regions.near.error, or models.pbd.coarse", "regions", "near", "error")
        if "model_error" in scene.quantities:
            place = ("quantities", scene.quantities.index("model_error"))
            raise wrong(f"{said}: leave out this quantity, or models.pbd.coarse", *place)
    if isinstance(body.shape, BlockShape):
        check_tools(scene, body.shape.towards, "body", "shape", "towards")
        tool_borders(body.shape.size, body.position, scene.tools, body.shape.towards)
    for i, name in enumerate(scene.quantities):
        if QUANTITIES[name].of == "particles":
            raise wrong(f"only sheets and ropes have {name}", "quantities", i)
    if scene.models.pbd.method == "leapfrog" and some_read(models, "pbd.method"):
        meets = "a seam" if near is not None else "tools" if scene.tools else ""
        cure = ", or leave out regions.near" if near is not None else ""
        if meets:
            raise wrong(
                f"leapfrog solves no equations and cannot meet {meets}: use xpbd{cure}", *key("models.pbd.method")
            )
    if scene.models.pbd.method == CLASSIC_PBD:
        raise wrong(
            "classic pbd moves particles: a body in cells needs xpbd; for a block of particles write "
            "body: {kind: tet_mesh, size, divisions, ...}",
            *key("models.pbd.method"),
        )
    for i, phase in enumerate(scene.motion):
        if isinstance(phase, GripPhase | ReleasePhase) and not beside_others:
            does = "grip" if isinstance(phase, GripPhase) else "release"
            raise wrong("a body in cells is held by friction: close two tools on it", "motion", i, does)
    if scene.models.fem.step_error is not None and near is not None and some_read(models, "fem.step_error"):
        raise wrong(
            "substeps by error cannot meet a seam, whose compliance is that of one step: leave out step_error and "
            "shorten `step`, or give all cells to fem without regions.near",
            *key("models.fem.step_error"),
        )


def _check_tetrahedra(scene: OneBody) -> None:
    """Raise if the scene asks of a file's tetrahedra what hexahedra or particles alone can do."""
    have, element = "cells that are a file's tetrahedra", scene.models.fem.element
    if scene.regions.near is not None:
        raise wrong(f"{have} have one model, fem: leave out regions.near, or `cells: tetrahedra`", "regions", "near")
    if scene.regions.default not in taking("tetrahedra"):
        raise wrong(
            f"{have} are fem's: pbd moves a file's tetrahedra as particles (body: {{kind: tet_mesh}}), or leave out "
            "`cells: tetrahedra`, which lets the solid lie in cells of both models", "regions", "default",
        )  # fmt: skip
    if not ELEMENTS[element].functions.startswith("tet"):
        use = "tet10, tet4_fbar or tet4"
        raise wrong(f"{element} is made of hexahedra, and {have} of none: use {use}", *key("models.fem.element"))


def _has_goal(scene: OneBody, uneven: bool) -> None:
    """Raise if the goal is nothing that this scene has, or one of cells that are no boxes of one size."""
    goal, at = scene.regions.goal, ("regions", "goal")
    if goal is None:
        return
    if uneven:
        raise wrong("errors of a goal are known of boxes of one size: leave out body.shape.grading, or goal", *at)
    if goal == "grip_force":
        if not any(isinstance(phase, ClosePhase) for phase in scene.motion):
            raise wrong("no phase closes two tools: name a probe instead, or add a phase with `close`", *at)
    elif goal not in scene.probes:
        have = ", ".join(["grip_force", *scene.probes])
        raise wrong(f"{goal!r} is not among the goals: {have}", *at)
