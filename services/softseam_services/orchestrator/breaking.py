"""Where a body bears more than its material's strength: it would break, which no law here does yet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.session import Frame
from softseam_services.body import tetrahedron
from softseam_services.body.build import AnyBody
from softseam_services.body.lattice import OCTANT_NODES
from softseam_services.body.recover import von_mises
from softseam_services.orchestrator.step_warnings import Tell

Floats = NDArray[np.float64]

_WHOLE = "softseam has no fracture yet, so it stays whole, and what follows is not to be trusted there"


class Breaking:
    """Watches one body; makes one event, when it first bears more than its strength.

    strength  of each octant, inf where its material says none (C, 8) [Pa]; None: none does
    report    receives the event
    """

    def __init__(self, body: AnyBody, strength: Floats | None, report: Tell) -> None:
        self._body, self._strength, self._report = body, strength, report
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._said = self._strength is None

    def look(self, step: int, time: float, frame: Frame) -> None:
        """After a step, at this time [s], with the body's fields."""
        if self._said:
            return
        assert self._strength is not None  # else it was said
        ratio = von_mises(frame.cauchy) / self._strength
        cell, octant = np.unravel_index(int(ratio.argmax()), ratio.shape)
        if not ratio[cell, octant] > 1.0:
            return
        self._said = True
        assert self._body.has_cells  # others have no octants
        nodes = tetrahedron.CORNERS if self._body.tetrahedra else OCTANT_NODES[octant]
        x, y, z = frame.x[self._body.cell_nodes[cell][nodes]].mean(axis=0)
        much = f"{ratio[cell, octant]:.2g} times the strength of {self._strength[cell, octant]:g} Pa"
        at = f"({x:.4f}, {y:.4f}, {z:.4f}) m at {time:.4g} s"
        self._report("breaks", f"step {step}: would break: stress {much} at {at}; {_WHOLE}")
