"""What configurations of a scene are made from: the scene, the extent of its body, and cells that fit both."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from softseam.duration import expected_duration
from softseam.errors import SceneRefused
from softseam.scenes import located
from softseam.session import open_as_given
from softseam_protocol.inner_ball import Ball, inner_ball
from softseam_protocol.material_borders import (
    Piece,
    Planes,
    are_equal,
    cells_along,
    material_borders,
    pieces,
    wanted_for,
)
from softseam_protocol.scene.bodies import AnyBody, Block, BlockShape, block_of
from softseam_protocol.scene.motion import ClosePhase, MovePhase, TurnPhase
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Vector
from softseam_protocol.scene.tools import BoxTool, CylinderTool, PlaneTool, ToolSpec
from softseam_protocol.tool_borders import tool_borders

Floats = NDArray[np.float64]
Counts = tuple[int, int, int]
"""cells along x, y and z"""
Grading = float | Vector
"""how many times thinner cells are, along all axes or along x, y and z [1]"""

LONGER = 2.0
"""cells are this many times as long as they are wide along an axis that little changes along, and a reference's are as
many times as short across lines of contact [1]"""
DEEP = 0.1
"""share of a block's edge that tools' edges lie inside its faces at least, for cells of any size to end there [1]"""
TRIED = 8
"""numbers of cells along an axis, of which one folds [1]"""
UNKNOWN_LENGTH = 3.0
"""for estimates, where the length of the motion is not known before [s]"""


@dataclass(frozen=True)
class Frame:
    """What configurations of a scene are made from."""

    scene: Scene
    extent: Floats
    """of the body (3,) [m]"""
    follows: bool = True
    """whether cells may follow a ball in the block, which a seam does not let them"""

    @property
    def mirrors(self) -> tuple[int, ...]:
        """Axes that the scene says it is symmetric across: FEM solves one side where an even number of cells lies
        along them."""
        return tuple("xyz".index(axis) for axis in self.scene.symmetry)

    @property
    def length(self) -> float:
        """Expected length of the motion [s]."""
        return expected_duration(self.scene) or UNKNOWN_LENGTH

    def across(self, count: float) -> Counts:
        """Nearly cubic cells, `count` of them along the body's shortest edge, that end where its materials meet; longer
        ones along `even`."""
        edges = np.full(3, self.extent.min() / count)
        if self.even is not None:
            edges[self.even] *= LONGER
        return self._to_borders(self._counts(edges))

    def level(self, count: float) -> Counts:
        """Cells of a reference's level: those of `across`, and shorter ones along `narrow`."""
        counts = list(self.across(count))
        if self.narrow is not None:
            counts[self.narrow] = round(LONGER * counts[self.narrow])
        return counts[0], counts[1], counts[2]

    def _to_borders(self, counts: Counts) -> Counts:
        """About as many cells that end where materials meet."""
        lines = zip(self.extent.tolist(), counts, self.borders, strict=True)
        x, y, z = (cells_along(edge, edge / count, planes) for edge, count, planes in lines)
        return x, y, z

    @property
    def body(self) -> AnyBody:
        """The only one of the scene."""
        return self.scene.body

    @property
    def _block(self) -> Block | None:
        return block_of(self.body)

    @property
    def borders(self) -> tuple[Planes, Planes, Planes]:
        """Planes that cells end in, where materials meet or around a ball, along x, y and z [m]; none in what is no
        block."""
        if self._block is None:
            return (), (), ()
        if self.ball is not None:
            return self.ball.planes
        body, shape = self._block
        return material_borders(shape.size, body.position, body.inclusions)

    @property
    def ball(self) -> Ball | None:
        """The ball that cells of a block follow."""
        if self._block is None or not self.follows:
            return None
        body, shape = self._block
        return inner_ball(shape.size, body.position, body.inclusions)

    def refines(self, counts: Counts, first: Counts) -> bool:
        """Whether every cell of `first` is divided alike, in each piece between borders of materials."""
        if self.ball is not None:
            return counts == first
        if not any(self.borders):
            return True
        fine, coarse = ([piece for line in self._pieces(each) for piece in line] for each in (counts, first))
        if [ends for *ends, _ in fine] != [ends for *ends, _ in coarse]:
            return False
        along = {n / before for (*_, n), (*_, before) in zip(fine, coarse, strict=True)}
        return len(along) == 1 and along.pop().is_integer()

    def _pieces(self, counts: Counts) -> list[tuple[Piece, ...]]:
        """Along x, then y, then z: where each piece between borders begins and ends [m], and how many cells it has."""
        wanted = self._wanted_to_borders(counts) or (self.extent / np.array(counts)).tolist()
        lines = zip(self.extent.tolist(), wanted, self.borders, strict=True)
        return [pieces(*line) for line in lines]

    def n_cells(self, counts: Counts) -> int:
        """Of these counts along the block's edges, with those around a ball."""
        return self.ball.n_cells(self._pieces(counts)) if self.ball is not None else int(np.prod(counts))

    def n_solved(self, counts: Counts) -> float:
        """Of these cells those that FEM alone solves for."""
        return self.n_cells(counts) * 0.5 ** len(self.solved_across(counts))

    def solved_across(self, counts: Counts) -> tuple[int, ...]:
        """Axes that FEM solves one side of with these cells: none that the plane would cut some of."""
        return tuple(axis for axis in self.mirrors if counts[axis] % 2 == 0)

    def symmetry(self, axes: tuple[int, ...]) -> tuple[str, ...]:
        """The setting that keeps these axes of those that the scene is symmetric across; none where it says none."""
        return (f"symmetry={json.dumps(['xyz'[axis] for axis in axes])}",) if self.mirrors else ()

    def folding(self, counts: Counts, towards: tuple[str, ...] = ()) -> Counts:
        """These cells, more along axes that an odd number of them does not fold across: half of more are fewer.

        towards: boxes whose edges cells are to end at, which takes as many in each piece between them
        """
        if self.ball is not None:
            return counts
        if not towards:
            x, y, z = (count + (axis in self.mirrors and count % 2) for axis, count in enumerate(counts))
            return x, y, z
        lines = zip(self.extent.tolist(), counts, self._ends(towards), strict=True)
        x, y, z = (self._folding_along(axis, *line) for axis, line in enumerate(lines))
        return x, y, z

    def _folding_along(self, axis: int, edge: float, count: int, planes: Planes) -> int:
        """Cells along an axis that end in the planes: `count` of them, or the next more that fold."""
        found = (cells_along(edge, edge / n, planes) for n in range(count, count + TRIED))
        folds = (n for n in found if axis not in self.mirrors or n % 2 == 0)
        return next(folds, cells_along(edge, edge / count, planes))

    def _ends(self, towards: tuple[str, ...]) -> tuple[Planes, Planes, Planes]:
        """Planes along x, y and z that cells end in: where materials meet, and at these boxes' edges [m]."""
        both = zip(self.borders, self.edges_inside(towards), strict=True)
        x, y, z = (tuple(sorted({*borders, *edges})) for borders, edges in both)
        return x, y, z

    def across_ball(self, counts: Counts) -> int:
        """Cells along the longest edge of the box around a ball; 0 where there is none."""
        if self.ball is None:
            return 0
        ends = [self.ball.span(line, axis) for axis, line in enumerate(self._pieces(counts))]
        return max(last - first for first, last in ends)

    @property
    def even(self) -> int | None:
        """`idle`, where all tools are cylinders: what happens changes little along it."""
        long = all(isinstance(tool, CylinderTool) for tool in self.scene.tools.values())
        return self.idle if long else None

    @property
    def narrow(self) -> int | None:
        """The axis across the lines that cylinders touch the block in, where it is the same for all: these lines are
        narrow, and wander along it."""
        even = self.even
        if even is None or self._block is None:  # of no other body it is known
            return None
        middle = np.array(self._block.body.position) + np.array([0.0, 0.0, 0.5 * self.extent[2]])
        away = np.array([np.abs(np.array(_middle(tool)) - middle) for tool in self.scene.tools.values()])
        clear = away - 0.5 * self.extent
        clear[:, even] = -np.inf
        facing = set(clear.argmax(axis=1).tolist())
        return ({0, 1, 2} - {even, *facing}).pop() if len(facing) == 1 else None

    @property
    def idle(self) -> int | None:
        """The axis of a block of one material that every tool reaches along, from beyond one face to beyond the other,
        and that nothing clamps, pulls, moves or turns along: there free faces bulge, and no more."""
        tools = list(self.scene.tools.values())
        if self._block is None or not tools:
            return None
        body, shape = self._block
        if body.inclusions or body.fixed or any(body.spin):
            return None
        middle = np.array(body.position) + np.array([0.0, 0.0, 0.5 * shape.size[2]])
        for axis, edge in enumerate(shape.size):
            across = all(_reaches(tool, axis, middle[axis], edge) for tool in tools)
            if across and not (self.scene.gravity[axis] or body.velocity[axis] or _moves_along(self.scene, axis)):
                return axis
        return None

    @property
    def own(self) -> Counts | None:
        """The scene's own cells; None where it leaves them to the solver."""
        body = self.body
        if not body.wanted_edges:
            return None
        counts = self._counts(np.array(body.wanted_edges))
        to_borders = self._block is not None and self._block.shape.borders == "materials"
        return self._to_borders(counts) if to_borders else counts

    @property
    def own_to_borders(self) -> Counts | None:
        """The scene's own cells where as many can end where its materials meet, else about as many that do."""
        own = self.own
        if own is None or not (any(self.borders) or self.ball) or self._wanted_to_borders(own) is not None:
            return own
        return self._to_borders(own)

    def _counts(self, edge: Floats | float) -> Counts:
        along = np.maximum(1, np.floor(self.extent / edge + 0.5))
        return int(along[0]), int(along[1]), int(along[2])

    @property
    def edged(self) -> tuple[str, ...]:
        """Boxes whose edges will lie inside a face of the block, so that cells can end there."""
        if self._block is None:
            return ()
        body, shape = self._block
        boxes = [name for name, tool in self.scene.tools.items() if isinstance(tool, BoxTool)]
        return tuple(name for name in boxes if _ends_inside(self.scene, shape.size, body.position, name))

    @property
    def towards(self) -> tuple[str, ...] | None:
        """Boxes to whose edges a second family of levels is graded, none for one that is to the faces and to where
        materials meet; None where cells cannot be graded, or nothing touches the body."""
        if self._block is None or not self.scene.tools:
            return None
        if self.ball is not None or self.even is not None:
            return None
        if any(self.borders):
            return ()
        deep = all(
            DEEP * edge <= plane <= (1.0 - DEEP) * edge
            for planes, edge in zip(self.edges_inside(self.edged), self._block.shape.size, strict=True)
            for plane in planes
        )
        return tuple(sorted(self.edged)) if deep else ()

    def edges_inside(self, tools: tuple[str, ...]) -> tuple[Planes, Planes, Planes]:
        """Planes along x, y and z, inside the block, that the edges of these boxes lie in [m]; none in what is no
        block."""
        if self._block is None:
            return (), (), ()
        body, shape = self._block
        x, y, z = tool_borders(shape.size, body.position, self.scene.tools, tools)
        return x.planes, y.planes, z.planes

    def cells(self, counts: Counts, grading: Grading = 1.0, towards: tuple[str, ...] = ()) -> tuple[str, ...]:
        """The settings that ask for these cells."""
        own = None if self._block is None else self._block.shape
        edges, asked = (self.extent / np.array(counts)).tolist(), False
        wanted = self._wanted_to_borders(counts, towards)
        if wanted is not None and towards:
            edges, asked = wanted, any(self.borders)
        elif wanted is not None:
            uneven = self.ball is not None or not all(map(are_equal, self.extent.tolist(), wanted, self.borders))
            edges, asked = (wanted, True) if uneven or grading != 1.0 else (edges, False)
        found = [f"body.cell={json.dumps(edges)}"]
        if own is not None and asked != (own.borders == "materials"):
            found.append(f"body.shape.borders={'materials' if asked else 'even'}")
        if own is not None and grading != own.grading:
            text = json.dumps(grading) if isinstance(grading, tuple) else f"{grading:g}"
            found.append(f"body.shape.grading={text}")
        if own is not None and towards != own.towards:
            found.append(f"body.shape.towards={json.dumps(towards)}")
        return tuple(found)

    def _wanted_to_borders(self, counts: Counts, towards: tuple[str, ...] = ()) -> list[float] | None:
        """Wanted edges that lead to these cells where they end where materials meet, and at the edges of `towards` [m];
        None where nothing does."""
        planes = self._ends(towards) if towards else self.borders
        found = [wanted_for(*each) for each in zip(self.extent.tolist(), counts, planes, strict=True)]
        known = [edge for edge in found if edge is not None]
        return known if len(known) == 3 and (any(planes) or self.ball is not None) else None

    def size(self, counts: Counts) -> float:
        """Edge of a cube of a cell's mean volume [m]; along `even`, of a square of its cross-section."""
        if self.ball is not None:
            return float((np.prod(self.extent) / self.n_cells(counts)) ** (1.0 / 3.0))
        edges = self.extent / np.array(counts)
        if self.even is not None:
            edges = np.delete(edges, self.even)
        return float(np.prod(edges) ** (1.0 / len(edges)))


