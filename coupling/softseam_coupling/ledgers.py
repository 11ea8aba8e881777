"""Where every joule went in many bodies at once: `ledger` in arrays of b bodies that nothing ties, cuts or switches."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.ledger import Alarm, Energies, EnergyLedger, LedgerState

__all__ = ["Ledgers"]

Floats = NDArray[np.float64]

_LAST, _SCALE, _TOOL_WORK, _DISSIPATION, _CREATED, _CONTACT = slice(0, 3), 3, 4, 6, 9, 10
"""where `LedgerState.to_list` has them"""


class Ledgers:
    """The balances of b bodies.

    states  of each so far; None of those that took no step yet
    """

    def __init__(self, states: Sequence[LedgerState | None], limits: EnergyLedger) -> None:
        self._limits = limits
        self._opened = np.array([state is not None for state in states], dtype=np.bool_)
        nothing = LedgerState(Energies(0.0, 0.0, 0.0)).to_list()
        self._numbers = np.array([nothing if state is None else state.to_list() for state in states])

    @property
    def states(self) -> list[LedgerState | None]:
        """As each stands."""
        return [
            LedgerState.from_list(numbers) if opened else None
            for numbers, opened in zip(self._numbers.tolist(), self._opened.tolist(), strict=True)
        ]

    def step(
        self, energies: Floats, tool_work: Floats, contact_loss: Floats, material: Floats
    ) -> tuple[Floats, dict[Alarm, NDArray[np.bool_]]]:
        """Book a committed step of all, by eq. (1) of `ledger`: what the integrators dissipated (b,) [J], and of which
        bodies each alarm warns (b,); the first step of a body counts for what contact took alone.

        energies  kinetic, strain and gravity (b, 3) [J]; others (b,) [J], as of `EnergyLedger.step`
        """
        numbers, later = self._numbers, self._opened
        total = energies[:, 0] + energies[:, 1] + energies[:, 2]
        last = numbers[:, 0] + numbers[:, 1] + numbers[:, 2]
        dissipation = np.where(later, tool_work - material - (total - last), 0.0)
        numbers[:, _LAST] = energies
        numbers[:, _TOOL_WORK] += np.where(later, tool_work, 0.0)
        numbers[:, _DISSIPATION] += dissipation
        numbers[:, _CREATED] = np.maximum(0.0, numbers[:, _CREATED] - dissipation)
        numbers[:, _CONTACT] += contact_loss
        moving = energies[:, 0] + energies[:, 1]
        largest = np.maximum(np.maximum(numbers[:, _SCALE], moving), np.abs(numbers[:, _TOOL_WORK]))
        numbers[:, _SCALE] = np.where(later, largest, np.maximum(self._limits.floor, moving))
        scale = numbers[:, _SCALE]
        alarms = {
            Alarm.CREATED: later & (numbers[:, _CREATED] > self._limits.created_limit * scale),
            Alarm.CONTACT: later & (-numbers[:, _CONTACT] > self._limits.contact_limit * scale),
        }
        self._opened = np.ones_like(later)
        return dissipation, alarms
