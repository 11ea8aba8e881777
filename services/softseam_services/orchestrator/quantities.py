"""How the quantities of a step are measured, from the participants' replies and the body's fields.

One row for each of `softseam_protocol.quantities`, which has their units and meanings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.outcomes import Figure
from softseam_protocol.messages.participant import Advanced
from softseam_protocol.messages.session import Frame
from softseam_protocol.quantities import PROBED, QUANTITIES
from softseam_protocol.table import Table
from softseam_services.body.build import AnyBody
from softseam_services.body.interpolate import bounding_points
from softseam_services.body.recover import von_mises
from softseam_services.body.tetrahedron import SHARES
from softseam_services.orchestrator.indicators import energy_error, root_mean_square
from softseam_services.orchestrator.probes import PROBE_MEASUREMENTS
from softseam_services.orchestrator.program import Program

Floats = NDArray[np.float64]


class RestingBody:
    """What quantities compare with: the body's box, weight and end at rest."""

    def __init__(self, body: AnyBody) -> None:
        self.body = body
        points = bounding_points(body)
        low, high = points.min(axis=0), points.max(axis=0)
        self.centre: Floats = 0.5 * (low + high)
        self.bottom, self.top = float(low[2]), float(high[2])
        """[m]"""
        self.weight = float(body.total_mass * np.linalg.norm(body.gravity))
        """[N]"""

    @cached_property
    def cut(self) -> bool:
        """Whether its nodes may be outside of it: its surface points tell where it is."""
        return self.body.cut

    @cached_property
    def tip(self) -> tuple[int, Floats]:
        """Node in the middle of the end farthest from what is fixed, and its place (3,) [m]; without any, of the +x
        end. Where the body is cut, a surface point."""
        body = self.body
        places = bounding_points(body)
        clamped = body.x_rest[body.fixed]
        away = np.array([1.0, 0.0, 0.0])
        if len(clamped):
            away = self.centre - clamped.mean(axis=0)
        far_end = places @ away
        end = np.flatnonzero(far_end >= far_end.max() - 1e-9 * np.ptp(far_end))
        middle = places[end].mean(axis=0)
        tip = int(end[np.argmin(np.linalg.norm(places[end] - middle, axis=1))])
        return tip, places[tip]

    @cached_property
    def octant_volume(self) -> Floats:
        """Filled at rest, of a body in cells (C, 8) [m^3]; of hexahedra of any shape, an eighth of the cell's; of
        tetrahedra, by `SHARES`."""
        body = self.body
        assert body.has_cells  # others have no octants
        density = body.of_octants([material.density for material in body.materials])
        fill = body.fill * SHARES if body.tetrahedra else body.fill
        volume = body.cell_mass.sum(axis=1) / (fill * density).sum(axis=1)
        return np.asarray(volume[:, None] * fill)

    @cached_property
    def strength(self) -> Floats | None:
        """Of each octant (C, 8), inf where its material says none [Pa]; None where none does."""
        if not self.body.has_cells or all(math.isinf(material.strength) for material in self.body.materials):
            return None
        return self.body.of_octants([material.strength for material in self.body.materials])


@dataclass(slots=True)
class Look:
    """A body in its tools' hands as it stands after a step, or at rest: what measurements read."""

    rest: RestingBody
    program: Program
    replies: Mapping[str, Advanced]
    """of the participants, by region; none at rest"""
    position: Floats
    """of the tools (t, 3) [m]"""
    orientation: Floats
    """of the tools (t, 4)"""
    frame: Frame | None
    """the body's fields, where somebody looked at them"""
    grip_force: float = 0.0
    """see `Quantities.grip_force` [N]"""
    rise: float = 0.0
    """height above where the lift began [m]"""

    @property
    def fields(self) -> Frame:
        """The frame, for measurements that need fields."""
        assert self.frame is not None
        return self.frame

    @property
    def strain(self) -> float:
        """Strain energy of the body [J]."""
        return sum(reply.strain for reply in self.replies.values())


Needs = Literal["pose", "step", "fields", "indicators"]


@dataclass(frozen=True)
class Measurement:
    """One quantity: what measuring it needs, and how it is done.

    needs  pose: where the tools are, known at rest, too; step: the replies of a step; fields: a frame, known at rest,
           too; indicators: a frame with the participants' error indicators, and the step's replies
    """

    needs: Needs
    measure: Callable[[Look], float]


def _at_hand(look: Look) -> set[Needs]:
    """What measurements may need, of a look."""
    found: set[Needs] = {"pose"}
    if look.replies:
        found.add("step")
    if look.frame is not None:
        found.add("fields")
        if look.replies and look.frame.indicators is not None:
            found.add("indicators")
    return found


def _slip(look: Look) -> float:
    return max(reply.figure(Figure.SLIP) for reply in look.replies.values())


def _sag(look: Look) -> float:
    low, high = math.inf, -math.inf
    for reply in look.replies.values():
        low, high = min(reply.bounds.item(2), low), max(reply.bounds.item(5), high)
    return (look.rest.top - look.rest.bottom) - (high - low)


def _compression(look: Look) -> float:
    grips = look.program.grips
    of_this = grips.first is not None and grips.first.body is look.rest.body
    return grips.compression(look.position, look.orientation) if of_this else 0.0


def _peak_von_mises(look: Look) -> float:
    return float(von_mises(look.fields.cauchy).max())