def _reaches(tool: ToolSpec, axis: int, middle: float, edge: float) -> bool:
    """Whether a tool is the same all along a block's edge on this axis: a plane, a long enough cylinder or box."""
    if isinstance(tool, PlaneTool):
        return tool.normal[axis] == 0.0
    if isinstance(tool, CylinderTool):
        along, length = abs(tool.axis[axis]) >= (1.0 - 1e-9) * float(np.linalg.norm(tool.axis)), tool.length
    elif isinstance(tool, BoxTool):
        along, length = not any(np.delete(tool.rotation, axis)), tool.size[axis]
    else:
        return False
    return along and abs(tool.position[axis] - middle) + 0.5 * edge <= 0.5 * length


def _moves_along(scene: Scene, axis: int) -> bool:
    """Whether a phase turns tools, or has some move along this axis."""
    for phase in scene.motion:
        if isinstance(phase, TurnPhase) or (
            isinstance(phase, MovePhase) and any(way[axis] for way in phase.ways.values())
        ):
            return True
        if isinstance(phase, ClosePhase):
            places = {_middle(scene.tools[name])[axis] for name in phase.tools}
            if len(places | ({phase.about[axis]} if phase.about else set())) > 1:
                return True
    return False


def _middle(tool: ToolSpec) -> Vector:
    return tool.point if isinstance(tool, PlaneTool) else tool.position


