"""What a client sees after a step: one frozen, typed value."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from softseam.errors import BadInput, FieldsNotObserved
from softseam_protocol.messages import session as messages
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.session import (
    ErrorEstimate,
    Event,
    Frame,
    Indicators,
    InterfaceReport,
    PartReport,
    StepReport,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ToolView:
    """A rigid tool at the end of the step."""

    position: Floats
    """centre, or a plane's point (3,) [m]"""
    orientation: Floats
    """unit quaternion w, x, y, z (4,)"""
    velocity: Floats
    """velocity that was applied in the step (3,) [m/s]"""
    turning: Floats
    """angular velocity about the position that was applied in the step (3,) [rad/s]"""


@dataclass(frozen=True, eq=False)
class BodyView:
    """Fields of one body at the end of a step. Arrays are read-only."""

    frame: Frame
    """the message that they came in"""

    @property
    def positions(self) -> Floats:
        """Positions of all nodes (N, 3) [m]."""
        return self.frame.x

    @property
    def surface(self) -> Floats:
        """Positions of the true surface's points (P, 3) [m]."""
        return self.frame.point_x

    @property
    def contact_force(self) -> Floats:
        """Contact force on each surface point (P, 3) [N]."""
        return self.frame.contact_force

    @property
    def contact_tool(self) -> NDArray[np.int32]:
        """Index of the tool that each surface point touches, -1 for none (P,)."""
        return self.frame.contact_tool

    @property
    def cell_near(self) -> NDArray[np.int8]:
        """1 where a cell belongs to the near region, 0 where to the far one (n_cells,)."""
        return self.frame.cell_near

    @property
    def cauchy(self) -> Floats:
        """Cauchy stress xx yy zz yz xz xy per octant of each cell (n_cells, 8, 6) [Pa]; of octants that the body hardly
        fills that of better filled neighbours."""
        return self.frame.cauchy

    @property
    def von_mises(self) -> Floats:
        """Von Mises stress per octant of each cell (n_cells, 8) [Pa]."""
        return von_mises(self.frame.cauchy)

    @property
    def principal_stress(self) -> Floats:
        """Principal Cauchy stresses, ascending, per octant of each cell (n_cells, 8, 3) [Pa]."""
        return principal_stress(self.frame.cauchy)

    @property
    def strain_energy(self) -> Floats:
        """Strain energy of each cell, which sum to those of `parts` (n_cells,) [J]."""
        return self.frame.cell_energy

    @property
    def indicators(self) -> Indicators:
        """Errors of model and mesh [J], traction jump [Pa] and gap [m] of each cell (n_cells,)."""
        found = self.frame.indicators
        if found is None:
            raise FieldsNotObserved(
                "the scene does not observe its errors: add model_error, mesh_error or traction_jump to `quantities`"
            )
        return found


