"""Regions that switch while a body moves freely keep its momentum."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pytest

from softseam_protocol.messages.participant import Bundle, Configured, Reply, Request
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.orchestrator.archive import ArchiveError, pack, unpack
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.parts import side_mass
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.transport import ParticipantFailed


def spinning_cube() -> Scene:
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "spin",
            "gravity": [0.0, 0.0, 0.0],
            "step": 0.005,
            "duration": 1.0,
            "body": {
                "shape": {"kind": "block", "size": [0.06, 0.06, 0.06]},
                "cell": 0.02,
                "material": {"young": 20e3, "poisson": 0.4, "density": 1000.0},
                "velocity": [0.1, -0.05, 0.02],
                "spin": [1.0, 2.0, 5.0],
            },
            "regions": {
                "default": "pbd",
                "near": {"model": "fem", "boxes": [{"min": [-1, -1, -1], "max": [-0.01, 1, 1]}]},
            },
            "models": {"fem": {"tolerance": 1e-7}},  # what a solve's rounding adds to P grows with its last correction
            "seam": {"tolerance": 1e-9, "exchanges": 12},
        }
    )


def test_momentum_survives_switches() -> None:
    """Every 20 steps the border moves: P to 1e-12 over the whole run, L to 1e-10 over each switch, relative."""
    scene = spinning_cube()
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    near = simulation.regions.rule.mask.copy()
    assert isinstance(simulation.body, Body)
    grid = simulation.body.cell_grid
    columns = [grid[:, 0] < k for k in (1, 2)] + [grid[:, 1] < 2, np.ones(len(grid), bool), np.zeros(len(grid), bool)]
    first = None
    losses, own = [], []
    before = None
    step = 0
    while not simulation.done:
        report = simulation.step()
        step += 1
        if first is None:
            first = report
        if before is not None:
            own.append(np.linalg.norm(report.angular_momentum - before.angular_momentum))
        before = report
        np.testing.assert_allclose(
            report.momentum, first.momentum, rtol=0, atol=1e-12 * float(np.linalg.norm(first.momentum))
        )
        if step % 20 == 0:
            held = momentum(simulation)
            near = columns[(step // 20) % len(columns)]
            simulation.set_near(near)
            after = momentum(simulation)
            scale = np.linalg.norm(held[1])
            losses.append(np.linalg.norm(after[1] - held[1]) / scale)
            np.testing.assert_allclose(after[0], held[0], rtol=0, atol=1e-12 * float(np.linalg.norm(held[0])))
    assert len(losses) >= 9
    assert max(losses) < 1e-10
    print(f"switches lose at most {max(losses):.1e} of L, a step of the integrators {max(own) / scale:.1e}")
    simulation.close()


def momentum(simulation: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Linear and angular momentum of the body, each side with its own share of the mass."""
    linear, angular = np.zeros(3), np.zeros(3)
    assert isinstance(simulation.body, Body)
    for name, fields in simulation.regions.participants.observe().items():
        mass = side_mass(simulation.body, simulation.regions.parts.cells[name])[fields.nodes]
        p = mass[:, None] * fields.v
        linear += p.sum(axis=0)
        angular += np.cross(fields.x, p).sum(axis=0)
    return linear, angular


def test_saved_state_continues_bit_for_bit() -> None:
    scene = spinning_cube()
    a = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    for _ in range(7):
        a.step()
    state = a.save()
    for _ in range(60):
        a.step()
    b = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    b.load(state)
    for _ in range(60):
        b.step()
    np.testing.assert_array_equal(a.frame().x, b.frame().x)
    np.testing.assert_array_equal(a.frame().multiplier, b.frame().multiplier)
    a.load(state)
    for _ in range(60):
        a.step()
    np.testing.assert_array_equal(a.frame().x, b.frame().x)


