"""The report of a step: what it did to all bodies together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import Advanced, ToolMotion
from softseam_protocol.messages.session import ErrorEstimate, InterfaceReport, PartReport, StepReport
from softseam_services.orchestrator.energy_balance import Entry

Floats = NDArray[np.float64]


def step_report(
    *,
    header: Header,
    phase: int,
    motion: ToolMotion,
    wrench: Floats,
    quantities: dict[str, float],
    entries: Mapping[str, Entry],
    interfaces: Mapping[str, InterfaceReport],
    command: Floats,
    seconds: dict[str, float],
    done: bool,
    estimate: ErrorEstimate | None,
) -> StepReport:
    """Of what each body's accounts entered.

    wrench      of all bodies on the tools (t, 6) [N, N m]
    interfaces  between bodies, by name
    command     velocities of the tools (t, 6) [m/s, rad/s]
    """
    parts: dict[str, PartReport] = {}
    found = dict(interfaces)
    first, *others = entries.values()
    energy, momentum, angular = dict(first.energy), first.momentum, first.angular_momentum
    for entry in entries.values():
        parts |= entry.parts
        found |= entry.interfaces
    for entry in others:
        names = dict.fromkeys((*energy, *entry.energy))
        energy = {name: energy.get(name, 0.0) + entry.energy.get(name, 0.0) for name in names}
        momentum = momentum + entry.momentum
        angular = angular + entry.angular_momentum
    drive_work = sum(entry.drive_work for entry in entries.values())
    energy |= {"drive_work": drive_work, "contact_loss": drive_work - energy["tool_work"]}
    return StepReport(
        header,
        phase,
        motion.position_next.copy(),
        motion.orientation_next.copy(),
        wrench,
        quantities,
        found,
        parts,
        energy,
        momentum,
        angular,
        max(entry.penetration for entry in entries.values()),
        seconds,
        done,
        command[:, :3].copy(),
        command[:, 3:].copy(),
        motion.gripping,
        estimate,
    )


def worst(estimates: Mapping[str, ErrorEstimate]) -> ErrorEstimate | None:
    """Of the body that is off most; one of which nothing is known is off more. None of no body."""
    if not estimates:
        return None
    name = max(
        estimates, key=lambda name: (estimates[name].too_large, estimates[name].answer == 0.0, estimates[name].answer)
    )
    if len(estimates) == 1:
        return estimates[name]
    return replace(estimates[name], text=f"{name}: {estimates[name].text}")


def work_of_drive(wrench: Floats, command: Floats, dt: float) -> float:
    """What tools that move so (t, 6) [m/s, rad/s] over dt [s] put into what does this to them (t, 6) [N, N m]; [J]."""
    return -dt * float(np.vdot(wrench, command))


def wrench_of(replies: Mapping[str, Advanced]) -> Floats:
    """Of all parts of a body on the tools (t, 6) [N, N m]."""
    first, *others = (reply.wrench for reply in replies.values())
    return sum(others, first)
