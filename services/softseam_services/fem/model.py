"""The structure of a region's FEM: what is joined to what, and in which order its unknowns are eliminated.

Numbers, such as moduli, masses and lengths, are apart (`parameters`): bodies that differ in these alone share one
structure, and with it the symbolic factor.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Body, Ints, Region
from softseam_services.body.contact_points import is_embedded
from softseam_services.body.interpolate import point_weights
from softseam_services.body.slivers import root_octants
from softseam_services.jit import record
from softseam_services.structures import key_of
from softseam_services.tools.face_points import face_points, touched_faces
from softseam_services.tools.tool_set import ToolSet

from .dissection import dissect
from .elements.hex27_box import number_patterns
from .elements.hexahedra import SHARES
from .joints import Joints, build_joints, root_cells
from .kernels.contact_columns import ALONE, AT_NODE, SPREAD
from .octants import cut_cells
from .rule import cell_shapes
from .tree import Tree

NO_ROLLERS = np.zeros((0, 2), dtype=np.int32)


@record
class FemModel(NamedTuple):
    """n nodes, c cells, p surface points, s seam nodes. A plain tuple of arrays for the kernels."""

    cell_nodes: Ints
    """(c, 27)"""
    cell_order: Ints
    """elimination place of each cell's nodes, -1 for clamped nodes (c, 27)"""
    cell_grid: Ints
    """place of each cell on the body's grid (c, 3)"""
    order: Ints
    """elimination place of each node, -1 for clamped nodes (n,)"""
    tree: Tree
    """of the matrix's fronts, in that order"""
    general: bool
    """cells have the element of `FemParameters.rule`; else hex27, or its kin, and a material that splits"""
    blends: bool
    """cells may pass to the element of `FemParameters.full`, see kernels/quadrature_blending.py"""
    kind: int
    """of the materials, for body.materials.point"""
    n_state: int
    """numbers that the material remembers, see kernels/points.py; 0 of an elastic one"""
    respond: int
    """address of its response, where it remembers any; `kind` is 0 then"""
    linear: bool
    """small-strain material; a mean volume ratio is one of traces"""
    filled: NDArray[np.bool_]
    """(c, 8)"""
    whole: NDArray[np.bool_]
    """filled throughout (c,)"""
    pattern: Ints
    """pattern of each cell (c,)"""
    cut: Ints
    """number of each cell among those that the body fills in part, that are joined, or that are no boxes; -1 for other
    full boxes (c,)"""
    root: Ints
    """octant, 8 cell + octant, that each octant is joined to; its own, but for slivers of the body (c, 8)"""
    joined: NDArray[np.bool_]
    """cells of a joint (c,)"""
    joints: Joints
    """of root cells with sliver cells"""
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
    point_cell: Ints
    """(p,)"""
    point_face: Ints
    """face that a point inside it belongs to; these come last, p counts them too. AT_NODE, ALONE or SPREAD of
    kernels/contact.py at other points (p,)"""
    faces: Ints
    """cell, and number in it as of `FACE_NODES`, of each face with points inside (f, 2)"""
    at_faces: NDArray[np.bool_]
    """tools that touch at points inside faces (t,)"""


