"""The default: what ties the sides of a body takes its steps by `softseam_coupling.loops.one_way`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interface import Interface
from softseam_coupling.loops.one_way import Correct, OneWay, StepDiverged, StepRefused
from softseam_protocol.messages.participant import Capabilities
from softseam_services.orchestrator.pace import Pace
from softseam_services.orchestrator.seam_answers import (
    Ask,
    SeamDiverged,
    SeamSolution,
    SeamUnsettled,
    SideRequest,
)

Floats = NDArray[np.float64]


class OneWaySeam:
    """Ties the sides for one epoch; a `SeamScheme`.

    interface        between the sides
    mobility         1/mass of the seam's nodes on each side (s,) [1/kg]
    tolerance, cell  largest gap, and the edge of the smallest cell [m]
    first            multiplier that belongs to the sides' state (s, 3) [N], zero if absent
    most             exchanges a step
    """

    def __init__(
        self,
        interface: Interface,
        mobility: Mapping[str, Floats],
        tolerance: float,
        cell: float,
        first: Floats | None,
        most: int,
    ) -> None:
        self._interface, self._mobility = interface, mobility
        self._tolerance, self._cell, self._most = tolerance, cell, most
        self._first = np.zeros((interface.n_rows, 3)) if first is None else first
        self._saved: dict[str, Floats] | None = None
        self._loop: OneWay | None = None
        self.pace = Pace()

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        """The sides are configured, and can do so much."""
        loop = OneWay([self._interface], self._mobility, capabilities, self._tolerance, self._cell, self._first)
        if self._saved is not None:
            loop.take(self._saved)
        self._loop = loop

    def multiplier(self) -> Floats:
        """The last committed one (s, 3) [N]."""
        return self._first if self._loop is None else self._loop.multipliers()

    def solve(self, ask: Ask, correct: Correct, dt: float, may_cut: bool = False) -> SeamSolution:
        """Take a step of length dt [s]. Raises SeamDiverged, and where the step may be cut also SeamUnsettled."""
        assert self._loop is not None
        try:
            outcome = self._loop.solve(
                lambda wanted: ask(
                    {
                        name: SideRequest(
                            one.force, one.renew, one.target, one.impedance, fields=False, repeat=one.repeat
                        )
                        for name, one in wanted.items()
                    }
                ),
                correct,
                dt,
                self._most,
                may_cut,
            )
        except StepDiverged as error:
            raise SeamDiverged(str(error)) from error
        except StepRefused as error:
            raise SeamUnsettled(error.exchanges) from error
        note = "" if outcome.agreed else "the sides' exchanges did not converge"
        return SeamSolution(outcome.replies, outcome.multipliers, outcome.gap, outcome.exchanges, note)

    def forget_told(self) -> None:
        """The sides were restored or took a snapshot."""
        if self._loop is not None:
            self._loop.forget_told()

    def to_arrays(self) -> dict[str, Floats]:
        """Everything that evolves, for a snapshot."""
        pace = np.array(self.pace.to_list(), dtype=np.float64)
        arrays = self._saved or {} if self._loop is None else self._loop.to_arrays()
        return arrays | {"pace": pace, "first": self._first}

    def take(self, arrays: dict[str, Floats]) -> None:
        """Continue from `to_arrays`, once the sides are configured. Raises KeyError where something is missing."""
        self.pace.take(arrays["pace"].tolist())
        self._first = np.array(arrays["first"]).reshape(self._first.shape)
        names = [f"{kind}_{part}" for kind in ("trust", "compliance", "told") for part in self._mobility]
        predictions = [f"{what}_{key}" for what in ("multipliers", "target") for key in ("kept", "numbers")]
        self._saved, self._loop = {key: arrays[key] for key in (*names, *predictions, "impedance", "dt")}, None