@pytest.mark.parametrize(
    "missing",
    [
        "numbers",
        *(f"bodies/body/{name}" for name in ("regions.idle", "regions.cut", "ledger", "begun", "errors")),
        *(f"bodies/body/{name}" for name in ("seam.reported_body.near", "seam.pace", "part.body.far")),
    ],
)
def test_a_state_that_is_not_whole_changes_nothing(missing: str) -> None:
    """Refused by name, and the simulation goes on as if nobody had asked."""
    asked, other = (Simulation(Bundle(spinning_cube().model_dump_json(), {}), EmbeddedTransport()) for _ in range(2))
    for simulation in (asked, other):
        simulation.step()
        state = simulation.save()
    entries = unpack(state)
    del entries[missing]
    with pytest.raises(ArchiveError, match=re.split(r"[./]", missing)[-1]):
        asked.load(pack(entries))
    entries = unpack(state)
    entries["bodies/body/regions.near"] = entries["bodies/body/regions.near"][1:]
    with pytest.raises(ArchiveError, match="cells"):
        asked.load(pack(entries))
    entries = unpack(state)
    entries["schema"] = entries["schema"] - 1
    with pytest.raises(
        ArchiveError, match=r"schema version \d+, .* reads \d+: load it with the softseam that saved it"
    ):
        asked.load(pack(entries))
    del entries["schema"]
    with pytest.raises(ArchiveError, match="schema version 0"):
        asked.load(pack(entries))
    for simulation in (asked, other):
        simulation.step()
    assert asked.time == other.time
    np.testing.assert_array_equal(asked.frame().x, other.frame().x)


def test_the_ledger_books_what_a_switch_does_to_the_strain_energy() -> None:
    """A spinning cube is stretched. Its energy between switches only falls; what models disagree on is the switch's."""
    scene = spinning_cube()
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    everywhere, nowhere = np.ones(simulation.body.n_cells, bool), np.zeros(simulation.body.n_cells, bool)
    energy = simulation.step().energy
    jumps: list[float] = []
    losses: list[float] = []
    for step in range(60):
        switches = step % 10 == 0
        if switches:
            simulation.set_near(everywhere if step % 20 == 0 else nowhere)
        before, energy = energy, simulation.step().energy
        change = sum(energy[name] - before[name] for name in ("kinetic", "strain", "gravity"))
        np.testing.assert_allclose(change, energy["switch"] - energy["dissipation"], atol=1e-12 * energy["kinetic"])
        assert (energy["switch"] != 0.0) == switches
        (jumps if switches else losses).append(energy["switch"] if switches else energy["dissipation"])
    assert np.abs(jumps).max() > 1e-6 * energy["strain"], "hex27 and eight blocks store differently"
    assert min(losses) > -1e-6 * energy["kinetic"], "no energy from nowhere"
    simulation.close()


def test_a_switch_before_the_first_step_tells_how_much_it_changed() -> None:
    """Cells of one block have their mass at their corners, so that a cube of them spins with a tenth more energy."""
    coarse = {"pbd": {"coarse": {"boxes": [{"min": [-1, -1, -1], "max": [1, 1, 1]}]}}}
    scene = Scene.model_validate(spinning_cube().model_dump() | {"models": coarse})
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    everywhere, nowhere = np.ones(simulation.body.n_cells, bool), np.zeros(simulation.body.n_cells, bool)
    changes = [simulation.set_near(near) for near in (nowhere, everywhere, nowhere, everywhere)]
    kinetic = simulation.step().energy["kinetic"]
    assert 0.05 * kinetic < abs(changes[1]) < 0.15 * kinetic
    np.testing.assert_allclose(changes[2:], [-changes[1], changes[1]], atol=1e-12 * kinetic)
    assert 0.2 < changes[0] / changes[2] < 0.5, "a third of the cube was FEM's"
    simulation.close()


def test_a_state_saved_before_the_first_step_has_the_energies_of_its_cut() -> None:
    """What a cut changes is told against the one that was loaded, not the one that was there."""
    coarse = {"pbd": {"coarse": {"boxes": [{"min": [-1, -1, -1], "max": [1, 1, 1]}]}}}
    scene = Scene.model_validate(spinning_cube().model_dump() | {"models": coarse})
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    everywhere, nowhere = np.ones(simulation.body.n_cells, bool), np.zeros(simulation.body.n_cells, bool)
    simulation.set_near(everywhere)
    state = simulation.save()
    change = simulation.set_near(nowhere)
    simulation.load(state)
    assert simulation.set_near(nowhere) == pytest.approx(change, rel=1e-9)
    simulation.close()


