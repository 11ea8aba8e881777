"""Symmetry reduction: of a scene that says where it is symmetric, FEM solves for one side, a half, quarter or eighth.

Nodes in a plane of symmetry are on rollers: no displacement across it, no force along it. The same cells and the same
equations, fewer of them. Replies are of the whole: sums of forces and energies at once, the rest when asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import SAME, Body, Floats, Ints, Region
from softseam_services.body.region import build_region, node_of_point
from softseam_services.body.symmetry import SymmetryPlane, asymmetric, match, mirrored, symmetry_plane
from softseam_services.tools.kernels.symmetry import tool_astray
from softseam_services.tools.symmetry import images_of_tools
from softseam_services.tools.tool_set import ToolSet

from .face_forces import point_positions
from .inputs import Tools
from .kernels.contact_columns import FORCE
from .kernels.symmetry import add_images, unfold_contact, unfold_nodes
from .state import FemState
from .structures import FemStructures, Tables, build_tables

_NO_NODES = np.zeros(0, dtype=np.int32)


@dataclass(frozen=True)
class Reduction:
    """k planes of a body of n nodes, c cells and p points with t tools; the part that is solved for has n', c', p'."""

    planes: tuple[SymmetryPlane, ...]
    axis: Ints
    place: Floats
    """of each plane (k,), (k,) [m]"""
    image: Ints
    """each tool's in each plane (k, t)"""
    names: tuple[str, ...]
    """of the tools"""
    sameness: Floats
    """of the tools (t, 6)"""
    region: Region
    """the part"""
    tables: Tables
    """of it"""
    keeps_places: bool
    """the integrator's history is of a place and a velocity, not of accelerations"""
    node: Ints
    """of the part, which each node of the whole is an image of (n,)"""
    cell: Ints
    """(c,)"""
    sign: Floats
    shift: Floats
    """x = sign x' + shift of each node (n, 3)"""
    on: NDArray[np.bool_]
    """points of the part in a plane (k, p')"""
    edge: float
    """shortest, of a cell [m]"""

    @property
    def times(self) -> int:
        """The whole is so many times the part."""
        return 1 << len(self.planes)

    def check(self, tools: Tools) -> None:
        """Raise SettingError where tools are no images of each other over a step."""
        plane, tool = tool_astray(
            tools.kind, tools.shape, self.sameness, self.axis, self.place, self.image, SAME * self.edge,
            tools.position, tools.orientation, tools.position_next, tools.orientation_next,
        )  # fmt: skip
        if tool >= 0:
            own, other = self.names[tool], self.names[self.image[plane, tool]]
            how = "leaves the plane" if own == other else f"is no image of {other!r}"
            raise asymmetric(int(self.axis[plane]), f"tool {own!r} {how} in this step: move its image alike")

    def add_up(self, state: FemState, tools: Tools, out: Floats, wrench: Floats) -> None:
        """Make what a step that led to `state` of the part came to what the whole came to: out, as of `kernels.step`,
        and wrench (t, 6), in place."""
        add_images(self.axis, self.place, self.image, self.on, state.contact, tools.position_next, out, wrench)

    def extend(self, state: FemState, points: PointImages) -> FemState:
        """The whole's state of that of the part."""
        x, v = np.empty_like(self.sign), np.empty_like(self.sign)
        history = np.empty((len(state.history), *self.sign.shape))
        unfold_nodes(self.node, self.sign, self.shift, state.x, state.v, state.history, x, v, history)
        if self.keeps_places and state.past > 0.0:
            history[0] += self.shift
        contact = np.zeros((*points.shape, state.contact.shape[2]))
        unfold_contact(self.axis, self.place, self.image, self.on, points.of_image, state.contact, contact)
        share = state.share[self.cell] if len(state.share) else state.share.copy()
        more = {"share": share, "passed": self.times * state.passed}
        return FemState(x, v, contact, history, state.past, state.level, **more)

    def restrict(self, state: FemState, points: PointImages) -> FemState:
        """The part's of a state of the whole: the mean of a node's images, which keeps momentum where another solver
        led to the state and is symmetric up to its own errors; contact as on the side that is kept."""
        model, parameters = self.tables
        history, of_place = state.history.copy(), self.keeps_places and state.past > 0.0
        if of_place:
            history[0] -= self.shift
        x, v, *before = (self._mean(values) for values in (state.x - self.shift, state.v, *history))
        node, axis = model.rollers.T  # these stay where they are, in what was before, too: else they would drift
        for values in (v, *before):
            values[node, axis] = 0.0
        for values in (x, *before[:of_place]):
            values[node, axis] = parameters.x_rest[node, axis]
        contact = np.ascontiguousarray(state.contact[points.of_image[0]])
        contact[..., FORCE : FORCE + 3] /= 2.0 ** self.on.sum(axis=0)[:, None, None]
        share = np.zeros(len(self.region.cells) if len(state.share) else 0)
        share[self.cell[: len(state.share)]] = state.share
        more = {"share": share, "passed": state.passed / self.times}
        before_now = np.array(before).reshape(len(before), *x.shape)
        return FemState(x, v, contact, before_now, state.past, state.level, **more)

    def _mean(self, values: Floats) -> Floats:
        """Of the images of each node of the part (n', 3), of vectors of the whole (n, 3)."""
        total = np.zeros((len(self.region.nodes), 3))
        np.add.at(total, self.node, self.sign * values)
        return total / np.bincount(self.node)[:, None]


