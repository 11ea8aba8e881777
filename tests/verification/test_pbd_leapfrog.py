"""Leapfrog on the blocks' forces against what its discrete equations say exactly, and against XPBD's sweeps."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pbd_run import Energy, PbdRun, Vector, block_scene
from test_pbd_dynamics import BODIES

from softseam_protocol.scene.scene import Scene
from softseam_services.pbd.kernels import summary as k
from softseam_services.pbd.stability import EXPLICIT

Floats = NDArray[np.float64]
CLAMPED = ({"min": (-1.0, -1.0, -1.0), "max": (-0.0249, 1.0, 1.0)},)


def scene_of(step: float = 0.005, substeps: int | str = "auto", **other: object) -> Scene:
    """A block of 2 x 1 x 1 cells, clamped at one end."""
    pbd = {"method": "leapfrog", "substeps": substeps}
    arguments: dict[str, object] = {"kind": "linear", "poisson": 0.3, "fixed": CLAMPED, "pbd": pbd, **other}
    size, cell = arguments.pop("size", (0.05, 0.025, 0.025)), arguments.pop("cell", 0.025)
    return block_scene(size, cell, step=step, **arguments)  # type: ignore[arg-type]


def kicked(scene: Scene, share: float = 0.05) -> PbdRun:
    """From random velocities of `share` of the P wave's."""
    body = PbdRun(scene).body
    kick = np.random.default_rng(1).standard_normal(body.x_rest.shape) * share * body.material.wave_speed
    return PbdRun(scene, v=kick)


def modes(run: PbdRun) -> tuple[Floats, Floats]:
    """Eigenfrequencies [rad/s], ascending, and modes (n, 3) of the blocks, by differences of their forces, dense."""
    energy, rest, h = Energy(run), run.body.x_rest[run.region.nodes], 1e-7
    columns = []
    for i in range(rest.size):
        x, y = rest.copy(), rest.copy()
        x.flat[i] += h
        y.flat[i] -= h
        columns.append((energy.force(y) - energy.force(x)).ravel() / (2.0 * h))
    root = np.sqrt(np.repeat(run.solver.parameters.arrays.inverse_mass, 3))
    values, vectors = np.linalg.eigh(root[:, None] * 0.5 * (np.array(columns) + np.array(columns).T) * root)
    return np.sqrt(np.abs(values)), (root[:, None] * vectors).T.reshape(-1, *rest.shape)


@pytest.mark.parametrize("reach", [0.5, 1.5, 1.95])
def test_the_discrete_energy_is_kept_to_rounding(reach: float) -> None:
    """E - h^2/8 f^T M^-1 f of linear blocks over 2000 substeps, though E itself goes up and down near the limit."""
    highest = PbdRun(scene_of()).solver.parameters.frequency / 1.03
    run = kicked(scene_of(step=20 * reach / highest, substeps=20))
    kept, plain = [], []
    for _ in range(100):
        reply = run.step()
        state, mass = run.committed, run.region.mass[:, None]
        h = run.scene.step / 20
        plain.append(reply.kinetic + reply.strain)
        kept.append(plain[-1] - h * h / 8.0 * float((mass * state.a**2).sum()))
        assert not reply.alarms
    np.testing.assert_allclose(kept, kept[0], rtol=1e-12)
    assert np.ptp(plain) > (1e-3 if reach < 1.0 else 0.01) * plain[0]


@pytest.mark.parametrize("which", [0, 5, -1])
def test_modes_swing_as_the_discrete_dispersion_says(which: int) -> None:
    """sin(omega' h/2) = omega h/2 at omega_max h = 1.8, for a slow, a middling and the fastest mode."""
    plan = PbdRun(scene_of())
    frequencies, shapes = modes(plan)
    free = frequencies > 1e-3 * frequencies[-1]
    omega, mode = frequencies[free][which], shapes[free][which]
    h = 1.8 / frequencies[-1]
    amplitude = 1e-4 / np.abs(mode).max()
    run = PbdRun(scene_of(step=h, substeps=1), x=plan.body.x_rest + amplitude * mode)
    q = []
    for _ in range(60):
        run.step()
        moved = run.solver.positions - plan.body.x_rest
        q.append(float((run.region.mass[:, None] * mode * moved).sum()) / amplitude)
    discrete = 2.0 / h * np.arcsin(0.5 * omega * h)
    np.testing.assert_allclose(q, np.cos(discrete * h * np.arange(1, 61)), atol=1e-5)


def test_it_is_stable_up_to_two_and_not_beyond() -> None:
    """omega_max h = 1.999 stays where it is, 2.01 grows: the limit is where the theory has it."""
    plan = PbdRun(scene_of())
    highest = modes(plan)[0][-1]
    energy = []
    for reach in (1.999, 2.01):
        run = kicked(scene_of(step=reach / highest, substeps=2), share=1e-4)
        request = run.request()
        run.scratch.planned = 1  # fewer than are allowed
        for _ in range(400):
            run.attempt(request)
            run.solver.commit()
        energy.append(run.figures[k.KINETIC])
    assert energy[1] > 1e6 * energy[0]


def test_a_substep_that_becomes_too_long_is_halved_and_told() -> None:
    """A block squeezed to 0.6 swings faster than at rest: the monitor sees it in the first step, and says so."""
    plan = PbdRun(scene_of(kind="neo_hookean"))
    step = 20 * 1.9 / (plan.solver.parameters.frequency / 1.03)
    x = plan.body.x_rest * np.array([0.6, 1.0, 1.0])
    run = PbdRun(scene_of(step=step, substeps=20, kind="neo_hookean", fixed=()), x=x)
    start = run.solver.strain
    replies = run.run(40 * step)
    said = "; ".join(replies[0].alarms.values())
    assert "repeated with 40 substeps" in said and "sweeps" not in said
    assert all(0.85 * start < reply.kinetic + reply.strain < 1.05 * start for reply in replies)


