"""What a region's FEM computes with: frozen arrays, built once from body, region and tools."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.kinds import ElementKind
from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.filled import FILL_FLOOR, filled_moments
from softseam_services.body.interpolate import point_weights
from softseam_services.fem.dissection import dissect
from softseam_services.fem.elements import ELEMENTS
from softseam_services.fem.elements.cut import with_cut_cells
from softseam_services.fem.elements.hex27 import SHARES
from softseam_services.fem.elements.hex27_box import cell_tables, own_patterns, patterns
from softseam_services.fem.face_points import SOFT, face_points, point_edges
from softseam_services.fem.kernels.cells import LANES
from softseam_services.fem.kernels.contact import ALONE
from softseam_services.fem.remembers import check_remembers
from softseam_services.fem.rule import Rule, build_rule, cell_shapes
from softseam_services.fem.tree import Tree
from softseam_services.jit import record
from softseam_services.tools.tool_set import ToolSet

# Contact penalty r = PENALTY E A / h at a surface point, h half an edge of the cells there: softer lets points sink in
# between steps, stiffer slows the stick-slip iteration.
PENALTY = 20.0
# In steps too short for that, r is this many times the inertia of the layer rho h/3 that a point stands for, at nodes
# and at points inside faces: multipliers lag, and gain energy where r dt^2 is less than the mass they move
# (kernels/contact.py). Nodes of hex27 faces share their mass otherwise than points do: of what points inside such faces
# move, some has r dt^2 = 0.055 of this times its mass, which 8 was too few for (docs/decisions/20).
FIRM, FIRM_INSIDE = 20.0, 24.0
_NO_ROLLERS = np.zeros((0, 2), dtype=np.int32)


@record
class FemModel(NamedTuple):
    """n nodes, c cells, p surface points, s seam nodes. A plain tuple of arrays for the kernels."""

    x_rest: Floats
    """(n, 3) [m]"""
    mass: Floats
    """(n,) [kg]"""
    acceleration: Floats
    """of gravity (3,) [m/s^2]"""
    cell_nodes: Ints
    """(c, 27)"""
    cell_order: Ints
    """elimination place of each cell's nodes, -1 for clamped nodes (c, 27)"""
    cell_grid: Ints
    """place of each cell on the body's grid (c, 3)"""
    order: Ints
    """elimination place of each node, -1 for clamped nodes (n,)"""
    general: bool
    """`rule` holds; else cells have hex27, or its kin, and a material that splits, and the tables below hold"""
    rule: Rule
    crushable: bool
    """cells may pass to the element of `full`, see kernels/crushed.py"""
    full: Rule
    resists: bool
    """the material is viscous, see kernels/viscosity.py"""
    viscous: Rule
    """the element as its viscosity sees it; `rule` where there is none"""
    mean_gradient: Floats
    """over a cell, of each of its shapes in `full` (t, m, 3) [1/m]"""
    kind: int
    """of the materials, for body.materials.point"""
    n_state: int
    """numbers that the material remembers, see kernels/remembered.py; 0 of an elastic one"""
    respond: int
    """address of its response, where it remembers any; `kind` is 0 then"""
    linear: bool
    """small-strain material; a mean volume ratio is one of traces"""
    mu: Floats
    """of each octant (c, 8) [Pa]"""
    lambda_: Floats
    """(c, 8) [Pa]"""
    edge: float
    """least edge of a cell [m]"""
    weight: Floats
    """f_q V/8, fill raised to FILL_FLOOR; of the octants' own volumes in cells of any shape (c, 8) [m^3]"""
    filled: NDArray[np.bool_]
    """(c, 8)"""
    whole: NDArray[np.bool_]
    """filled throughout (c,)"""
    mean_mu: Floats
    """mean of mu over the body's own mu, which the stabilisation below has in it (c,)"""
    uneven: bool
    """that is not 1 in some cell"""
    gradient: Floats
    """(27, 24) [1/m]"""
    gradient_t: Floats
    """(24, 27)"""
    lanes: Floats
    """the transpose, nodes padded to LANES with zeros (24, LANES)"""
    stabilisation: Floats
    """mu S (27, 27) [N/m]"""
    laplacian: Floats
    """L of each pattern of mu in octants, and of each cell with tables of its own (k, 27, 27) [N/m]"""
    pattern: Ints
    """pattern of each cell (c,)"""
    cut: Ints
    """number of each cell among those that the body fills in part, or that are no boxes; -1 for full boxes (c,)"""
    cut_gradient: Floats
    """of these, as `gradient` (u, 27, 24) [1/m]"""
    cut_force: Floats
    """its transpose above their stabilisation, fill and mu included: what F and x give a force with (u, 24 + 27, 27)"""
    seam: Ints
    """(s,)"""
    rollers: Ints
    """nodes that do not leave a plane, and the axis across it (h, 2)"""
    point_ptr: Ints
    """(p + 1,)"""
    point_node: Ints
    point_place: Ints
    """elimination place of point_node"""
    point_local: Ints
    """number of point_node in the point's cell"""
    point_weight: Floats
    point_cell: Ints
    """(p,)"""
    point_stiffness: Floats
    """r, 0 at points that are for display only (p,) [N/m]"""
    swiftness: Floats
    """FIRM rho h/3 over PENALTY E/h, h the spacing of nodes, inside faces FIRM_INSIDE over SOFT: the square of the step
    below which r is more than what statics ask (p,) [s^2]"""
    point_face: Ints
    """face that a point inside it belongs to; these come last, p counts them too. -1 at nodes of such faces, -2 at
    other points (p,)"""
    point_patch: Floats
    """as `FacePoints.patch`, 0 at other points (p, 2)"""
    face_nodes: Ints
    """as of `FacePoints` (f, 9)"""
    face_edge: Floats
    """as `FacePoints.edge` (f,) [m]"""
    edged: NDArray[np.bool_]
    """tools that touch at points inside faces (t,)"""


