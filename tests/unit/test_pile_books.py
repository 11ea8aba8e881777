"""What is booked of many bodies at once is what is booked of each alone, to the bit."""

from __future__ import annotations

import numpy as np
import pytest
from cubes import cube, scene_of
from hypothesis import given, settings
from hypothesis import strategies as st

from softseam_coupling.ledger import Energies, EnergyLedger, LedgerState
from softseam_coupling.ledgers import Ledgers
from softseam_protocol.participant.state import join_states, split_states
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.interfaces import ContactSpec, InterfaceSpec
from softseam_services.orchestrator.pile import piles_of
from softseam_services.orchestrator.step_losses import StepLosses
from softseam_services.server import Setup, build_setup


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31))
def test_ledgers_of_many_are_those_of_each(seed: int) -> None:
    """Random steps of three bodies, of which one begins later; sums, dissipation and alarms."""
    random = np.random.default_rng(seed)
    ledger = EnergyLedger()
    states: list[LedgerState | None] = [None, None, ledger.open(Energies(0.1, 0.2, 0.0))]
    many = Ledgers([None if state is None else LedgerState.from_list(state.to_list()) for state in states], ledger)
    for _ in range(6):
        energies = random.normal(size=(3, 3)) ** 2
        work, loss, material = random.normal(size=(3, 3))
        dissipation, alarms = many.step(energies, work, loss, material)
        for place, state in enumerate(states):
            own = Energies(*energies[place].tolist())
            if state is None:
                states[place] = ledger.open(own, float(loss[place]))
                assert dissipation[place] == 0.0 and not any(raised[place] for raised in alarms.values())
                continue
            given_ = float(work[place]), 0.0, 0.0, 0.0, float(loss[place]), 0.0, float(material[place])
            entry = ledger.step(state, own, *given_)
            assert entry.dissipation == dissipation[place]
            assert set(entry.alarms) == {alarm for alarm, raised in alarms.items() if raised[place]}
        assert many.states == states


@pytest.fixture(scope="module")
def setups() -> dict[str, Setup]:
    bodies = {f"cube{at}": cube(at, 3) for at in range(6)}
    bodies["cube1"]["regions"] = {"default": "fem"}
    bodies["cube2"]["regions"] = {"default": "pbd", "near": {"within": 0.01, "model": "fem"}}
    bodies["cube5"] = {"kind": "rope", "length": 0.1, "divisions": 4, "density": 0.01, "stretch": 10.0, "bending": 1e-6}
    bodies["cube5"]["position"] = [0.0, 0.3, 0.1]
    bundle = bundle_scene(scene_of(bodies))
    return {name: build_setup(bundle, name) for name in bodies}


@pytest.mark.kernels
def test_whole_bodies_of_a_model_that_piles_are_in_a_pile(setups: dict[str, Setup]) -> None:
    """Not those of FEM, of a near region, of particles, on ladders; and one alone is no pile."""
    assert piles_of(setups, {}, ()) == {"pbd": (("cube0", "cube3", "cube4"), ())}
    assert piles_of(setups, {}, ("cube3",)) == {"pbd": (("cube0", "cube4"), ())}
    assert piles_of(setups, {}, ("cube3", "cube4")) == {}


@pytest.mark.kernels
def test_bodies_that_touch_are_in_a_pile_and_those_that_interfaces_join_are_not(setups: dict[str, Setup]) -> None:
    """What touches a body that something joins to another is not in the pile, either."""
    touch = ContactSpec(between=("cube0", "cube3"))
    assert piles_of(setups, {"touch": touch}, ()) == {"pbd": (("cube0", "cube3", "cube4"), ())}
    other = InterfaceSpec(kind="pad", between=("cube3", "cube1"))
    assert piles_of(setups, {"touch": touch, "pad": other}, ()) == {}


@pytest.mark.kernels
def test_a_body_of_fem_that_touches_a_pile_is_its_guest(setups: dict[str, Setup]) -> None:
    """Beside one body, too; where something else joins it, nobody hosts it, nor takes whom it touches."""
    of_fem = ContactSpec(between=("cube1", "cube3"))
    assert piles_of(setups, {"touch": of_fem}, ()) == {"pbd": (("cube0", "cube3", "cube4"), ("cube1",))}
    assert piles_of(setups, {"touch": of_fem}, ("cube0", "cube4")) == {"pbd": (("cube3",), ("cube1",))}
    pad = InterfaceSpec(kind="pad", between=("cube0", "cube1"))
    assert piles_of(setups, {"touch": of_fem, "pad": pad}, ()) == {}


@pytest.mark.kernels
def test_losses_of_many_are_those_of_each(setups: dict[str, Setup]) -> None:
    """Bodies that hit, bounce and lose at random."""
    random = np.random.default_rng(3)
    of = [setups[name] for name in ("cube0", "cube3", "cube4")]
    each, many, said = [StepLosses([setup]) for setup in of], StepLosses(of), 0
    for _ in range(200):
        kinetic, strain, lost = 10.0 * random.random((3, 3)) ** 4
        touches = random.random(3) < 0.5
        work = np.where(random.random(3) < 0.9, 0.0, 1.0)
        step = np.stack((kinetic, strain, lost, work))
        said_of = many.follow(step, touches)
        for place, one in enumerate(each):
            own = slice(place, place + 1)
            alone = one.follow(np.ascontiguousarray(step[:, own]), touches[own])
            assert alone.get(0, "") == said_of.get(place, "")
        said += len(said_of)
    assert said > 2 and np.array_equal(many.state, np.concatenate([one.state for one in each], axis=1))
    assert [one.said() for one in each] == [many.said(place) for place in range(3)]


def test_a_snapshot_of_a_pile_that_ends_early_is_refused() -> None:
    whole = join_states([b"one", b"", b"three"])
    assert split_states(whole) == [b"one", b"", b"three"]
    with pytest.raises(ValueError, match="ends too early"):
        split_states(whole[:-1])