def _stress_over_strength(look: Look) -> float:
    assert look.rest.strength is not None  # else it is not measured
    return float((von_mises(look.fields.cauchy) / look.rest.strength).max())


def _von_mises_p99(look: Look) -> float:
    """A peak at an edge of a tool grows with every refinement; the volume around it that bears more does not."""
    stress, volume = von_mises(look.fields.cauchy).ravel(), look.rest.octant_volume.ravel()
    order = np.argsort(stress)
    below = np.cumsum(volume[order])
    return float(stress[order][np.searchsorted(below, 0.99 * below[-1])])


def _tip_deflection(look: Look) -> float:
    tip, place = look.rest.tip
    now = look.fields.point_x if look.rest.cut else look.fields.x
    return float(now[tip, 2] - place[2])


def _error(name: str) -> Measurement:
    def measure(look: Look) -> float:
        return energy_error(getattr(look.fields.indicators, name), look.strain)

    return Measurement("indicators", measure)


def _constraint_residual(look: Look) -> float:
    return max(reply.figure(Figure.RESIDUAL) for reply in look.replies.values())


def _traction_jump(look: Look) -> float:
    assert look.fields.indicators is not None
    return root_mean_square(look.fields.indicators.traction_jump)


def _of_particles(name: str) -> Measurement:
    def measure(look: Look) -> float:
        return [reply.extras[name] for reply in look.replies.values() if name in reply.extras][-1]

    return Measurement("step", measure)


MEASUREMENTS: Table[Measurement] = Table(
    "measurements of quantities",
    {
        "grip_force": Measurement("step", lambda look: look.grip_force),
        "lift_height": Measurement("step", lambda look: look.rise),
        "slip": Measurement("step", _slip),
        "peak_von_mises": Measurement("fields", _peak_von_mises),
        "stress_over_strength": Measurement("fields", _stress_over_strength),
        "von_mises_p99": Measurement("fields", _von_mises_p99),
        "sag": Measurement("step", _sag),
        "compression": Measurement("pose", _compression),
        "tip_deflection": Measurement("fields", _tip_deflection),
        "model_error": _error("model_error"),
        "mesh_error": _error("mesh_error"),
        "traction_jump": Measurement("indicators", _traction_jump),
        "constraint_residual": Measurement("step", _constraint_residual),
    }
    | {
        name: _of_particles(name)
        for name in (
            "worst_stretch",
            "stretch_violation",
            "stretch_violation_mean",
            "bending_violation",
            "bending_violation_mean",
            "stretch_energy",
            "bending_energy",
            "held",
        )
    },
)


_OF_GRIP = ("compression",)
"""what only the body has that tools close on"""


class Quantities:
    """Measures what the scene asks for, and what is always reported. Raises MissingRow where a table lacks a row.

    gripped  whether the tools that close do so on this body
    """

    def __init__(self, body: AnyBody, program: Program, wanted: Collection[str], gripped: bool = True) -> None:
        MEASUREMENTS.require(QUANTITIES, QUANTITIES.described)
        QUANTITIES.require(MEASUREMENTS, MEASUREMENTS.described)
        PROBE_MEASUREMENTS.require(PROBED, PROBED.described)
        self._program, self.rest = program, RestingBody(body)
        kinds = ("any", body.made_of)
        self.rows = [
            (name, row, MEASUREMENTS[name])
            for name, row in QUANTITIES.items()
            if row.of in kinds and (row.always or name in wanted) and (gripped or name not in _OF_GRIP)
            if not row.of_strength or self.rest.strength is not None
        ]
        """by name, in their order"""
        asked = [row.needs for name, described, row in self.rows if name in wanted or described.of_strength]
        self.need_fields = "fields" in asked or "indicators" in asked
        """whether some that the scene asks for, or the strength of a material, cost a look at the fields"""
        self.need_indicators = "indicators" in asked

    def grip_force(self, wrench: Floats, orientation: Floats) -> float:
        """Mean force of the body on the tools that grip, against their ways [N]; orientations (t, 4)."""
        grip = self._program.grips.first
        return 0.0 if grip is None else grip.force(wrench, orientation)

    def height(self, replies: Mapping[str, Advanced]) -> float:
        """How far the centre of mass rose since rest, against gravity [m]; without gravity, the lowest point."""
        if self.rest.weight > 0.0:
            return sum(reply.gravity for reply in replies.values()) / self.rest.weight
        return min(float(reply.bounds[0, 2]) for reply in replies.values()) - self.rest.bottom

    def measure(
        self,
        replies: Mapping[str, Advanced],
        grip_force: float,
        position: Floats,
        orientation: Floats,
        frame: Frame | None,
        rise: float,
    ) -> dict[str, float]:
        """All quantities of the step; those that need fields only where there is a frame. Arguments as in `Look`."""
        look = Look(self.rest, self._program, replies, position, orientation, frame, grip_force, rise)
        at_hand = _at_hand(look)
        return {name: row.measure(look) for name, _, row in self.rows if row.needs in at_hand}

    def at_rest(self, position: Floats, orientation: Floats, frame: Frame | None) -> dict[str, float]:
        """The same before the first step; those that only a step can tell are left out."""
        look = Look(self.rest, self._program, {}, position, orientation, frame)
        found, at_hand = {}, _at_hand(look)
        for name, described, row in self.rows:
            if described.at_rest is not None:
                found[name] = described.at_rest
            elif row.needs in at_hand:
                found[name] = row.measure(look)
        return found