Tables = tuple[FemModel, Tree]
"""of a region; no step writes to them, so that solvers of one region may share them"""


def build_model(
    body: Body,
    region: Region,
    tools: ToolSet | None = None,
    spec: FemSpec | None = None,
    rollers: Ints = _NO_ROLLERS,
) -> Tables:
    """Tables, matrix and point weights of a region; spec: which element, the default's where it is None; rollers:
    as of the model."""
    element = (FemSpec() if spec is None else spec).element
    n_nodes = len(region.nodes)
    cell_grid = body.cell_grid[region.cells]
    tree = dissect(region.cell_nodes, cell_grid, n_nodes, region.fixed, region.seam)
    share = SHARES.get(element, 1.0)
    tables = cell_tables(body.edges, share)
    mu = body.material.mu
    fill = np.maximum(body.fill[region.cells], FILL_FLOOR)
    materials, number = body.materials, body.octant_material[region.cells]
    relative = np.array([material.mu / mu for material in materials])[number]
    moments = filled_moments(body, region.cells, fill)
    lanes = np.zeros((24, LANES))
    lanes[:, :27] = tables.gradient_t
    pointer, node, point_weight = point_weights(body, region, FACTS[element].functions)
    inner = face_points(body, region, tools, FACTS[element].functions)
    pointer = np.concatenate([pointer, pointer[-1] + inner.indptr[1:]])
    node, point_weight = np.concatenate([node, inner.node]), np.concatenate([point_weight, inner.weight])
    point_cell = np.concatenate([region.point_cell, inner.cell]).astype(np.int32)
    of_point = np.repeat(np.arange(len(point_cell)), np.diff(pointer))
    local = np.argmax(region.cell_nodes[point_cell[of_point]] == node[:, None], axis=1)
    spacing = 0.5 * np.concatenate([point_edges(body, region), inner.edge[inner.face]])
    octant = (np.concatenate([region.point_local, inner.local]) >= 0.0) @ np.array([1, 2, 4])
    of_points = number[point_cell, octant]
    young = np.array([material.young for material in materials])[of_points]
    density = np.array([material.density for material in materials])[of_points]
    factor = np.repeat([PENALTY, SOFT], [len(region.points), len(inner.cell)])
    firm = np.repeat([FIRM, FIRM_INSIDE], [len(region.points), len(inner.cell)])
    stiffness = factor * (young / spacing) * np.concatenate([body.surface.area[region.points], inner.area])
    x, shape, boxes = cell_shapes(body, region)
    general = element not in SHARES or not body.material.splits
    poisson = body.material.elastic.poisson
    crushable = element in SHARES and not body.material.small and not body.material.n_state
    if not (boxes or general):
        own = ELEMENTS[element](x, poisson)
        weight, special = own.weight[:, 0] * fill, own_patterns(own, mu * relative, fill)
    else:
        fast = slice(0 if general else None)  # cells of the fast path
        weight = fill * (tables.volume / 8.0)
        special = patterns(tables, body.edges, mu * relative[fast], moments[fast], share)
    # the fast path needs no table of points but that of crushed cells
    kind: ElementKind = "hex27_full" if crushable else element
    table, of_cell = with_cut_cells(kind, ELEMENTS[kind](x, poisson), shape, boxes, body.edges, moments, relative)
    full = build_rule(table, fill, of_cell, body, region.cells)
    mean_gradient = (
        np.einsum("tbq,tbqim->tmi", table.weight, table.gradient) / table.weight.sum(axis=(1, 2))[:, None, None]
    )
    rule = full
    if general and crushable:
        table, of_cell = with_cut_cells(
            element, ELEMENTS[element](x, poisson), shape, boxes, body.edges, moments, relative
        )
        rule = build_rule(table, fill, of_cell, body, region.cells)
    viscous, resists = rule, body.material.retardation_time > 0.0
    if resists and not general:
        table, of_cell = with_cut_cells(
            element, ELEMENTS[element](x, poisson), shape, boxes, body.edges, moments, relative
        )
        viscous = build_rule(table, fill, of_cell, body, region.cells)
    if body.material.n_state:
        check_remembers(body, region, FemSpec() if spec is None else spec, len(rule.group_nodes) > 0)
    model = FemModel(
        general=general,
        rule=rule,
        crushable=crushable,
        full=full,
        resists=resists,
        viscous=viscous,
        mean_gradient=np.ascontiguousarray(mean_gradient),
        kind=body.material.number,
        n_state=body.material.n_state,
        respond=body.material.respond,
        x_rest=np.ascontiguousarray(body.x_rest[region.nodes]),
        mass=region.mass,
        acceleration=body.gravity,
        cell_nodes=region.cell_nodes,
        cell_order=tree.position[region.cell_nodes],
        cell_grid=cell_grid,
        order=tree.position,
        linear=body.material.small,
        mu=np.array([material.mu for material in materials])[number],
        lambda_=np.array([material.lambda_ for material in materials])[number],
        edge=float(body.edges.min()),
        weight=weight,
        filled=body.fill[region.cells] > 0.0,
        whole=np.all(body.fill[region.cells] >= 1.0, axis=1),
        mean_mu=relative.mean(axis=1),
        uneven=bool(np.any(relative != 1.0)),
        gradient=tables.gradient,
        gradient_t=tables.gradient_t,
        lanes=lanes,
        stabilisation=mu * tables.stabilisation,
        laplacian=special.laplacian,
        pattern=special.pattern,
        cut=special.cut,
        cut_gradient=np.ascontiguousarray(np.swapaxes(special.gradient_t, 1, 2)),
        cut_force=np.concatenate([special.gradient_t, special.stabilisation], axis=1),
        seam=region.seam,
        rollers=rollers,
        point_ptr=pointer,
        point_node=node,
        point_place=tree.position[node],
        point_local=local.astype(np.int32),
        point_weight=point_weight,
        point_cell=point_cell,
        point_stiffness=stiffness,
        swiftness=firm / factor * density * spacing**2 / (3.0 * young),
        point_face=np.concatenate([np.where(inner.alone, ALONE, -1), inner.face]).astype(np.int32),
        point_patch=np.concatenate([np.zeros((len(region.points), 2)), inner.patch]),
        face_nodes=inner.face_nodes,
        face_edge=inner.edge,
        edged=inner.edged,
    )
    return model, tree
