"""Quantities of the bodies of a pile, in arrays: what `quantities` measures of one body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.pile import Members
from softseam_services.orchestrator.program import Program
from softseam_services.orchestrator.simulated_body import SimulatedBody

Floats = NDArray[np.float64]


@dataclass(slots=True)
class PileLook:
    """b bodies as they stand after a step."""

    step: Members
    height: Floats
    """of each at rest (b,) [m]"""
    grip_force: Floats
    """see `Quantities.grip_force` (b,) [N]"""
    rise: Floats
    """above where the lift began (b,) [m]"""
    slip: Floats
    """of the last step in which tools that move had each (b,) [m]"""
    compression: Floats
    """(b,) [1]"""


def _sag(look: PileLook) -> Floats:
    return look.height - (look.step.high[:, 2] - look.step.low[:, 2])


_MEASUREMENTS: dict[str, Callable[[PileLook], Floats]] = {
    "grip_force": lambda look: look.grip_force,
    "lift_height": lambda look: look.rise,
    "slip": lambda look: look.slip,
    "sag": _sag,
    "compression": lambda look: look.compression,
    "constraint_residual": lambda look: look.step.residual,
}


class PileQuantities:
    """Measures of b bodies at once what each would measure of itself.

    program  of the tools
    """

    def __init__(self, bodies: Sequence[SimulatedBody], program: Program) -> None:
        self._bodies, self._program = bodies, program
        rests = [body.quantities.rest for body in bodies]
        self._weight = np.array([rest.weight for rest in rests])
        self._bottom = np.array([rest.bottom for rest in rests])
        self._height = np.array([rest.top - rest.bottom for rest in rests])
        self._place = {id(rest.body): place for place, rest in enumerate(rests)}
        measured = [[name for name, _, row in body.quantities.rows if row.needs in ("pose", "step")] for body in bodies]
        self._asked = {name: None for names in measured for name in names}
        self.known = self._asked.keys() <= _MEASUREMENTS.keys()
        """whether all that steps give can be measured so; an extension may have added others"""
        columns = {name: at for at, name in enumerate(self._asked)}
        self._names = [body.prefix + name for body, names in zip(bodies, measured, strict=True) for name in names]
        wanted = [len(columns) * place + columns[name] for place, names in enumerate(measured) for name in names]
        self._wanted = np.array(wanted, dtype=np.int64)
        self.load()

    def load(self) -> None:
        """Go on from what each body remembers."""
        base, slip, felt = zip(*(body.memory for body in self._bodies), strict=True)
        self._base, self._slip, self._felt = np.array(base), np.array(slip), np.array(felt, dtype=np.bool_)

    def store(self) -> None:
        """Have each body remember it."""
        rows = zip(self._base.tolist(), self._slip.tolist(), self._felt.tolist(), strict=True)
        for body, known in zip(self._bodies, rows, strict=True):
            body.memory = known

    def measure(self, step: Members, position: Floats, orientation: Floats, lifting: bool) -> dict[str, float]:
        """By name, after a step; arguments as of `SimulatedBody.measure`."""
        height = step.gravity / self._weight if self._weight.all() else step.low[:, 2] - self._bottom
        if not lifting:
            self._base = height
        felt = np.asarray(step.wrench[:, self._bodies[0].felt_tools].any(axis=(1, 2)))
        self._slip = np.where(felt & ((step.slip > 0.0) | ~self._felt), step.slip, self._slip)
        self._felt = felt
        grip_force, compression = self._of_grip(step, position, orientation)
        look = PileLook(step, self._height, grip_force, height - self._base, self._slip, compression)
        table = np.stack([_MEASUREMENTS[name](look) for name in self._asked], axis=1)
        return dict(zip(self._names, table.ravel()[self._wanted].tolist(), strict=True))

    def _of_grip(self, step: Members, position: Floats, orientation: Floats) -> tuple[Floats, Floats]:
        """Force of each body on the tools that grip, and compression of the one that they close on."""
        force, compression = np.zeros((2, len(self._bodies)))
        grips = self._program.grips
        first = grips.first
        if first is not None:
            gripping = step.wrench[:, list(first.tools)].any(axis=(1, 2))
            for place in np.flatnonzero(gripping).tolist():
                force[place] = first.force(step.wrench[place], orientation)
            if id(first.body) in self._place:
                compression[self._place[id(first.body)]] = grips.compression(position, orientation)
        return force, compression