def test_the_energies_of_a_cuts_first_step_are_those_of_a_moving_body() -> None:
    """They are estimates where the step is to be settled. Told as from rest, they were 2e-3 and 7e-4 off."""
    scene = spinning_cube().model_dump() | {"seam": {"tolerance": 1e-3}}
    simulation = Simulation(Bundle(Scene.model_validate(scene).model_dump_json(), {}), EmbeddedTransport())
    assert isinstance(simulation.body, Body)
    for near in (simulation.regions.rule.mask, simulation.body.cell_grid[:, 1] < 2):
        simulation.set_near(near)
        told = simulation.step().energy["kinetic"]
        kinetic = 0.0
        for name, fields in simulation.regions.participants.observe().items():
            mass = side_mass(simulation.body, simulation.regions.parts.cells[name])[fields.nodes]
            kinetic += 0.5 * float(mass @ (fields.v**2).sum(axis=1))
        assert told == pytest.approx(kinetic, rel=1e-4)
    simulation.close()


def test_an_older_participant_that_tells_no_energies_is_refused() -> None:
    """Its silence would be taken for a body at rest at the first switch."""

    class Older(EmbeddedTransport):
        def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
            replies = super().exchange(requests)
            for name, reply in replies.items():
                if isinstance(reply, Configured):
                    replies[name] = Configured(reply.header, reply.n_nodes, reply.n_cells, reply.substeps, reply.strain)
            return replies

    with pytest.raises(ParticipantFailed, match="same version of softseam on both sides"):
        Simulation(Bundle(spinning_cube().model_dump_json(), {}), Older())


def vibrating_beam() -> Scene:
    """A beam of 4 cells, clamped at one end and struck: half a second of vibration, ten periods."""
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "struck",
            "gravity": [0.0, 0.0, 0.0],
            "step": 0.0005,
            "duration": 1.0,
            "body": {
                "shape": {"kind": "block", "size": [0.08, 0.02, 0.02]},
                "position": [0.04, 0.0, 0.0],
                "cell": 0.02,
                "material": {"young": 50e3, "poisson": 0.3, "density": 1000.0},
                "velocity": [0.0, 0.0, 0.3],
                "fixed": [{"min": [-0.001, -1, -1], "max": [1e-4, 1, 1]}],
            },
            "regions": {"default": "pbd", "near": {"model": "fem", "boxes": [{"min": [-1] * 3, "max": [0.04, 1, 1]}]}},
            "seam": {"tolerance": 1e-6},
        }
    )


@pytest.mark.slow
def test_a_thousand_switches_of_a_vibrating_body() -> None:
    """The cut changes in every step, at random. The energy stays with that of a body that never switched: within 1 % of
    the start in the end and 2 % on the way, and it never exceeds the start."""
    cuts = [(1, 1, 0, 0), (0, 1, 1, 0), (1, 0, 0, 0), (0, 0, 1, 1), (1, 1, 1, 0), (1, 0, 1, 0), (0,) * 4, (1,) * 4]
    random = np.random.default_rng(1)
    energy = np.empty((2, 1001))
    n_switches, spent = 0, 0.0
    for run, switches in enumerate((False, True)):
        scene = vibrating_beam()
        simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
        for step in range(1001):
            if switches and step:
                simulation.set_near(np.array(cuts[random.integers(len(cuts))], dtype=bool))
                n_switches += 1
            report = simulation.step()
            assert all(np.isfinite(reply.kinetic) for reply in report.parts.values())
            energy[run, step] = report.energy["kinetic"] + report.energy["strain"]
            spent += abs(report.energy["switch"])
        simulation.close()
    drift = (energy[1] - energy[0]) / energy[0, 0]
    print(f"{n_switches} switches: drift {drift[-1]:.2%}, at most {np.abs(drift).max():.2%}; they moved {spent:.2g} J")
    assert n_switches == 1000
    assert abs(drift[-1]) < 0.01
    assert np.abs(drift).max() < 0.02
    assert energy[1].max() <= energy[1, 0]
