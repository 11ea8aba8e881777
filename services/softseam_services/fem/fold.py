"""A body that mirrors itself is computed on one side of its mirrors: half of it, a quarter or an eighth.

What is on a mirror's plane does not leave it: no force across it, no way across it. As long as tools mirror each other,
too, the rest of the body does what this part does, and nothing is lost: the same cells, the same equations, fewer of
them. A tool that goes its own way ends that; the whole is then solved from where the part has brought it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.kinds import ELEMENTS as FACTS
from softseam_protocol.scene_models import FemSpec
from softseam_services.body.body import Body, Floats, Ints, Region
from softseam_services.body.mirrors import Mirror, find_mirrors, match, mirrored
from softseam_services.body.region import build_region, node_of_point
from softseam_services.fem.face_forces import point_positions
from softseam_services.fem.kernels.contact import FORCE, SLIP_SO_FAR
from softseam_services.fem.kernels.mirrored import add_images, tools_agree, unfold_contact, unfold_nodes
from softseam_services.fem.kernels.multigrid import NONE
from softseam_services.fem.model import MOST_FACTORED, FemModel, Tables, build_model
from softseam_services.fem.state import FemState
from softseam_services.fem.tool_motion import Tools
from softseam_services.tools.tool_set import ToolSet

_SAME = 1e-9
"""of an edge, of the largest velocity and force: what differs by less is the same"""
_NO_NODES = np.zeros(0, dtype=np.int32)


@dataclass(frozen=True)
class Fold:
    """k mirrors of a body of n nodes, c cells and p points with t tools; its part has n', c' and p'."""

    mirrors: tuple[Mirror, ...]
    axis: Ints
    plane: Floats
    """of each mirror (k,), (k,) [m]"""
    image: Ints
    """each tool's in each mirror (k, t)"""
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
    """points of the part on a mirror's plane (k, p')"""
    edge: float
    """shortest, of a cell [m]"""

    @property
    def times(self) -> int:
        """The whole is so many times the part."""
        return 1 << len(self.mirrors)

    def agrees(self, tools: Tools) -> bool:
        """Whether tools mirror each other in a step."""
        return bool(
            tools_agree(
                tools.kind, tools.shape, self.axis, self.plane, self.image, _SAME * self.edge,
                tools.position, tools.orientation, tools.position_next, tools.orientation_next,
            )
        )  # fmt: skip

    def add_up(self, state: FemState, tools: Tools, out: Floats, wrench: Floats) -> None:
        """Make what a step that led to `state` of the part came to what the whole came to: out, as of `kernels.step`,
        and wrench (t, 6), in place."""
        add_images(self.axis, self.plane, self.image, self.on, state.contact, tools.position_next, out, wrench)

    def unfold(self, state: FemState, points: PointImages) -> FemState:
        """The whole's state of that of the part."""
        x, v = np.empty_like(self.sign), np.empty_like(self.sign)
        history = np.empty((len(state.history), *self.sign.shape))
        unfold_nodes(self.node, self.sign, self.shift, state.x, state.v, state.history, x, v, history)
        if self.keeps_places and state.past > 0.0:
            history[0] += self.shift
        contact = np.zeros((*points.shape, state.contact.shape[2]))
        unfold_contact(self.axis, self.plane, self.image, self.on, points.of_image, state.contact, contact)
        return FemState(x, v, contact, history, state.past, state.level)

    def fold(self, state: FemState, points: PointImages) -> FemState | None:
        """The part's of a state of the whole, None where that does not mirror itself."""
        nodes, at = self.region.nodes, points.of_image[0]
        contact = np.ascontiguousarray(state.contact[at])
        contact[..., FORCE : FORCE + 3] /= 2.0 ** self.on.sum(axis=0)[:, None, None]
        part = FemState(
            np.ascontiguousarray(state.x[nodes]), np.ascontiguousarray(state.v[nodes]), contact,
            np.ascontiguousarray(state.history[:, nodes]), state.past, state.level,
        )  # fmt: skip
        again = self.unfold(part, points)
        force, forces = state.contact[..., FORCE : FORCE + 3], again.contact[..., FORCE : FORCE + 3]
        near, touches = _SAME * self.edge, force.any(axis=-1)
        same = (
            _close(again.x, state.x, near)
            and _close(again.v, state.v, _SAME * float(np.abs(state.v).max(initial=0.0)))
            and all(
                _close(one, other, _SAME * float(np.abs(other).max()))
                for one, other in zip(again.history, state.history, strict=True)
            )
            and _close(forces, force, _SAME * float(np.abs(force).max(initial=0.0)))
            and _close(again.contact[touches][..., SLIP_SO_FAR:], state.contact[touches][..., SLIP_SO_FAR:], near)
        )
        return part if same else None


def _close(a: Floats, b: Floats, most: float) -> bool:
    return bool(np.abs(a - b).max(initial=0.0) <= most)


class PointImages:
    """Which of the whole's points are images of each of the part's."""

    def __init__(self, fold: Fold, whole: FemModel, n_tools: int) -> None:
        """Raises ValueError where an image is no point of the whole."""
        part = fold.tables[0]
        at, images = point_positions(whole, whole.x_rest), []
        for combination in range(fold.times):
            places = point_positions(part, part.x_rest)
            for m, mirror in enumerate(fold.mirrors):
                if combination >> m & 1:
                    places = mirrored(places, mirror.axis, mirror.plane)
            images.append(match(at, places, _SAME * fold.edge))
        self.of_image = np.array(images)
        """(2^k, p')"""
        self.shape = (len(at), n_tools)
        if (self.of_image < 0).any() or len(np.unique(self.of_image)) != len(at):
            raise ValueError("a body's points do not mirror themselves")