@dataclass(frozen=True, eq=False, repr=False)
class Observation:
    """State and error indicators of the simulation at the end of a step.

    Fields (`bodies`; of a scene with one body also `positions`, `cauchy`, `von_mises`, ...) are there unless the step
    was taken with `fields=False`; reading one then raises FieldsNotObserved. Arrays are read-only.
    """

    time: float
    """simulated time at the end of the step [s]"""
    step: int
    """steps taken since the reset"""
    done: bool
    """whether the scene's motion or duration is over"""
    events: tuple[Event, ...]
    """what happened since the observation before: switches, phases, fallbacks, recoveries, alarms"""
    report: StepReport
    """the message that all this came in"""
    frames: Mapping[str, Frame]
    """the fields' messages by body; empty where they were not asked for"""
    tool_names: tuple[str, ...]
    """in the scene's order"""

    def __repr__(self) -> str:
        """In a few lines: when, how far, and what is measured; `report` and `frames` have the rest."""
        numbers = ", ".join(f"{name} {value:.4g}" for name, value in self.quantities.items())
        fields = ", ".join(self.frames) or "none"
        over = ", done" if self.done else ""
        return f"<Observation: step {self.step}, {self.time:.4g} s{over}; {numbers}; fields of: {fields}>"

    @cached_property
    def tools(self) -> Mapping[str, ToolView]:
        """The tools by name."""
        report = self.report
        turning = report.turning if len(report.turning) else np.zeros((len(self.tool_names), 3))
        views = map(ToolView, report.tool_position, report.tool_orientation, report.command, turning)
        return MappingProxyType(dict(zip(self.tool_names, views, strict=True)))

    @cached_property
    def wrench(self) -> Mapping[str, Floats]:
        """Force and torque about its centre that the body exerts on each tool (6,) [N, N m]."""
        return MappingProxyType(dict(zip(self.tool_names, self.report.wrench, strict=True)))

    @property
    def quantities(self) -> Mapping[str, float]:
        """Every quantity of the scene, SI units. Those that need fields are missing after a step without fields."""
        return MappingProxyType(self.report.quantities)

    @property
    def seam(self) -> InterfaceReport:
        """Gap [m], exchanges, nodes, largest multiplier [N] and work [J] of all interfaces together."""
        return self.report.seam

    @property
    def interfaces(self) -> Mapping[str, InterfaceReport]:
        """By id: seams of bodies in parts, what the scene's interfaces say, and of its contacts A+B those that pressed;
        `total` is the whole force on the first body, or the near part [N]."""
        return MappingProxyType(self.report.interfaces)

    @property
    def parts(self) -> Mapping[str, PartReport]:
        """Body, model, size, energies [J] and cost of each part, by id: BODY.near and BODY.far."""
        return MappingProxyType(self.report.parts)

    @property
    def energies(self) -> Mapping[str, float]:
        """Ledger of the step [J]."""
        return MappingProxyType(self.report.energy)

    @property
    def penetration(self) -> float:
        """Deepest penetration of a surface point into a tool [m]."""
        return self.report.penetration

    @property
    def momentum(self) -> Floats:
        """(3,) [kg m/s]"""
        return self.report.momentum

    @property
    def angular_momentum(self) -> Floats:
        """About the world's origin (3,) [kg m^2/s]."""
        return self.report.angular_momentum

    @property
    def seconds(self) -> Mapping[str, float]:
        """Wall time of the step by part [s]."""
        return MappingProxyType(self.report.seconds)

    @property
    def error_estimate(self) -> ErrorEstimate | None:
        """How far the run may be off, where it ends; None before, and of a body of particles."""
        return self.report.estimate

    @property
    def grip_force(self) -> float:
        """Mean normal force of the gripping tools [N]."""
        return self._quantity("grip_force")

    @property
    def lift_height(self) -> float:
        """How far the body has been lifted from where it was before a tool that touches it first rose [m]."""
        return self._quantity("lift_height")

    @property
    def slip(self) -> float:
        """Largest slip of a touching point on a moving tool, or what it was when tools lost the body [m]."""
        return self._quantity("slip")

    @cached_property
    def bodies(self) -> Mapping[str, BodyView]:
        """Fields of each body by name."""
        if not self.frames:
            for event in self.events:
                if event.kind is EventKind.LOST and event.header.step == self.step:
                    raise FieldsNotObserved(event.message)
            raise FieldsNotObserved("this observation was taken without fields: take the step with fields=True")
        return MappingProxyType({name: BodyView(frame) for name, frame in self.frames.items()})

    @property
    def body(self) -> BodyView:
        """Fields of the body of a scene that has one; the properties below are its own."""
        if len(self.bodies) > 1:
            raise BadInput(f"the scene has several bodies: {', '.join(self.bodies)}: take one of `bodies`")
        return next(iter(self.bodies.values()))

    @property
    def positions(self) -> Floats:
        """See `BodyView.positions`."""
        return self.body.positions

    @property
    def surface(self) -> Floats:
        """See `BodyView.surface`."""
        return self.body.surface

    @property
    def contact_force(self) -> Floats:
        """See `BodyView.contact_force`."""
        return self.body.contact_force

    @property
    def contact_tool(self) -> NDArray[np.int32]:
        """See `BodyView.contact_tool`."""
        return self.body.contact_tool

    @property
    def cell_near(self) -> NDArray[np.int8]:
        """See `BodyView.cell_near`."""
        return self.body.cell_near

    @property
    def cauchy(self) -> Floats:
        """See `BodyView.cauchy`."""
        return self.body.cauchy

    @property
    def von_mises(self) -> Floats:
        """See `BodyView.von_mises`."""
        return self.body.von_mises

    @property
    def principal_stress(self) -> Floats:
        """See `BodyView.principal_stress`."""
        return self.body.principal_stress

    @property
    def strain_energy(self) -> Floats:
        """See `BodyView.strain_energy`."""
        return self.body.strain_energy

    @property
    def indicators(self) -> Indicators:
        """See `BodyView.indicators`."""
        return self.body.indicators

    def _quantity(self, name: str) -> float:
        try:
            return self.quantities[name]
        except KeyError:
            raise FieldsNotObserved(
                f"the scene does not observe {name}: add it to the scene's `quantities` "
                f"(there are: {', '.join(self.quantities) or 'none'})"
            ) from None


def observation_from(message: messages.Observation, tool_names: tuple[str, ...]) -> Observation:
    """The client's view of an Observation message; `tool_names` in the scene's order."""
    report = message.report
    arrays = [report.tool_position, report.tool_orientation, report.command, report.turning, report.wrench]
    arrays += [report.momentum, report.angular_momentum]
    for frame in message.frames.values():
        arrays += [frame.x, frame.cauchy, frame.point_x, frame.contact_force, frame.cell_energy]
        if frame.indicators is not None:
            seen = frame.indicators
            arrays += [seen.model_error, seen.mesh_error, seen.traction_jump, seen.gap]
        frame.cell_near.setflags(write=False)
        frame.contact_tool.setflags(write=False)
    for array in arrays:
        array.setflags(write=False)
    header, events = message.header, tuple(message.events)
    return Observation(header.time, header.step, report.done, events, report, message.frames, tool_names)


def von_mises(cauchy: Floats) -> Floats:
    """Von Mises stress sqrt(3/2 s:s), s = deviator of the stress (..., 6) ordered xx yy zz yz xz xy [Pa]."""
    xx, yy, zz, yz, xz, xy = np.moveaxis(cauchy, -1, 0)
    normal = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2)
    return np.asarray(np.sqrt(normal + 3.0 * (yz**2 + xz**2 + xy**2)))


def principal_stress(cauchy: Floats) -> Floats:
    """Eigenvalues, ascending, of stresses (..., 6) ordered xx yy zz yz xz xy: (..., 3) [Pa]."""
    full = cauchy[..., [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(*cauchy.shape[:-1], 3, 3)
    return np.asarray(np.linalg.eigvalsh(full), dtype=np.float64)
