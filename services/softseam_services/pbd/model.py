"""The structure of a PBD region: what is joined to what, whatever the numbers are. Never changed, so it is shared."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.models import PbdSpec
from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.structures import Structures, key_of
from softseam_services.tools.tool_set import ToolSet

from .blocks import Blocks, CellLayout, build_blocks, cell_layout
from .levels import Levels, build_levels, coarse_cells
from .points import Gathering, find_points
from .records import ModelArrays


class Layout(NamedTuple):
    """All that a structure follows from: c cells, n nodes, p surface points."""

    cells: CellLayout
    coarse: NDArray[np.bool_]
    """cells that are one block (c,)"""
    seam: Ints
    """nodes of the region's seam (s,)"""
    indptr: Ints
    """which nodes each point sits between: those of p are node[indptr[p]] .. node[indptr[p + 1] - 1]"""
    node: Ints
    touches: NDArray[np.bool_]
    """(p, t)"""
    n_surface: int
    visits: Ints
    """as of `Points` (p,)"""

    @property
    def key(self) -> bytes:
        """What distinguishes it from others."""
        points = self.indptr, self.node, self.touches, self.n_surface, self.visits
        return key_of(*self.cells, self.coarse, self.seam, *points)


@dataclass(frozen=True)
class PbdModel:
    """n nodes, c cells, p surface points, t tools."""

    cell_nodes: Ints
    """(c, 27)"""
    levels: Levels
    blocks: Blocks
    seam: Ints
    """nodes that the region's seam follows (m,)"""
    seam_weight: Floats | None
    """what each of these gives to each node of the region's seam (s, m); None where they are the same"""
    indptr: Ints
    node: Ints
    """points follow nodes that move: sparse rows, whose weights are in `PbdParameters`"""
    touches: NDArray[np.bool_]
    """tools that points can touch (p, t)"""
    n_surface: int
    """points of the surface; those inside faces come after them"""
    visits: Ints
    """as of `Points` (p,)"""

    @property
    def n_nodes(self) -> int:
        return self.blocks.n_nodes

    @property
    def n_points(self) -> int:
        return len(self.touches)

    @property
    def n_tools(self) -> int:
        return int(self.touches.shape[1])

    @cached_property
    def gatherings(self) -> dict[bytes, Gathering]:
        """Those of regions of this structure, by the bytes of their points' weights."""
        return {}

    @cached_property
    def arrays(self) -> ModelArrays:
        """The same for kernels."""
        return ModelArrays(
            blocks=self.blocks.nodes,
            cell_nodes=self.cell_nodes,
            seam=self.seam,
            hanging=self.levels.hanging,
            indptr=self.indptr,
            node=self.node,
            touches=self.touches,
            visits=self.visits,
            n_surface=self.n_surface,
        )

    def seam_force(self, force: Floats) -> Floats:
        """Forces (s, 3) [N] on the region's seam as forces on the nodes that it follows (m, 3); (0, 3) stays."""
        return force if self.seam_weight is None or len(force) == 0 else self.seam_weight.T @ force


def lay_out(body: Body, region: Region, tools: ToolSet, spec: PbdSpec) -> Layout:
    """What the structure of a region follows from. Of numbers only what they leave out: empty octants, weights of 0,
    areas of 0; and where tools are at the start, if cells far from them are coarse or edges press into the surface."""
    coarse = coarse_cells(body, spec.coarse, tools)[region.cells]
    points = find_points(body, region, tools, coarse)
    return Layout(
        cells=cell_layout(body, region),
        coarse=coarse,
        seam=region.seam,
        indptr=points.rows[0],
        node=points.rows[1],
        touches=points.touches,
        n_surface=len(region.points),
        visits=points.visits,
    )


def model_of(layout: Layout) -> PbdModel:
    """The structure of a layout, and of nothing else."""
    cells = layout.cells
    levels = build_levels(cells.nodes, cells.n_nodes, layout.coarse)
    indptr, node, _ = levels.rows(layout.indptr, layout.node, np.ones(len(layout.node)))
    k, touches = layout.n_surface, layout.touches.copy()
    surface = indptr[: k + 1], node[: indptr[k]]
    touches[:k] &= levels.touching(np.logical_or.reduce(touches[:k], axis=1), surface, layout.seam)[:, None]
    seam, seam_weight = layout.seam, None
    if levels.ties is not None:
        of_seam = levels.ties[layout.seam]
        seam = np.unique(of_seam.indices).astype(np.int32)
        seam_weight = of_seam[:, seam].toarray()
    return PbdModel(
        cell_nodes=cells.nodes,
        levels=levels,
        blocks=build_blocks(cells, levels),
        seam=seam,
        seam_weight=seam_weight,
        indptr=indptr,
        node=node,
        touches=touches,
        n_surface=layout.n_surface,
        visits=layout.visits,
    )


STRUCTURES: Structures[Layout, PbdModel] = Structures(model_of)
"""those that are known"""


def build_model(body: Body, region: Region, tools: ToolSet, spec: PbdSpec) -> PbdModel:
    """The structure of a region of a body, from nothing."""
    return model_of(lay_out(body, region, tools, spec))