class PointImages:
    """Which of the whole's points are images of each of the part's."""

    def __init__(self, reduction: Reduction, whole: Tables, n_tools: int) -> None:
        """Raises ValueError where an image is no point of the whole."""
        at, images = _points_at_rest(whole), []
        for combination in range(reduction.times):
            places = _points_at_rest(reduction.tables)
            for m, plane in enumerate(reduction.planes):
                if combination >> m & 1:
                    places = mirrored(places, plane.axis, plane.place)
            images.append(match(at, places, SAME * reduction.edge))
        self.of_image = np.array(images)
        """(2^k, p')"""
        self.shape = (len(at), n_tools)
        if (self.of_image < 0).any() or len(np.unique(self.of_image)) != len(at):
            raise ValueError("a body's points are no images of each other")


def reduce(
    body: Body, tools: ToolSet, spec: FemSpec, axes: tuple[int, ...], structures: FemStructures | None = None
) -> Reduction:
    """What FEM solves for of a body that is symmetric across these axes; structures: those that are known.

    Raises SettingError where the body is not symmetric, or its tools are not.
    """
    planes = tuple(symmetry_plane(body, axis) for axis in axes)
    images = [images_of_tools(plane, tools, SAME * body.resolution) for plane in planes]
    x, near = body.x_rest, SAME * body.resolution
    node, cell = np.arange(body.n_nodes), np.arange(body.n_cells)
    sign, shift = np.ones((body.n_nodes, 3)), np.zeros((body.n_nodes, 3))
    for plane in planes:
        e, at = plane.axis, plane.place
        beyond, side = x[:, e] < at - near, x[body.cell_nodes[:, 13], e] < at
        node, cell = np.where(beyond[node], plane.nodes[node], node), np.where(side[cell], plane.cells[cell], cell)
        sign[beyond, e], shift[beyond, e] = -1.0, 2.0 * at
    halved = _with_points_of(body, planes, near)
    part = build_region(halved, np.unique(cell), _NO_NODES)
    axis = np.array([plane.axis for plane in planes], dtype=np.int32)
    place = np.array([plane.place for plane in planes])
    across = [np.flatnonzero(np.abs(x[part.nodes, e] - c) <= near) for e, c in zip(axis, place, strict=True)]
    rollers = [np.stack([nodes, np.full_like(nodes, e)], axis=1) for e, nodes in zip(axis, across, strict=True)]
    tables = build_tables(halved, part, tools, spec, np.concatenate(rollers).astype(np.int32), structures)
    points = _points_at_rest(tables)
    return Reduction(
        planes=planes,
        keeps_places=spec.integrator == "bdf2",
        axis=axis,
        place=place,
        image=np.array(images, dtype=np.int32),
        names=tools.names,
        sameness=tools.sameness,
        region=part,
        tables=tables,
        node=np.searchsorted(part.nodes, node).astype(np.int32),
        cell=np.searchsorted(part.cells, cell).astype(np.int32),
        sign=sign,
        shift=shift,
        on=np.array([np.abs(points[:, e] - c) <= near for e, c in zip(axis, place, strict=True)]),
        edge=body.resolution,
    )


def _points_at_rest(tables: Tables) -> Floats:
    """Places of the points (p, 3) [m]."""
    return point_positions(tables.model, tables.parameters, tables.parameters.x_rest)


def _with_points_of(body: Body, planes: tuple[SymmetryPlane, ...], near: float) -> Body:
    """The body, whose points in a plane are carried by cells of the part and stand for the area there."""
    surface = body.surface
    cell, local, area = surface.cell.copy(), surface.local.copy(), surface.area.copy()
    x = body.x_rest[node_of_point(body)]
    for plane in planes:
        on = np.abs(x[:, plane.axis] - plane.place) <= near
        area[on] *= 0.5
        # a point in the plane is its own image, which the image of its cell has at the image of its node
        across = np.flatnonzero(on & (body.x_rest[body.cell_nodes[cell, 13], plane.axis] < plane.place))
        node = plane.nodes[body.cell_nodes[cell[across], _local(local[across])]]
        cell[across] = plane.cells[cell[across]]
        place = np.argmax(body.cell_nodes[cell[across]] == node[:, None], axis=1)
        local[across] = np.stack([place % 3, place // 3 % 3, place // 9], axis=1) - 1.0
    return replace(body, surface=replace(surface, cell=cell, local=local, area=area))


def _local(place: Floats) -> Ints:
    """Local id of the node at a place in its cell (m, 3)."""
    return (np.rint(place).astype(np.int32) + 1) @ np.array([1, 3, 9], dtype=np.int32)
