"""The ledger balances by construction; its alarms must ring, and only when they should."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from softseam_coupling.ledger import Alarm, Energies, EnergyLedger, LedgerState
from softseam_coupling.linear_study.integrators import LinearSide
from softseam_coupling.linear_study.position_constant import PositionConstant
from softseam_coupling.linear_study.split import Scheme, Split, run
from softseam_coupling.linear_study.velocity_constant import VelocityConstant


def test_balance_of_a_step() -> None:
    ledger = EnergyLedger()
    state = ledger.open(Energies(1.0, 2.0, 3.0))
    entry = ledger.step(state, Energies(1.5, 2.25, 2.75), tool_work=0.75, seam_work_near=0.2, seam_work_far=-0.2)
    assert (entry.kinetic, entry.strain, entry.gravity) == (0.5, 0.25, -0.25)
    left = entry.kinetic + entry.strain + entry.gravity
    assert_allclose(left, entry.tool_work + entry.seam_work - entry.dissipation + entry.switch, atol=1e-15)
    assert_allclose(entry.dissipation, 0.25)
    assert entry.alarms == ()


def test_a_switch_is_booked_once_and_does_not_count_as_dissipation() -> None:
    ledger = EnergyLedger()
    state = ledger.open(Energies(1.0, 0.0, 0.0))
    assert_allclose(ledger.switched(state, Energies(0.9, 0.0, 0.0)), -0.1)
    entry = ledger.step(state, Energies(0.9, 0.0, 0.0), 0.0, 0.0, 0.0)
    assert_allclose(entry.switch, -0.1)
    assert_allclose(entry.dissipation, 0.0)
    assert Alarm.SWITCH in entry.alarms
    assert ledger.step(state, Energies(0.9, 0.0, 0.0), 0.0, 0.0, 0.0).alarms == ()
    assert_allclose(state.switch, -0.1)


def test_the_gap_that_a_switch_leaves_is_closed_at_the_cost_of_the_switch() -> None:
    """What the seam does in the first step after it counts as the switch, and not as work of the seam."""
    for work, rung in ((0.002, ()), (0.02, (Alarm.SWITCH,))):
        ledger = EnergyLedger()
        state = ledger.open(Energies(1.0, 0.0, 0.0))
        ledger.switched(state, Energies(1.001, 0.0, 0.0))
        assert ledger.step(state, Energies(1.001, 0.0, 0.0), 0.0, work, 0.0).alarms == rung
        assert ledger.step(state, Energies(1.001, 0.0, 0.0), 0.0, 0.002, 0.0).alarms == (Alarm.SEAM_WORK,)


def test_state_survives_a_checkpoint() -> None:
    ledger = EnergyLedger()
    state = ledger.open(Energies(1.0, 2.0, 3.0))
    ledger.step(state, Energies(1.0, 1.0, 3.0), 0.25, 0.0, 0.0)
    assert LedgerState.from_list(state.to_list()) == state
    with pytest.raises(ValueError, match="not enough"):
        LedgerState.from_list(state.to_list()[:-1])


def alarms(scheme: Scheme, integrator: str) -> set[Alarm]:
    """Alarms over four periods of an oscillator split in two, far side substepped tenfold."""
    k, one = 4.0 * np.pi**2, np.eye(1)
    split = Split(
        LinearSide(0.5 * one, 0.2 * k * one, one), LinearSide(0.5 * one, 0.8 * k * one, -one), 0.02, integrator,
        integrator, 10,
    )  # fmt: skip
    start = split.init(np.ones(1), np.zeros(1), np.ones(1), np.zeros(1), np.array([-0.3 * k]))
    ledger = EnergyLedger()
    state, last = ledger.open(Energies(0.0, split.energy(start), 0.0)), 0.0
    rung: set[Alarm] = set()
    for each in run(scheme, split, start, 200)[1:]:
        entry = ledger.step(state, Energies(0.0, split.energy(each), 0.0), 0.0, float(each.work) - last, 0.0)
        last = float(each.work)
        rung.update(entry.alarms)
    return rung


def test_alarms_ring_for_the_failing_schemes_only() -> None:
    assert alarms(PositionConstant(), "implicit_euler") == set()
    assert Alarm.SEAM_WORK in alarms(VelocityConstant(), "implicit_euler")
    assert Alarm.SEAM_WORK in alarms(PositionConstant(), "newmark")
