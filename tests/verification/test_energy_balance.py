"""The ledger against each integrator's own dissipation, computed from states and forces: it closes to 1e-6 of the work.

Implicit Euler, M dv = dt (f_contact + f_gravity - f(x_1)), dx = dt v_1, loses exactly

    D = 1/2 |dv|_M^2 + f(x_1) . dx - (U_1 - U_0)                                                                  (1)

in a step, so that dK + dU + dG = W_contact - D but for what the solver leaves: PBD leaves nothing, f being the force
that its blocks carry; Newton's method its tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, tofu
from numpy.typing import NDArray
from pbd_run import PbdRun

from softseam_protocol.messages.participant import Advanced, Reply, Request
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.models import FemSpec
from softseam_services.fem.kernels.elements import subtract_forces
from softseam_services.fem.solver import FemSolver
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd.kernels.block import new_workspace
from softseam_services.pbd.kernels.sweep import block_forces
from softseam_services.pbd.records import PbdState
from softseam_services.pbd.solver import PbdSolver

Floats = NDArray[np.float64]


def energy(reply: Advanced) -> float:
    return reply.kinetic + reply.strain + reply.gravity


def fem_work(solver: FemSolver, moved: Floats) -> float:
    """f(x_1) . dx [J], on the free nodes."""
    model, parameters, x = solver.model, solver.parameters, solver.state.x
    r = np.zeros(3 * (int(model.cell_order.max()) + 1))
    subtract_forces(x, model, parameters, solver.stepper.work, r)
    order = np.full(len(x), -1)
    order[model.cell_nodes] = model.cell_order
    free = order >= 0
    return -float((r.reshape(-1, 3)[order[free]] * moved[free]).sum())


def pbd_work(solver: PbdSolver, state: PbdState, moved: Floats) -> float:
    """f(x_1) . dx [J] with the forces that the blocks carry at the end of a step of one substep."""
    blocks, n = solver.model.blocks, solver.model.n_nodes
    pull, constants = np.zeros((n + 8, 4)), solver.parameters.blocks.constants
    block_forces(new_workspace(), blocks.nodes, state.stress, constants, pull, 0, blocks.n_batches)
    return -float((pull[:n, :3] * moved).sum())


def test_fem_loses_what_implicit_euler_does() -> None:
    """Tofu that sinks onto the ground and is squeezed between plates: contact, friction, large strains."""
    run = FemRun(tofu())
    mass = run.region.mass[:, None]
    worst = done = lost = 0.0
    before: tuple[Advanced, Floats, Floats] | None = None
    for step in range(60):
        x, v = run.x.copy(), run.solver.state.v.copy()
        reply = run.step(CLOSE if step > 10 else None)
        if before is not None:
            moved, jump = run.x - x, run.solver.state.v - v
            loss = (
                0.5 * float((mass * jump * jump).sum())
                + fem_work(run.solver, moved)
                - (reply.strain - before[0].strain)
            )
            done += abs(reply.tool_work) + abs(reply.gravity - before[0].gravity)
            worst = max(worst, abs(reply.tool_work - (energy(reply) - energy(before[0])) - loss))
            lost += loss
            assert loss > -1e-6 * done
        before = reply, x, v
    print(f"work {done:.3g} J, lost {lost:.3g} J, a step is off by at most {worst / done:.1e} of the work")
    assert lost > 1e-3 * done, "something to account for"
    assert worst < 1e-6 * done


def test_pbd_loses_what_implicit_euler_does() -> None:
    """The same, substep by substep, with the forces that the blocks carry at its end."""
    scene = tofu(step=0.0005).model_copy(update={"models": tofu().models})
    scene = scene.model_copy(
        update={"models": scene.models.model_copy(update={"pbd": scene.models.pbd.model_copy(update={"substeps": 1})})}
    )
    run = PbdRun(scene)
    mass = run.region.mass[:, None]
    for name, velocity in CLOSE.items():
        run.velocity[run.tools.names.index(name)] = velocity
    worst = done = lost = 0.0
    last: Advanced | None = None
    for _ in range(150):
        committed = run.committed
        x, v = committed.x.copy(), committed.v.copy()
        reply = run.step()
        assert reply.extras["n_substeps"] == 1
        state = run.committed
        if last is not None:
            jump = state.v - v
            loss = 0.5 * float((mass * jump * jump).sum()) + pbd_work(run.solver, state, state.x - x)
            loss -= reply.strain - last.strain
            done += abs(reply.tool_work) + abs(reply.gravity - last.gravity)
            worst = max(worst, abs(reply.tool_work - (energy(reply) - energy(last)) - loss))
            lost += loss
        last = reply
    print(f"work {done:.3g} J, lost {lost:.3g} J, a step is off by at most {worst / done:.1e} of the work")
    assert lost > 1e-3 * done, "something to account for"
    assert worst < 1e-6 * done


class Watched(EmbeddedTransport):
    """Keeps what the parts answered last; their solvers are at hand."""

    def __init__(self) -> None:
        super().__init__()
        self.last: dict[str, Advanced] = {}

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        replies = super().exchange(requests)
        self.last.update({name: reply for name, reply in replies.items() if isinstance(reply, Advanced)})
        return replies

    def losses(self, before: Mapping[str, tuple[Floats, Floats, Advanced]]) -> dict[str, float]:
        """Eq. (1) of each part over the step that was taken last, from its states and forces [J]."""
        found = {}
        for name, (x, v, reply) in before.items():
            solver, state = self._solver(name), self._solver(name).state
            mass = solver.parameters.mass if isinstance(solver, FemSolver) else solver.parameters.arrays.mass
            moved, jump = state.x - x, state.v - v
            work = fem_work(solver, moved) if isinstance(solver, FemSolver) else pbd_work(solver, state, moved)
            gained = self.last[name].strain - reply.strain
            found[name] = 0.5 * float((mass[:, None] * jump * jump).sum()) + work - gained
        return found

    def stand(self) -> dict[str, tuple[Floats, Floats, Advanced]]:
        """Of each part: positions, velocities, and what it answered last."""
        states = {name: self._solver(name).state for name in self.last}
        return {name: (state.x.copy(), state.v.copy(), self.last[name]) for name, state in states.items()}

    def _solver(self, name: str) -> Any:
        (slot,) = self._servers[name].slots.values()
        return slot.solver


@pytest.mark.parametrize(
    ("tolerance", "step_bound", "sum_bound"),
    [(1e-7, 1e-6, 1e-5), (FemSpec().tolerance, 3e-6, 1e-4)],
    ids=["tight", "default"],
)
def test_the_losses_of_both_models_are_the_remainder_of_the_balance(
    tolerance: float, step_bound: float, sum_bound: float
) -> None:
    """Cut tofu that is squeezed: what each part loses by eq. (1), corrections included, is what the ledger leaves.

    But for what Newton's method leaves, by its tolerance. Bounds are shares of the work done, of a step and in sum.
    """
    near = {"within": 0.006, "tools": ["left", "right"], "split": "always"}
    models = {"fem": {"tolerance": tolerance}, "pbd": {"substeps": 1}}
    scene = tofu(cell=0.0166667, step=0.0005, regions={"near": near}, models=models)
    transport = Watched()
    simulation = Simulation(bundle_scene(scene), transport)
    close = {name: tuple(velocity) for name, velocity in CLOSE.items()}
    worst = done = remainder = own = 0.0
    for step in range(600):
        before = transport.stand() if step else {}
        report = simulation.step(close)
        assert report.interfaces and {reply.extras["n_substeps"] for reply in transport.last.values()} == {1}
        if before:
            losses, left = transport.losses(before), report.energy["dissipation"]
            assert min(losses.values()) > 0.0
            done += abs(report.energy["tool_work"])
            own, remainder = own + sum(losses.values()), remainder + left
            worst = max(worst, abs(left - sum(losses.values())))
    simulation.close()
    off = abs(own - remainder)
    print(f"work {done:.3g} J, lost {own:.3g} J, off by {off / done:.1e} of the work, a step by {worst / done:.1e}")
    assert own > 2e-3 * done, "something to account for"
    assert worst < step_bound * done and off < sum_bound * done


def test_the_ledger_of_both_models_adds_up() -> None:
    """Cut tofu in its grip: what the tools' motion puts in is stored, lost or booked, and friction only takes."""
    scene = tofu(
        cell=0.0166667,
        step=0.01,
        regions={"near": {"within": 0.006, "tools": ["left", "right"], "split": "always"}},
    )
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    first = simulation.step()
    start = {name: first.energy[name] for name in ("kinetic", "strain", "gravity")}
    total = dict.fromkeys(("drive_work", "contact_loss", "seam_work", "dissipation", "switch", "tool_work"), 0.0)
    for _ in range(40):
        report = simulation.step()
        for name in total:
            total[name] += report.energy[name]
    lift = {"left": (0.0, 0.0, 0.02), "right": (0.0, 0.0, 0.02)}
    work = loss = 0.0
    for step in range(60):
        last = simulation.step(lift)
        if step >= 40:  # clear of the ground
            work, loss = work + last.energy["drive_work"], loss + last.energy["contact_loss"]
    simulation.close()
    assert work > 1e-4
    assert abs(loss) < 1e-5 * work, "what sticks loses nothing"
    stored = sum(report.energy[name] - start[name] for name in start)
    gained = total["drive_work"] - total["contact_loss"] + total["seam_work"] + total["switch"] - total["dissipation"]
    assert total["drive_work"] > 1e-3
    assert gained == pytest.approx(stored, abs=1e-6 * total["drive_work"])
    assert 0.0 < total["contact_loss"] < 0.3 * total["drive_work"]
    assert 0.0 < total["dissipation"]
    assert abs(total["seam_work"]) < 1e-3 * total["drive_work"]