def find_fold(body: Body, region: Region, tools: ToolSet, spec: FemSpec) -> Fold | None:
    """How a region can be folded; None where it mirrors itself nowhere, or is not all of the body, or its tools begin
    elsewhere, and where its integrator or its size ask for all of it."""
    if not can_fold(spec) or len(region.seam) or len(region.cells) < body.n_cells:
        return None
    mirrors, images = common_mirrors(body, tools)
    if not mirrors:
        return None
    x, near = body.x_rest, _SAME * body.resolution
    node, cell = np.arange(body.n_nodes), np.arange(body.n_cells)
    sign, shift = np.ones((body.n_nodes, 3)), np.zeros((body.n_nodes, 3))
    for mirror in mirrors:
        e, at = mirror.axis, mirror.plane
        beyond, side = x[:, e] < at - near, x[body.cell_nodes[:, 13], e] < at
        node, cell = np.where(beyond[node], mirror.nodes[node], node), np.where(side[cell], mirror.cells[cell], cell)
        sign[beyond, e], shift[beyond, e] = -1.0, 2.0 * at
    halved = _with_points_of(body, mirrors, near)
    part = build_region(halved, np.unique(cell), _NO_NODES)
    if 3 * np.count_nonzero(~part.fixed) > MOST_FACTORED:
        return None
    axis = np.array([mirror.axis for mirror in mirrors], dtype=np.int32)
    plane = np.array([mirror.plane for mirror in mirrors])
    across = [np.flatnonzero(np.abs(x[part.nodes, e] - c) <= near) for e, c in zip(axis, plane, strict=True)]
    rollers = [np.stack([nodes, np.full_like(nodes, e)], axis=1) for e, nodes in zip(axis, across, strict=True)]
    model, tree = build_model(halved, part, tools, spec, NONE, rollers=np.concatenate(rollers).astype(np.int32))
    points = point_positions(model, model.x_rest)
    return Fold(
        mirrors=tuple(mirrors),
        keeps_places=spec.integrator == "bdf2",
        axis=axis,
        plane=plane,
        image=np.array(images, dtype=np.int32),
        region=part,
        tables=(model, tree),
        node=np.searchsorted(part.nodes, node).astype(np.int32),
        cell=np.searchsorted(part.cells, cell).astype(np.int32),
        sign=sign,
        shift=shift,
        on=np.array([np.abs(points[:, e] - c) <= near for e, c in zip(axis, plane, strict=True)]),
        edge=body.resolution,
    )


def can_fold(spec: FemSpec) -> bool:
    """Whether these settings let FEM fold anything: octants are not divided alike into tetrahedra on both sides."""
    alike = not FACTS[spec.element].functions.startswith("tet")
    return spec.mirrored and alike and spec.integrator != "symplectic_euler"


def common_mirrors(body: Body, tools: ToolSet) -> tuple[list[Mirror], list[Ints]]:
    """Mirrors of a body in which its tools begin as images of each other, and each tool's image there (t,)."""
    found = [(mirror, _images_of_tools(mirror, tools, body.resolution)) for mirror in find_mirrors(body)]
    return [mirror for mirror, image in found if image is not None], [image for _, image in found if image is not None]


def _images_of_tools(mirror: Mirror, tools: ToolSet, edge: float) -> Ints | None:
    """Each tool's in a mirror (t,), None where one has none as tools begin."""
    axis, plane = np.array([mirror.axis], dtype=np.int32), np.array([mirror.plane])
    found = []
    for t in range(len(tools.names)):
        for other in range(len(tools.names)):
            pair = np.array([t, other])
            alike = (
                tools.kind[t] == tools.kind[other]
                and tools.friction[t] == tools.friction[other]
                and tools.near[t] == tools.near[other]
                and np.array_equal(tools.shape[t], tools.shape[other])
            )
            poses = tools.position[pair], tools.orientation[pair]
            swapped = np.array([[1, 0]], dtype=np.int32)
            if alike and tools_agree(
                tools.kind[pair], tools.shape[pair], axis, plane, swapped, _SAME * edge, *poses, *poses
            ):
                found.append(other)
                break
        else:
            return None
    image = np.array(found, dtype=np.int32)
    return image if np.array_equal(image[image], np.arange(len(image))) else None


def _with_points_of(body: Body, mirrors: list[Mirror], near: float) -> Body:
    """The body, whose points on a mirror's plane are carried by cells of the part and stand for the area there."""
    surface = body.surface
    cell, local, area = surface.cell.copy(), surface.local.copy(), surface.area.copy()
    x = body.x_rest[node_of_point(body)]
    for mirror in mirrors:
        on = np.abs(x[:, mirror.axis] - mirror.plane) <= near
        area[on] *= 0.5
        # a point on the plane is its own image, which the image of its cell has at the image of its node
        across = np.flatnonzero(on & (body.x_rest[body.cell_nodes[cell, 13], mirror.axis] < mirror.plane))
        node = mirror.nodes[body.cell_nodes[cell[across], _local(local[across])]]
        cell[across] = mirror.cells[cell[across]]
        place = np.argmax(body.cell_nodes[cell[across]] == node[:, None], axis=1)
        local[across] = np.stack([place % 3, place // 3 % 3, place // 9], axis=1) - 1.0
    return replace(body, surface=replace(surface, cell=cell, local=local, area=area))


def _local(place: Floats) -> Ints:
    """Local id of the node at a place in its cell (m, 3)."""
    return (np.rint(place).astype(np.int32) + 1) @ np.array([1, 3, 9], dtype=np.int32)
