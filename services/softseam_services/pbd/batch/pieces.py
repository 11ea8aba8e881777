"""What many pieces of one structure are made of, and how each one's numbers get into its lane."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.friction_field import FrictionFieldSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.errors import SettingError
from softseam_services.body.friction_field import draw_fields
from softseam_services.body.materials.point import NEO_HOOKEAN
from softseam_services.body.region import build_region
from softseam_services.pbd.hourglass import box_constants
from softseam_services.pbd.model import build_model
from softseam_services.pbd.parameters import build_parameters
from softseam_services.shapes.branches import BOX, PLANE
from softseam_services.tools.build import build_tools
from softseam_services.tools.tool_set import ToolSet

from . import layout as rows
from .layout import Layout, lay_out

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Pieces:
    """k pieces; each a block."""

    size: Floats
    """edges (k, 3) [m]"""
    young: Floats
    """(k,) [Pa]"""
    poisson: Floats
    density: Floats
    """(k,) [kg/m^3]"""
    friction: Floats
    """with each tool (k, t)"""
    friction_field: Sequence[FrictionFieldSpec | None]
    """how that varies over each piece (k,); None where it does not"""
    position: Floats
    """of the tools (k, t, 3) [m]"""
    orientation: Floats
    """of the tools (k, t, 4)"""


class Timing(NamedTuple):
    """Of a step, and the other numbers that all pieces share."""

    kappa: np.float32
    keep: np.float32
    """part of the velocity that mass-proportional damping leaves in a substep"""
    h: np.float32
    """substep [s]"""
    substeps: int
    step: np.float32
    """[s]"""
    share: np.float32
    """of a substep in the step"""
    margin: np.float32
    """gap within which a point may touch in a step [m]"""


class Structure:
    """A scene's block between boxes and planes that do not turn, as many pieces share it.

    Raises SettingError where the scene is another one.
    """

    def __init__(self, scene: Scene) -> None:
        body, tools = build_body(scene, {}), build_tools(scene)
        _check(scene, body, tools)
        cells = np.arange(body.n_cells, dtype=np.int32)
        region = build_region(body, cells, np.zeros(0, dtype=np.int32))
        if body.material.n_state:
            raise SettingError(
                f"body.material: many pieces do not know the state of {body.material.kind}: use an elastic one"
            )
        model = build_model(body, region, tools, scene.models.pbd)
        parameters = build_parameters(model, body, region, tools, scene.models.pbd)
        if parameters.arrays.stiffness_time > 0.0 or parameters.arrays.tolerance > 0.0 or model.seam.size:
            raise SettingError("many pieces are neither viscous nor solved to a residual: leave out both")
        self.body, self.tools, self.model, self.parameters = body, tools, model, parameters
        order = model.blocks.order.ravel()
        corners = model.blocks.corners[order[order >= 0]]
        used, nodes = np.unique(corners, return_inverse=True)
        self.nodes: Ints = np.ascontiguousarray(nodes.reshape(-1, 8), dtype=np.int32)
        """of each block, in the order in which they are solved (b, 8)"""
        colour = model.blocks.colour[order[order >= 0]]
        self.colours: Ints = np.searchsorted(colour, np.arange(int(colour.max()) + 2)).astype(np.int32)
        """where the blocks of each colour begin, and the end (c + 1,)"""
        touching = np.flatnonzero(model.touches.any(axis=1))
        begin, end = model.indptr[touching], model.indptr[touching + 1]
        if (end - begin != 1).any():
            raise SettingError("many pieces touch with nodes of their own only")
        self.points: Ints = np.searchsorted(used, model.node[begin]).astype(np.int32)
        """nodes that may touch (p,)"""
        self.x_rest: Floats = parameters.arrays.x_rest[used]
        """of the scene's own piece (n, 3) [m]"""
        self.mass: Floats = parameters.arrays.mass[used]
        """of the scene's own piece (n,) [kg]"""
        self.kind = np.asarray(tools.kind)
        self.shape: Singles = np.ascontiguousarray(tools.shape[:, :3], dtype=np.float32)
        self.gravity: Singles = np.asarray(body.gravity, dtype=np.float32)
        self.size: Floats = np.ptp(self.x_rest, axis=0)
        spec = scene.body
        self._position: Floats = np.array(spec.said("position", (0.0, 0.0, 0.0)))
        self._friction_field = spec.uneven_friction
        self.layout: Layout = lay_out(len(self.kind), len(used), len(self.nodes), len(self.points))

    @property
    def n_nodes(self) -> int:
        return len(self.x_rest)

    def own(self, count: int) -> Pieces:
        """The scene's own piece, so many times."""
        material, tools = self.body.materials[0], self.tools
        poisson = material.young / (2.0 * material.mu) - 1.0
        return Pieces(
            size=np.tile(self.size, (count, 1)),
            young=np.full(count, material.young),
            poisson=np.full(count, poisson),
            density=np.full(count, material.density),
            friction=np.tile(tools.friction, (count, 1)),
            friction_field=[self._friction_field] * count,
            position=np.tile(tools.position, (count, 1, 1)),
            orientation=np.tile(tools.orientation, (count, 1, 1)),
        )

    def numbers(self, pieces: Pieces) -> Singles:
        """All rows of pieces at rest, with their tools where they begin (k, rows)."""
        at, count = self.layout, len(pieces.young)
        found = np.zeros((count, at.rows))
        ratio = pieces.size / self.size
        edges = ratio * self.parameters.blocks.edges
        constants = box_constants(pieces.young, pieces.poisson, edges, self.parameters.spec.hourglass)
        found[:, rows.CONSTANTS : rows.VOLUME] = constants[:, : rows.VOLUME]
        found[:, rows.VOLUME] = edges.prod(axis=1)
        for tool in range(len(self.kind)):
            first = at.tools + rows.N_OF_TOOL * tool
            found[:, first : first + 3] = pieces.position[:, tool]
            found[:, first + rows.TURN : first + rows.N_OF_TOOL] = _turns(pieces.orientation[:, tool])
        heavier = pieces.density / self.body.materials[0].density * ratio.prod(axis=1)
        inverse = 1.0 / (heavier[:, None] * self.mass)
        middle = self.x_rest.mean(axis=0)
        middle[2] = self.x_rest[:, 2].min()
        node = found[:, at.nodes : at.blocks].reshape(count, self.n_nodes, rows.N_OF_NODE)
        place = middle + (self.x_rest - middle) * ratio[:, None]
        node[:, :, rows.X : rows.X + 3] = place
        node[:, :, rows.W] = inverse
        block = found[:, at.blocks : at.pairs].reshape(count, len(self.nodes), rows.N_OF_BLOCK)
        block[:, :, rows.WEIGHTS : rows.SOFTNESS] = inverse[:, self.nodes]
        factor = draw_fields(pieces.friction_field, self._position).factor(place[:, self.points])
        pair = found[:, at.pairs : at.out].reshape(count, len(self.points), len(self.kind), rows.N_OF_PAIR)
        pair[:, :, :, rows.FRICTION] = factor[:, :, None] * pieces.friction[:, None]
        return found.astype(np.float32)

    def timing(self, step: float, substeps: int) -> Timing:
        """Of steps of so many substeps [s]."""
        numbers, h = self.parameters.arrays, step / substeps
        keep = np.exp(-numbers.mass_rate * h)
        single = np.float32
        return Timing(
            *(single(numbers.kappa), single(keep), single(h), substeps, single(step), single(1.0 / substeps)),
            single(numbers.margin),
        )


def _turns(q: Floats) -> Floats:
    """Rotation matrices of unit quaternions (k, 4), row by row (k, 9)."""
    w, x, y, z = q.T
    return np.stack(
        [
            *(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            *(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            *(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        ],
        axis=1,
    )


def _check(scene: Scene, body: Body, tools: ToolSet) -> None:
    if not body.boxes or len(body.materials) != 1 or body.material.number != NEO_HOOKEAN or body.fixed.any():
        raise SettingError("many pieces are free blocks of one neo-Hookean material, on cells that are boxes")
    if not np.isin(tools.kind, (BOX, PLANE)).all():
        raise SettingError("many pieces touch boxes and planes only")