def test_substeps_beyond_the_limit_are_refused_with_the_least() -> None:
    least = int(np.ceil(0.005 * PbdRun(scene_of()).solver.parameters.frequency / 1.03 / 2.0))
    with pytest.raises(ValueError, match=f"unstable with {least - 1} substeps in 0.005 s, the least is {least}"):
        PbdRun(scene_of(substeps=least - 1))
    assert PbdRun(scene_of(substeps=least)).solver.substeps == least


@pytest.mark.parametrize("kind", ["neo_hookean", "linear", "st_venant_kirchhoff"])
@pytest.mark.parametrize("body", BODIES)
def test_planned_substeps_are_stable(body: tuple[Vector, float | Vector, float, bool], kind: str) -> None:
    """3000 undamped substeps from random kicks, as XPBD's: none is retried, and the energy stays within its swing."""
    size, cell, poisson, clamped = body
    fixed = [{"min": (-1, -1, -1), "max": (-size[0] / 2, 1, 1)}] if clamped else []
    law = {"poisson": poisson, "fixed": fixed, "kind": kind, "pbd": {"method": "leapfrog"}}
    plan = PbdRun(block_scene(size, cell, **law))  # type: ignore[arg-type]
    step = 50 * EXPLICIT / plan.solver.parameters.frequency
    run = kicked(block_scene(size, cell, step=step, **law))  # type: ignore[arg-type]
    replies = [run.step() for _ in range(60)]
    energy = np.array([reply.kinetic + reply.strain for reply in replies])
    assert not any(reply.alarms for reply in replies)
    assert run.solver.substeps == 50
    assert energy.max() < 1.1 * energy[:10].mean()


def swung(method: str, times: int, sweeps: int = 1) -> Floats:
    """Positions 20 ms after a stretch and a bend of a neo-Hookean block let go, with `times` as many substeps."""
    pbd = {"method": method, "substeps": 16 * times, "sweeps": sweeps}
    scene = scene_of(step=0.004, kind="neo_hookean", pbd=pbd)
    rest = PbdRun(scene).body.x_rest
    along = rest[:, 0] - rest[:, 0].min()
    x = rest + np.stack([0.1 * along, 0.0 * along, 4.0 * along**2], axis=1)
    run = PbdRun(scene, x=x)
    for _ in range(5):
        reply = run.step()
    assert not reply.alarms
    return run.x


def test_it_is_of_second_order_and_where_sweeps_end_up() -> None:
    """Against itself at 1/32 of the substep: order 2. XPBD with four sweeps comes to the same motion, with order 1."""
    exact = swung("leapfrog", 32)
    times = np.array([1, 2, 4])
    own = [np.abs(swung("leapfrog", int(t)) - exact).max() for t in times]
    theirs = [np.abs(swung("xpbd", int(t), sweeps=4) - exact).max() for t in 8 * times]
    assert np.polyfit(np.log(times), np.log(own), 1)[0] == pytest.approx(-2.0, abs=0.2)
    assert np.polyfit(np.log(times), np.log(theirs), 1)[0] == pytest.approx(-1.0, abs=0.2)
    assert theirs[-1] < 0.03 * np.abs(exact - swung("xpbd", 1)).max() + 1e-4


def test_free_flight_keeps_momentum_and_spin_exactly() -> None:
    """Leapfrog of forces that are gradients of an objective energy keeps both; a sweep keeps spin to its order."""
    scene = scene_of(kind="neo_hookean", fixed=(), body={"velocity": (0.3, 0.0, 0.1), "spin": (0.0, 20.0, 5.0)})
    run = PbdRun(scene)
    first, last = run.step(), run.run(0.25)[-1]
    np.testing.assert_allclose(last.momentum, first.momentum, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(last.angular_momentum, first.angular_momentum, rtol=1e-10, atol=1e-13)
    drop = PbdRun(scene_of(fixed=(), gravity=(0.0, 0.0, -9.81)))
    last = drop.run(0.1)[-1]
    mass = drop.region.mass.sum()
    np.testing.assert_allclose([last.gravity, last.kinetic], [-mass * 9.81**2 / 200, mass * 9.81**2 / 200], rtol=1e-9)


def test_what_it_cannot_meet_is_refused_by_name() -> None:
    ground = {"ground": {"kind": "plane", "point": (0.0, 0.0, -0.1)}}
    with pytest.raises(ValueError, match="cannot meet tools: use xpbd"):
        scene_of(tools=ground)
    near = {"near": {"model": "fem", "boxes": [{"min": (-1, -1, -1), "max": (0, 1, 1)}]}, "default": "pbd"}
    with pytest.raises(ValueError, match="cannot meet a seam: use xpbd"):
        Scene.model_validate({**scene_of().model_dump(), "regions": near})
    with pytest.raises(ValueError, match="sweeps nothing: leave out sweeps"):
        scene_of(pbd={"method": "leapfrog", "sweeps": 2})


def test_a_snapshot_goes_on_with_the_same_bits() -> None:
    run = kicked(scene_of(kind="neo_hookean"))
    run.run(0.02)
    taken = run.solver.snapshot()
    run.run(0.02)
    end = run.solver.snapshot()
    run.solver.restore(taken)
    run.run(0.02)
    assert run.solver.snapshot() == end
