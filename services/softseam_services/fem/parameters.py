"""The numbers of a region's FEM: moduli, masses, lengths, and what follows from them, on a structure that stays.

They are built by array operations alone, with no order of elimination and no search for points, so that another
modulus, density, friction or size is another record of parameters beside the same structure.
"""

from typing import Any, NamedTuple

import numpy as np

from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.kinds import ElementKind
from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.contact_points import PENALTY
from softseam_services.body.errors import SettingError
from softseam_services.body.filled import FILL_FLOOR, filled_moments
from softseam_services.body.interpolate import Functions, point_weights
from softseam_services.jit import record
from softseam_services.tools.face_points import face_points, point_edges
from softseam_services.tools.kernels import DENSE
from softseam_services.tools.tool_set import ToolSet

from .elements import ELEMENTS
from .elements.cut import with_cut_cells
from .elements.hex27_box import NO_PATTERNS, cell_tables, own_patterns, patterns
from .elements.hexahedra import SHARES
from .elements.table import Table
from .elements.tetrahedra import OF_TETRAHEDRA
from .joints import JointNumbers, build_numbers
from .model import FemModel
from .octants import Octants, count_octants
from .rule import Rule, build_rule, cell_shapes

# In steps too short for that, r at nodes is this many times the inertia of the layer rho h/3 that a node stands for:
# multipliers lag, and gain energy where r dt^2 is less than the mass they move (kernels/contact.py).
FIRM = 20.0


@record
class FemParameters(NamedTuple):
    """Of n nodes, c cells, p surface points, f faces with points inside, t tools. For the kernels."""

    x_rest: Floats
    """(n, 3) [m]"""
    mass: Floats
    """(n,) [kg]"""
    acceleration: Floats
    """of gravity (3,) [m/s^2]"""
    rule: Rule
    """the element of a model that is general"""
    full: Rule
    """what cells pass to that are crushed"""
    viscous: Rule
    """the element as its viscosity sees it; `rule` where there is none"""
    shown: Rule
    """the element with gradients and weights of each octant alone, whose stress is reported where a model is general"""
    joints: JointNumbers
    """of the model's joints"""
    mean_gradient: Floats
    """over a cell, of each of its shapes in `full` (t, m, 3) [1/m]"""
    mu: Floats
    """of each octant, what lasts where the material relaxes (c, 8) [Pa]"""
    lambda_: Floats
    """(c, 8) [Pa]"""
    material: Ints
    """number of each octant's (c, 8)"""
    law: Floats
    """parameters of each material (m, MAX_PARAMETERS)"""
    edge: float
    """least edge of a cell [m]"""
    weight: Floats
    """f_q V/8, f_q as `Octants.fill`; of the octants' own volumes in cells of any shape (c, 8) [m^3]"""
    mean_mu: Floats
    """mean of the modulus that steadies over the body's own mu, which the stabilisation below has in it (c,)"""
    uneven: bool
    """that is not 1 in some cell"""
    gradient: Floats
    """(27, 24) [1/m]"""
    gradient_t: Floats
    """(24, 27)"""
    stabilisation: Floats
    """mu S (27, 27) [N/m]"""
    laplacian: Floats
    """L of each pattern of mu in octants, and of each cell with tables of its own (k, 27, 27) [N/m]"""
    cut_gradient: Floats
    """of cells with tables of their own, as `gradient` (u, 27, 24) [1/m]"""
    cut_force: Floats
    """its transpose above their stabilisation, fill and mu included: what F and x give a force with (u, 24 + 27, 27)"""
    point_weight: Floats
    point_tilt: Floats
    """of points inside faces, see `FacePoints.tilt`; 0 of others (entries, 2)"""
    point_stiffness: Floats
    """r, 0 at points that are for display only (p,) [N/m]"""
    swiftness: Floats
    """FIRM rho h/3 over PENALTY E/h, h the spacing of nodes: the square of the step below which r at nodes is more than
    what statics ask (p,) [s^2]"""
    face_edge: Floats
    """as `FacePoints.edge` (f,) [m]"""
    own_gradient: Floats
    """as cut_gradient, of each octant alone (u, 27, 24) [1/m]"""
    friction: Floats
    """Coulomb coefficient of each tool (t,) [1]"""
    friction_factor: Floats
    """of each point, on the coefficient of every tool (p,) [1]"""
    retardation_time: float
    """of the material [s]; 0 where it is not viscous, see kernels/viscosity.py"""
    drag: float
    """`body.damping`: force over mass and velocity [1/s]"""


def build_parameters(
    model: FemModel, body: Body, region: Region, tools: ToolSet | None = None, spec: FemSpec | None = None
) -> FemParameters:
    """Numbers of a region of a body on its structure; spec: which element, the default's where it is None.

    Raises ValueError where the structure is not that of this region.
    """
    spec = FemSpec() if spec is None else spec
    contact = _contact(model, body, region, FACTS[spec.element].functions)
    cells = _cells(model, body, region, spec)
    return FemParameters(
        **contact,
        **cells,
        x_rest=np.ascontiguousarray(body.x_rest[region.nodes]),
        mass=region.mass,
        acceleration=body.gravity,
        edge=float(body.edges.min()),
        friction=np.zeros(0) if tools is None else tools.friction,
        retardation_time=body.material.retardation_time,
        drag=body.damping,
    )


