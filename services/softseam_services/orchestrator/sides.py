"""The one or two parts that a body is cut into at the moment, and the messages that build them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.handover import Side, merge_sides
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.names import within
from softseam_protocol.messages.participant import BodyState, Fields, PartMesh
from softseam_protocol.messages.session import Frame
from softseam_services.body.body import Body
from softseam_services.body.build import AnyBody
from softseam_services.body.hardly_filled import HardlyFilled
from softseam_services.body.particles import ParticleBody
from softseam_services.body.region import build_region, shared_nodes

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]

NEAR, FAR, SEAM = "near", "far", "seam"
"""what the rule that cuts a body calls its parts, and what ties them"""


@dataclass(frozen=True)
class Sides:
    """A cut of a body's cells in two parts; one may be empty and is then left out."""

    body: str
    models: dict[str, str]
    """model of each part, by id"""
    cells: dict[str, Ints]
    """global ids of each part's cells, ascending"""
    n_nodes: dict[str, int]
    seam: Ints
    """global ids of the nodes that both own, clamped ones left out (s,)"""
    joints: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    """global ids of the nodes of a whole body on which interfaces to others act, ascending (j,)"""

    @property
    def coupling_nodes(self) -> Ints:
        """Global ids of the nodes on which interfaces act."""
        return self.joints if len(self.joints) else self.seam

    def owns_points(self, part: str) -> bool:
        """Whether contact at the surface points on its coupling nodes is a part's."""
        return part == self.near or len(self.joints) > 0

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of the parts."""
        return tuple(self.cells)

    @property
    def near(self) -> str:
        """Id of the part of the near cells; it carries the surface points on the seam."""
        return within(self.body, NEAR)

    @property
    def far(self) -> str:
        """Id of the part of the others."""
        return within(self.body, FAR)

    @property
    def interface(self) -> str:
        """Id of what ties the two."""
        return within(self.body, SEAM)


def cut(name: str, body: AnyBody, near: Mask, near_model: str, far_model: str) -> Sides:
    """Cut the body of that name into the near cells (C,) and the rest; one of particles is one part, without cells."""
    none = np.zeros(0, dtype=np.int32)
    part, other = within(name, NEAR), within(name, FAR)
    if not body.has_cells:
        return Sides(name, {other: far_model}, {other: none}, {other: body.n_nodes}, none)
    cells = {part: np.flatnonzero(near).astype(np.int32), other: np.flatnonzero(~near).astype(np.int32)}
    models = {part: near_model, other: far_model}
    kept = [name for name in (part, other) if len(cells[name])]
    seam = none
    if len(kept) == 2:
        seam = shared_nodes(body, cells[part], cells[other])
    return Sides(
        name,
        {name: models[name] for name in kept},
        {name: cells[name] for name in kept},
        {name: len(np.unique(body.cell_nodes[cells[name]])) for name in kept},
        seam,
    )


def side_mass(body: Body, cells: Ints) -> Floats:
    """Mass that these cells give to every node of the body (N,) [kg]."""
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes[cells].reshape(-1), body.cell_mass[cells].reshape(-1))
    return mass


def part_mesh(body: AnyBody, sides: Sides, name: str) -> PartMesh | None:
    """The mesh of one side; None of particles that constraints join."""
    if not body.has_cells:
        return points_mesh(body) if body.made_of == "points" else None
    part = build_region(body, sides.cells[name], sides.coupling_nodes, sides.owns_points(name))
    return PartMesh(
        part.nodes,
        body.x_rest[part.nodes],
        part.mass,
        part.fixed.astype(np.int8),
        part.cell_nodes,
        part.points,
        part.point_cell,
        part.point_local,
    )


def points_mesh(body: ParticleBody) -> PartMesh:
    """That of a body of points, whole: no cells, and each surface point with the node that it follows."""
    nodes, points = (np.arange(count, dtype=np.int32) for count in (body.n_nodes, body.n_points))
    cells, fixed = np.zeros((0, 27), dtype=np.int32), body.fixed.astype(np.int8)
    return PartMesh(nodes, body.x_rest, body.mass, fixed, cells, points, body.skin.owner, body.skin.offset)


def contact_state(body: AnyBody, fields: Mapping[str, Fields]) -> tuple[Floats, Ints]:
    """Contact force (P, 3) [N] and tool (P,) of all surface points."""
    n_points = body.n_points
    force = np.zeros((n_points, 3))
    tool = np.full(n_points, -1, dtype=np.int32)
    for side in fields.values():
        force[side.points] = side.contact_force
        tool[side.points] = side.contact_tool
    return force, tool


def resting_state(body: AnyBody) -> BodyState:
    """The body at rest in shape, with the scene's initial velocities."""
    n_points = body.n_points
    return BodyState(
        body.x_rest.copy(), body.v_initial.copy(), np.zeros((n_points, 3)), np.full(n_points, -1, dtype=np.int32)
    )


def merged_state(body: Body, sides: Sides, fields: Mapping[str, Fields]) -> BodyState:
    """One state of the whole body out of its sides'."""
    empty = Side(np.zeros(0, np.int32), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
    parts = {
        name: Side(side.nodes, side_mass(body, sides.cells[name])[side.nodes], side.x, side.v)
        for name, side in fields.items()
    }
    merged = merge_sides(parts.get(sides.near, empty), parts.get(sides.far, empty), body.n_nodes, body.fixed)
    force, tool = contact_state(body, fields)
    internal = np.zeros((body.n_cells if body.material.n_state else 0, 8, body.material.n_state))
    for name, side in fields.items():
        if len(side.internal):
            internal[sides.cells[name]] = side.internal
    return BodyState(merged.x, merged.v, force, tool, internal)


def whole_frame(
    header: Header,
    body: AnyBody,
    sides: Sides,
    fields: Mapping[str, Fields],
    near: Mask,
    multiplier: Floats,
    position: Floats,
    orientation: Floats,
    hardly_filled: HardlyFilled | None,
) -> Frame:
    """The sides' fields put together; seam nodes are the near side's. Tool poses (t, 3), (t, 4).

    hardly_filled  octants of a body in cells whose stress is their neighbours'
    """
    if len(sides.names) == 1:  # all of it, in the body's order
        (side,) = fields.values()
        x, point_x = side.x, side.point_x
        cauchy = side.cauchy if hardly_filled is None else hardly_filled.replaced(side.cauchy)
        force, tool, strain, energy = side.contact_force, side.contact_tool, side.point_strain, side.cell_energy
        return Frame(
            header, sides.body, x, cauchy, near.astype(np.int8), point_x, force, tool, sides.seam, multiplier,
            position.copy(), orientation.copy(), strain, energy,
        )  # fmt: skip
    x = np.empty((body.n_nodes, 3))
    cauchy = np.empty((body.n_cells, 8, 6))
    point_x = np.empty((body.n_points, 3))
    strain = np.zeros(0)
    energy = np.empty(body.n_cells)
    for name in reversed(sides.names):
        side = fields[name]
        x[side.nodes] = side.x
        cauchy[sides.cells[name]] = side.cauchy
        energy[sides.cells[name]] = side.cell_energy if len(side.cell_energy) else 0.0
        point_x[side.points] = side.point_x
        strain = side.point_strain
    force, tool = contact_state(body, fields)
    return Frame(
        header,
        sides.body,
        x,
        cauchy if hardly_filled is None else hardly_filled.replaced(cauchy),
        near.astype(np.int8),
        point_x,
        force,
        tool,
        sides.seam,
        multiplier,
        position.copy(),
        orientation.copy(),
        strain,
        energy,
    )
