"""Which model has which cells of a body whose regions name none, and why.

What the scene's own words mean comes first (`implied_model`), and what one model alone can do. Else it is FEM on all
cells while that is expected to cost no more than `WORTH` times what XPBD does (`cost`), and to fit into memory. A
larger body has FEM within `REACH` cells of the tools that move and XPBD elsewhere; XPBD alone where none moves, or
where it cannot be cut. Nothing is timed: every process and every replay decides alike (docs/decisions/06).
"""

from __future__ import annotations

import numpy as np

from softseam_protocol.messages.names import ONLY_BODY
from softseam_protocol.models import FAR_DEFAULT, NEAR_DEFAULT, ModelKind
from softseam_protocol.scene.bodies import AnyBody as AnyBodySpec
from softseam_protocol.scene.consistency import fits, implied_model
from softseam_protocol.scene.regions import NearSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import AnyBody
from softseam_services.orchestrator.cost import step_cost
from softseam_services.orchestrator.crowd import Role
from softseam_services.orchestrator.cuts import cut
from softseam_services.solvers import SOLVERS
from softseam_services.tools.tool_set import ToolSet

WORTH = 20.0
"""FEM on all cells is worth so many times what XPBD costs [1]"""
LARGEST = 100_000
"""unknowns of the largest body that FEM has without being asked to: its factor takes 1.5 GB [1]"""
PASSED = 0.85
"""cells that waves pass in a millisecond, up to which a body that tools take among others is XPBD's [1]"""
REACH = 0.5
"""cells of larger bodies that are closer than this to a tool that moves are FEM's [cell edges]"""
_NONE = "the scene names no model"
_ANY = ("cells", "particles")
"""kinds that the scene's other bodies may be of: what goes with them was checked as it was read"""


def with_model(
    scene: Scene, spec: AnyBodySpec, body: AnyBody, tools: ToolSet, joined: bool = False, role: Role | None = None
) -> tuple[Scene, str]:
    """The scene of one body with regions that name a model, and why; '' where nothing was to be decided.

    joined  interfaces may join it to other bodies, so that it has to be whole
    role    in a crowd, if it is in one
    """
    if scene.regions.default is not None:
        return scene, ""
    if not body.has_cells:
        return _given(scene, spec.usual_model), ""
    implied = implied_model(spec, scene.models, scene.symmetry)
    if implied is not None:
        kind, why = implied
        return _given(scene, kind), why
    if body.relaxes and not body.material.splits:
        key = "relaxation" if any(material.relaxation for material in body.materials) else "plasticity"
        why = f"{_NONE}, and {FAR_DEFAULT} does not know body.material.{key} beside {body.material.kind}"
        return _given(scene, NEAR_DEFAULT), why
    if body.material.n_state and not body.relaxes:
        why = f"{FAR_DEFAULT} solves blocks of {body.material.kind}, which has state, one by one"
        return _given(scene, NEAR_DEFAULT), why
    one, other = NEAR_DEFAULT, FAR_DEFAULT
    fem, pbd = _given(scene, one), _given(scene, other)
    if not fits(fem, _ANY):
        return pbd, f"{_NONE}, and {one} cannot do what it sets"
    if role is not None and fits(pbd, _ANY):
        return _in_crowd(fem, pbd, body, role)
    share, unknowns = _cost_of_fem(scene, body, tools), 3 * int(np.count_nonzero(~body.fixed))
    if (share <= WORTH and unknowns <= LARGEST) or not fits(pbd, _ANY):
        said = f"{_NONE}, and {one} costs some {share:.2g} times what {other} does"
        return fem, f"{said}: up to {WORTH:g} it is worth that"
    why = f"{_NONE}, and {one} on all would cost {share:.2g} times what {other} does, for {unknowns:,} unknowns"
    within = float(f"{REACH * body.edges.max():.3g}")
    near = _given(scene, other, NearSpec(within=within))
    if tools.followed.any() and not joined and fits(near, _ANY):
        return near, f"{why}: it gets those within {1e3 * within:g} mm of tools that move"
    return pbd, f"{why} (regions.default: {one} for that)"


def _in_crowd(fem: Scene, pbd: Scene, body: Body, role: Role) -> tuple[Scene, str]:
    """Of a body among many that touch, which XPBD solves together, at substeps of the stiffest; these go by how many
    cells waves pass, whatever the step, and FEM's work hardly by either."""
    if not role.taken:
        return pbd, f"{_NONE}, and {role.by}: others are {FAR_DEFAULT}, in few cells"
    passed = 1e-3 * body.wave_speed / float(body.edges.min())
    said = f"{_NONE}, {role.by}, and waves pass {passed:.2g} of its cells in a millisecond"
    if passed > PASSED:
        return (
            fem,
            f"{said}: beyond {PASSED:g} {NEAR_DEFAULT} is cheaper than {FAR_DEFAULT}'s substeps of all that touch",
        )
    return pbd, f"{said}: up to {PASSED:g} {FAR_DEFAULT} is cheaper"


def _given(scene: Scene, kind: ModelKind, near: NearSpec | None = None) -> Scene:
    """With this model for all cells that are not near."""
    return scene.with_regions(scene.regions.model_copy(update={"default": kind, "near": near}))


def _cost_of_fem(scene: Scene, body: Body, tools: ToolSet) -> float:
    """What a step of FEM on all cells, in a grip, costs of one of PBD [1]."""
    coarse = SOLVERS[FAR_DEFAULT].coarse_cells(body, scene.models, tools)
    fem, pbd = (
        step_cost(body, parts, scene.models, scene.step, len(tools.names) > 0, coarse)
        for parts in (
            cut(ONLY_BODY, body, np.full(body.n_cells, near), NEAR_DEFAULT, FAR_DEFAULT) for near in (True, False)
        )
    )
    return fem / pbd