def _cells(model: FemModel, body: Body, region: Region, spec: FemSpec) -> dict[str, Any]:
    """What the cells' forces are made of."""
    element, material = spec.element, body.material
    mu, poisson, general = material.mu, material.elastic.poisson, model.general
    share, number = SHARES.get(element, 1.0), body.octant_material[region.cells]
    tables = cell_tables(body.edges, share, body.axes)
    fill = np.maximum(body.fill[region.cells], FILL_FLOOR)
    relative = np.array([each.steadying / mu for each in body.materials])[number]
    lasting = [each.lasting for each in body.materials]
    moduli = mu * np.array([each.mu / mu for each in lasting])[number], mu * relative
    moments = filled_moments(body, region.cells, fill)
    x, shape, boxes = cell_shapes(body, region)
    octants = count_octants(body, region.cells, model.root)
    special = NO_PATTERNS
    if not (boxes or general):
        own = ELEMENTS[element](x, poisson)
        weight, special = own.weight[:, 0] * fill, own_patterns(own, moduli, fill)
    else:
        weight = octants.fill * (tables.volume / 8.0)
        if not general:
            special = patterns(tables, body.edges, moduli, octants, (model.pattern, model.cut), share)

    def rule_of(kind: ElementKind, fill: Floats, octants: Octants | None = None) -> tuple[Rule, Table]:
        own = OF_TETRAHEDRA[kind](x) if body.tetrahedra else ELEMENTS[kind](x, poisson)
        table, of_cell = with_cut_cells(kind, own, shape, boxes, body, moments, relative, octants)
        shear = fill if octants is None else octants.shear
        return build_rule(table, fill, shear, of_cell, body, region.cells), table

    # the fast path needs no table of points but that of crushed cells
    known, has_joined = (octants if element in SHARES else None), octants.gradient is not octants.own
    full, table = rule_of("hex27_full", fill) if model.blends else rule_of(element, octants.fill, known)
    mean_gradient = (
        np.einsum("tbq,tbqim->tmi", table.weight, table.gradient) / table.weight.sum(axis=(1, 2))[:, None, None]
    )
    rule = rule_of(element, octants.fill, known)[0] if general and model.blends else full
    viscous = shown = rule
    if material.retardation_time > 0.0 and (has_joined or not general):
        viscous = rule_of(element, octants.shear, known)[0]
    if general and has_joined:
        shown = rule_of(element, fill, octants._replace(gradient=octants.own, shear=fill))[0]
    if material.n_state:
        check_internal_variables(body, spec)
    return {
        "rule": rule,
        "full": full,
        "viscous": viscous,
        "shown": shown,
        "joints": build_numbers(model.joints, body, region, model.root, octants, model.cell_nodes),
        "mean_gradient": np.ascontiguousarray(mean_gradient),
        "mu": np.array([each.mu for each in lasting])[number],
        "lambda_": np.array([each.lambda_ for each in lasting])[number],
        "material": number,
        "law": np.array([each.parameters for each in body.materials]),
        "weight": weight,
        "mean_mu": relative.mean(axis=1),
        "uneven": bool(np.any(relative != 1.0)),
        "gradient": tables.gradient,
        "gradient_t": tables.gradient_t,
        "stabilisation": mu * tables.stabilisation,
        "laplacian": special.laplacian,
        "cut_gradient": np.ascontiguousarray(np.swapaxes(special.gradient_t, 1, 2)),
        "cut_force": np.concatenate([special.gradient_t, special.stabilisation], axis=1),
        "own_gradient": np.ascontiguousarray(special.own_gradient),
    }


def _contact(model: FemModel, body: Body, region: Region, functions: Functions) -> dict[str, Any]:
    """Where the surface's points are in their cells, and how firmly they are pressed.

    functions: what the region's element interpolates with
    """
    _, node, weight = point_weights(body, region, functions)
    inner = face_points(body, region, model.faces, functions)
    if not np.array_equal(np.concatenate([node, inner.node]), model.point_node):
        raise ValueError("this region's points hang on other nodes than the structure says: build its own structure")
    spacing = 0.5 * np.concatenate([point_edges(body, region), inner.edge[inner.face]])
    octant = (np.concatenate([region.point_local, inner.local]) >= 0.0) @ np.array([1, 2, 4])
    material = body.octant_material[region.cells][model.point_cell, octant]
    young = np.array([each.young for each in body.materials])[material]
    density = np.array([each.density for each in body.materials])[material]
    counts = [len(region.points), len(inner.cell)]
    factor = np.repeat([PENALTY, DENSE], counts)
    area = np.concatenate([body.surface.area[region.points], inner.area])
    weight, x_rest = np.concatenate([weight, inner.weight]), body.x_rest[region.nodes]
    return {
        "point_weight": weight,
        "point_tilt": np.concatenate([np.zeros((len(weight) - len(inner.weight), 2)), inner.tilt]),
        "friction_factor": body.friction_field.at_points(x_rest, model.point_ptr, model.point_node, weight),
        "point_stiffness": factor * (young / spacing) * area,
        "swiftness": FIRM / factor * density * spacing**2 / (3.0 * young),
        "face_edge": inner.edge,
    }


INTEGRATORS = ("implicit_euler", "static")
"""take internal forces at the end of the step, where the state that follows belongs"""


STEADY_IN_BENDING = ("hex8", "hex8_reduced")
"""elements whose stiffness in bending is their stabilisation's"""


def check_internal_variables(body: Body, spec: FemSpec) -> None:
    """Raise SettingError, with its key and the remedy, for a body whose material has state."""
    kind = body.material.kind
    for does, has in (("relax", "relaxation"), ("yield", "yielding")):
        if spec.element in STEADY_IN_BENDING and any(getattr(material, has) for material in body.materials):
            raise SettingError(
                f"models.fem.element: {spec.element} bends by what steadies it, which does not {does}: use hex27"
            )
    if spec.integrator not in INTEGRATORS:
        use = " or ".join(INTEGRATORS)
        raise SettingError(f"models.fem.integrator: {spec.integrator} does not know the state of {kind}: use {use}")