def _ends_inside(scene: Scene, size: Vector, position: Vector, tool: str) -> bool:
    """Whether an edge of this box comes to lie inside a face of the block."""
    try:
        return any(line.planes for line in tool_borders(size, position, scene.tools, (tool,)))
    except ValueError:  # it stands askew, or looks at no face
        return False


def is_viscous(body: AnyBody) -> bool:
    """Whether a body has a drag, or its material a retardation time, which not every integrator knows."""
    return body.has_cells and (body.cell_materials[0].retardation_time > 0.0 or body.said("damping", 0.0) > 0.0)


def frame_of(scene: Scene, name: str | Path | Scene, settings: Sequence[str]) -> Frame:
    """Measure the scene's body; a mesh is read for it.

    Raises SceneRefused, also for what FEM cannot simulate, and for a mesh that brings its own cells.
    """
    body = scene.body.in_cells
    if body is None:
        return Frame(scene, np.ones(3))  # particles have no cells
    shape = body.shape
    if isinstance(shape, BlockShape):
        return Frame(scene, np.array(shape.size))
    if shape.cells != "boxes":
        text = (
            "body.shape.cells: charts and plans try cells of many sizes, and this mesh brings its own: "
            "--set body.shape.cells=boxes lets its solid lie in cells of any size, or run the scene as it is"
        )
        raise SceneRefused(located(text, name, settings))
    with open_as_given(name, settings=settings) as session:
        surface = session.reset().surface
    # what is stored of a scene goes by its cells, which are not to go by how places were rounded
    return Frame(scene, np.array([float(f"{edge:.12g}") for edge in surface.max(axis=0) - surface.min(axis=0)]))