class Connectivity:
    """What a structure follows from but for the order of elimination: cheap to find, and it names the structure."""

    def __init__(
        self, body: Body, region: Region, tools: ToolSet | None, spec: FemSpec | None, rollers: Ints = NO_ROLLERS
    ) -> None:
        """spec: which element, the default's where it is None; rollers: as of the model."""
        element = (FemSpec() if spec is None else spec).element
        functions, material = FACTS[element].functions, body.material
        general = element not in SHARES or not material.splits
        at_faces, alone, faces = touched_faces(body, region, tools)
        inner = face_points(body, region, faces, functions)
        pointer, node, _ = point_weights(body, region, functions)
        pointer = np.concatenate([pointer, pointer[-1] + inner.indptr[1:]])
        node = np.concatenate([node, inner.node])
        point_cell = np.concatenate([region.point_cell, inner.cell]).astype(np.int32)
        of_point = np.repeat(np.arange(len(point_cell)), np.diff(pointer))
        local = np.argmax(region.cell_nodes[point_cell[of_point]] == node[:, None], axis=1)
        root = _roots(body, region, FemSpec() if spec is None else spec)
        joined = root_cells(root) != np.arange(len(root))
        joined[root_cells(root)[joined]] = True
        pattern, cut = _patterns(body, region, general, root)
        outside = SPREAD if is_embedded(body) else ALONE
        self.fixed = region.fixed
        # of a whole body others meet few of the nodes at which they may: all of them last would make its factor dense
        self._last = region.seam if len(region.cells) < body.n_cells else region.seam[:0]
        self.fields: dict[str, Any] = {
            "cell_nodes": region.cell_nodes,
            "cell_grid": body.cell_grid[region.cells],
            "general": general,
            "blends": element in SHARES and not material.small and not material.n_state,
            "kind": material.number,
            "n_state": material.n_state,
            "respond": material.respond,
            "linear": material.small,
            "filled": body.fill[region.cells] > 0.0,
            "whole": np.all(body.fill[region.cells] >= 1.0, axis=1) & ~joined,
            "pattern": pattern,
            "cut": cut,
            "root": root,
            "joined": joined,
            "seam": region.seam,
            "rollers": rollers,
            "point_ptr": pointer,
            "point_node": node,
            "point_local": local.astype(np.int32),
            "point_cell": point_cell,
            "point_face": np.concatenate([np.where(alone, outside, AT_NODE), inner.face]).astype(np.int32),
            "faces": faces,
            "at_faces": at_faces,
        }
        """of `FemModel`, but for the order of elimination"""

    @property
    def key(self) -> bytes:
        """Equal for equal structures only."""
        return key_of(*self.fields.values(), self.fixed, self._last)

    def ordered(self) -> FemModel:
        """The structure, its unknowns ordered by nested dissection."""
        fields = self.fields
        nodes, root = fields["cell_nodes"], fields["root"]
        tree = dissect(nodes, fields["cell_grid"], len(self.fixed), self.fixed, self._last, root_cells(root))
        position = tree.position
        return FemModel(
            **fields,
            order=position,
            tree=tree,
            joints=build_joints(nodes, root, fields["seam"], tree),
            cell_order=position[nodes],
            point_place=position[fields["point_node"]],
        )


def with_seam_last(model: FemModel) -> FemModel:
    """The same structure with the seam's nodes eliminated last."""
    fixed, nodes, root = model.order < 0, model.cell_nodes, root_cells(model.root)
    tree = dissect(nodes, model.cell_grid, len(fixed), fixed, model.seam, root)
    position = tree.position
    return model._replace(
        order=position,
        tree=tree,
        joints=build_joints(nodes, model.root, model.seam, tree),
        cell_order=position[nodes],
        point_place=position[model.point_node],
    )


def _roots(body: Body, region: Region, spec: FemSpec) -> Ints:
    """`FemModel.root`. Slivers stay alone where ties would shorten substeps, and where a material has state."""
    joins = spec.element in SHARES and spec.integrator != "symplectic_euler" and not body.material.n_state
    if joins and cell_shapes(body, region)[2]:
        return root_octants(body, region.cells)
    return np.arange(8 * len(region.cells), dtype=np.int32).reshape(-1, 8)


def _patterns(body: Body, region: Region, general: bool, root: Ints) -> tuple[Ints, Ints]:
    """`FemModel.pattern` and `FemModel.cut`; cells off the fast path have none."""
    if general:
        return np.zeros((2, 0), dtype=np.int32)[0], np.zeros(0, dtype=np.int32)
    if not cell_shapes(body, region)[2]:
        numbers = np.arange(len(region.cells), dtype=np.int32)
        return numbers, numbers
    return number_patterns(body.octant_material[region.cells], cut_cells(body, region.cells, root))
