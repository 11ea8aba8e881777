"""The ledger balances by construction; its alarms must ring, and only when they should."""

from __future__ import annotations

import numpy as np
import pytest
from analysis.linear_study.integrators import LinearSide
from analysis.linear_study.position_constant import PositionConstant
from analysis.linear_study.split import Scheme, Split, run
from analysis.linear_study.velocity_constant import VelocityConstant
from numpy.testing import assert_allclose

from softseam_coupling.ledger import Alarm, Energies, EnergyLedger, LedgerState


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


def created_by(lost: list[float]) -> list[int]:
    """Steps at which the alarm rings, of steps that lose these shares of the energy, made up for by the tools."""
    ledger, rung = EnergyLedger(), []
    state = ledger.open(Energies(0.0, 1.0, 0.0))
    for step, loss in enumerate(lost):
        state.tool_work = 0.0
        if Alarm.CREATED in ledger.step(state, Energies(0.0, 1.0, 0.0), loss, 0.0, 0.0).alarms:
            rung.append(step)
    return rung


def test_what_steps_lose_and_create_by_turns_is_no_alarm() -> None:
    """However long, and however much more is lost than created; but what grows rings, however slowly."""
    assert created_by([5e-3, -5e-3] * 500) == []
    assert created_by([-5e-3, 5e-3] * 500) == []
    assert created_by([5e-2, *[-1e-4] * 99]) == []
    assert created_by([5e-2, *[-1e-4] * 110])[0] == 101
    assert created_by([-5e-3, 3e-3] * 20)[0] == 6
    assert created_by([-2e-2]) == [0]


@pytest.mark.parametrize(("share", "rings"), [(0.0, False), (0.03, False), (0.07, True), (1.0, True)])
def test_contact_gives_no_more_than_the_tools_put_in(share: float, rings: bool) -> None:
    """Beside a twentieth of the energy, which points lend that give way."""
    ledger = EnergyLedger()
    state = ledger.open(Energies(0.0, 1.0, 0.0))
    entry = ledger.step(state, Energies(0.5, 1.0, 0.0), 0.5, 0.0, 0.0, contact_loss=-1.5 * share)
    assert (Alarm.CONTACT in entry.alarms) == rings
    assert ledger.step(state, Energies(0.5, 1.0, 0.0), 0.0, 0.0, 0.0, contact_loss=0.0).alarms == entry.alarms


def test_cells_that_pass_between_quadratures_are_booked_as_a_switch() -> None:
    ledger = EnergyLedger()
    state = ledger.open(Energies(0.0, 1.0, 0.0))
    entry = ledger.step(state, Energies(0.0, 1.25, 0.0), 0.0, 0.0, 0.0, passing=0.25)
    assert (entry.switch, entry.dissipation, entry.alarms) == (0.25, 0.0, ()) and state.switch == 0.25


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


def test_what_a_material_dissipates_is_none_of_the_integrators() -> None:
    """Half of the work of the tools is stored, a quarter the material dissipates, and an eighth the integrator."""
    ledger = EnergyLedger()
    state = ledger.open(Energies(0.0, 1.0, 0.0))
    entry = ledger.step(state, Energies(0.0, 1.625, 0.0), 1.0, 0.0, 0.0, material=0.25)
    assert_allclose((entry.dissipation, state.dissipation), 0.125)
