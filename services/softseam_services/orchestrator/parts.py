"""The parts that a body is in at the moment, the messages that build them, and the body put together from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.handover import Side, merge_sides
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.names import within
from softseam_protocol.messages.participant import BodyState, Fields, PartMesh
from softseam_protocol.messages.session import Frame
from softseam_protocol.models import facts_of
from softseam_services.body.body import Body
from softseam_services.body.build import AnyBody
from softseam_services.body.hardly_filled import HardlyFilled
from softseam_services.body.particles import ParticleBody
from softseam_services.body.region import build_region

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]

SEAM = "seam"
"""what ties the parts of one body, in ids"""


@dataclass(frozen=True)
class Parts:
    """A body's cells in one part, or in two that share nodes; the first carries the surface points on these."""

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

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Ids of the parts."""
        return tuple(self.cells)

    @cached_property
    def cut_steps(self) -> tuple[str, ...]:
        """Ids of those whose models cut a step that they cannot take at once."""
        return tuple(name for name in self.names if facts_of(self.models[name]).cuts_steps)

    @property
    def interface(self) -> str:
        """Id of what ties two."""
        return within(self.body, SEAM)

    @property
    def coupling_nodes(self) -> Ints:
        """Global ids of the nodes on which interfaces act."""
        return self.joints if len(self.joints) else self.seam

    def owns_points(self, part: str) -> bool:
        """Whether contact at the surface points on its coupling nodes is a part's."""
        return part == self.names[0] or len(self.joints) > 0


def side_mass(body: Body, cells: Ints) -> Floats:
    """Mass that these cells give to every node of the body (N,) [kg]."""
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes[cells].reshape(-1), body.cell_mass[cells].reshape(-1))
    return mass


def part_mesh(body: AnyBody, parts: Parts, name: str) -> PartMesh | None:
    """The mesh of one side; None of particles that constraints join."""
    if not body.has_cells:
        return points_mesh(body) if body.made_of == "points" else None
    part = build_region(body, parts.cells[name], parts.coupling_nodes, parts.owns_points(name))
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


def merged_state(body: Body, parts: Parts, fields: Mapping[str, Fields]) -> BodyState:
    """One state of the whole body out of its parts'."""
    empty = Side(np.zeros(0, np.int32), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
    held = []
    for name in parts.names:
        side = fields[name]
        held.append(Side(side.nodes, side_mass(body, parts.cells[name])[side.nodes], side.x, side.v))
    a, b = held if len(held) > 1 else (*held, empty)
    merged = merge_sides(a, b, body.n_nodes, body.fixed)
    force, tool = contact_state(body, fields)
    internal = np.zeros((body.n_cells if body.material.n_state else 0, 8, body.material.n_state))
    for name, side in fields.items():
        if len(side.internal):
            internal[parts.cells[name]] = side.internal
    return BodyState(merged.x, merged.v, force, tool, internal)


def whole_frame(
    header: Header,
    body: AnyBody,
    parts: Parts,
    fields: Mapping[str, Fields],
    near: Mask,
    multiplier: Floats,
    position: Floats,
    orientation: Floats,
    hardly_filled: HardlyFilled | None,
) -> Frame:
    """The parts' fields put together; seam nodes are the first part's. Tool poses (t, 3), (t, 4).

    hardly_filled  octants of a body in cells whose stress is their neighbours'
    """
    if len(parts.names) == 1:  # all of it, in the body's order
        (side,) = fields.values()
        x, cauchy, point_x, energy, strain = side.x, side.cauchy, side.point_x, side.cell_energy, side.point_strain
        force, tool = side.contact_force, side.contact_tool
    else:
        x, point_x, strain = np.empty((body.n_nodes, 3)), np.empty((body.n_points, 3)), np.zeros(0)
        cauchy, energy = np.empty((body.n_cells, 8, 6)), np.empty(body.n_cells)
        for name in reversed(parts.names):
            side, cells = fields[name], parts.cells[name]
            x[side.nodes], point_x[side.points], strain = side.x, side.point_x, side.point_strain
            cauchy[cells], energy[cells] = side.cauchy, side.cell_energy if len(side.cell_energy) else 0.0
        force, tool = contact_state(body, fields)
    return Frame(
        header, parts.body, x, cauchy if hardly_filled is None else hardly_filled.replaced(cauchy),
        near.astype(np.int8), point_x, force, tool, parts.seam, multiplier, position.copy(), orientation.copy(), strain,
        energy,
    )  # fmt: skip
