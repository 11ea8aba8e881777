"""XPBD and classic PBD on springs: the chapter's exercises, transfer functions, what sweeps do and do not change."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from particle_run import Floats, ParticleRun, particle_scene
from spring import forced_spring, project_once, softness, transfer

from softseam_services.pbd.particles.batches import batches
from softseam_services.pbd.particles.kernels import distance

Ints = NDArray[np.int32]


def test_exercise_9_2() -> None:
    """Masses 2 and 3 kg at 1 and 2.5 m, rest length 1 m: one projection puts them at 1.3 and 2.3 m."""
    x = project_once(np.array([[1.0, 0.0, 0.0], [2.5, 0.0, 0.0]]), np.array([1 / 2, 1 / 3]), 1.0)
    assert x == pytest.approx(np.array([[1.3, 0.0, 0.0], [2.3, 0.0, 0.0]]), abs=1e-15)


@pytest.mark.parametrize("stiffness", [200.0, 1000.0, 20_000.0])
@pytest.mark.parametrize("mass", [0.05, 1.0])
def test_a_forced_spring_answers_as_its_transfer_function_says(stiffness: float, mass: float) -> None:
    """10 Hz at dt = 0.01 s: amplitude and phase to 1e-9 of the exact discrete transfer function.

    XPBD's step is (x_n+1 - 2 x_n + x_n-1) m/h^2 + k x_n+1 = f_n: with z = e^(i w h), H = 1/(k + m (1 - 1/z)^2/h^2).
    """
    h, frequency = 0.01, 10.0
    amplitude, phase = forced_spring(stiffness, mass, h, frequency)
    expected = transfer(stiffness, mass, h, frequency)
    assert amplitude == pytest.approx(abs(expected), rel=1e-9)
    assert phase == pytest.approx(np.angle(expected), abs=1e-9)


def test_the_chapters_answer_to_exercise_9_4_is_not_what_xpbd_does() -> None:
    """It takes k_eff = 1/(alpha + dt^2/m). At rest XPBD shows 1/alpha, whatever the step and the mass."""
    for h in (0.01, 0.001):
        still = transfer(1000.0, 1.0, h, 0.0)
        assert still == pytest.approx(1.0 / 1000.0, rel=1e-12)
        amplitude, _ = forced_spring(1000.0, 1.0, h, 0.5)
        assert amplitude == pytest.approx(1.0 / 1000.0, rel=0.02)
    wrong = 1.0 / (1.0 / 1000.0 + 0.01**2 / 1.0)
    assert wrong < 0.95 * 1000.0


def test_the_step_alone_bounds_what_exercise_9_4_asks_for() -> None:
    """k |H| at w h = t is 1/|1 - r (cos t - i sin t)| with r = 4 m sin(t/2)^2/(h^2 k): at most 1/sin t = 1.70 at r =
    cos t.

    So an amplification of no more than 2 needs no damping and no choice of compliance at 10 Hz and 0.01 s.
    """
    h, frequency, stiffness = 0.01, 10.0, 1000.0
    t = 2.0 * np.pi * frequency * h
    masses = np.geomspace(1e-3, 1e2, 2001)
    gain = np.array([stiffness * abs(transfer(stiffness, mass, h, frequency)) for mass in masses])
    assert gain.max() == pytest.approx(1.0 / np.sin(t), rel=1e-4)
    assert gain.max() == pytest.approx(1.7013, abs=1e-3)
    r = 4.0 * masses[gain.argmax()] * np.sin(0.5 * t) ** 2 / (h * h * stiffness)
    assert r == pytest.approx(np.cos(t), rel=0.01)


def test_xpbd_is_as_stiff_whatever_the_sweeps_and_classic_pbd_is_not() -> None:
    """m g/k = 0.1 kg 10 m/s^2/(10 N/0.1 m) = 10 mm for XPBD. Classic: C = h^2 g (1 - k)^n/(1 - (1 - k)^n)."""
    for sweeps in (1, 4, 16):
        for substeps in (2, 8):
            assert softness(sweeps, substeps, "xpbd") == pytest.approx(0.01, rel=1e-6)
            h, left = 0.01 / substeps, 0.5**sweeps
            assert softness(sweeps, substeps, "pbd") == pytest.approx(10.0 * h**2 * left / (1.0 - left), rel=1e-6)
            assert softness(sweeps, substeps, "pbd", True) == pytest.approx(10.0 * h**2, rel=1e-6)


def chain(n: int) -> tuple[Floats, Floats, Ints, Floats]:
    """A crumpled chain: positions, inverse masses, pairs, rest lengths."""
    rng = np.random.default_rng(3)
    x = np.cumsum(rng.normal(size=(n, 3)), axis=0)
    nodes = np.array([(i, j) for i in range(n) for j in range(i + 1, min(i + 4, n))], dtype=np.int32)
    return x, rng.uniform(0.5, 2.0, n), nodes, rng.uniform(0.5, 1.5, len(nodes))


def swept(order: NDArray[np.int64], colored: bool) -> Floats:
    """One sweep over the chain's constraints, listed in some order."""
    x, w, nodes, rest = chain(40)
    nodes, rest = nodes[order].astype(np.int32), rest[order]
    if colored:
        return sweep_once(x, w, nodes, rest)
    for pair, length in zip(nodes, rest, strict=True):
        x = sweep_once(x, w, pair[None], np.array([length]))
    return x


def sweep_once(x: Floats, w: Floats, nodes: Ints, rest: Floats) -> Floats:
    made = batches(len(x), nodes)
    xw = np.zeros((len(x) + 8, 4))
    xw[: len(x), :3], xw[: len(x), 3] = x, w
    lanes = made.lanes(rest, 1.0)
    inverse, soft = np.zeros(lanes.shape), np.zeros(lanes.shape)
    distance.prepare_distances(xw, made.nodes, np.zeros(lanes.shape), 1.0, 0.0, inverse, soft)
    distance.project_distances(np.zeros(distance.N_WORK), xw, made.nodes, lanes, inverse, soft, np.zeros(lanes.shape))
    return xw[: len(x), :3]


def test_the_order_in_which_constraints_are_listed_does_not_matter() -> None:
    """Bit for bit with batches; taken one after the other as listed, the control, it does matter."""
    m = len(chain(40)[2])
    forth, back = np.arange(m), np.random.default_rng(0).permutation(m)
    assert np.array_equal(swept(forth, True), swept(back, True))
    assert np.abs(swept(forth, False) - swept(back, False)).max() > 1e-2


@pytest.mark.parametrize("method", ["xpbd", "pbd"])
def test_momentum_and_rigid_motion(method: str) -> None:
    """A free sheet, kicked: momentum is kept to rounding; turned and moved as a whole, its motion turns and moves
    along.

    Angular momentum drifts by what implicit Euler loses: less than 2 % while the sheet crumples for 0.1 s.
    """
    body = {
        "kind": "sheet",
        "size": (0.2, 0.2),
        "divisions": (8, 8),
        "density": 0.2,
        "stretch": 100.0,
        "bending": 1e-4,
        "self_contact": False,
    }
    ends = []
    angle, shift = 0.7, np.array([0.3, -0.2, 0.5])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    for moved in (False, True):
        run = ParticleRun(particle_scene(body, step=0.005, pbd={"method": method, "substeps": 10}))
        kick = 0.3 * np.random.default_rng(5).normal(size=run.x.shape)
        run.v[:] = kick + np.cross([0.0, 0.0, 5.0], run.x)
        if moved:
            run.x[:], run.v[:] = run.x @ turn.T + shift, run.v @ turn.T
        mass = run.body.mass[:, None]
        first = (mass * run.v).sum(axis=0)
        spin = (mass * np.cross(run.x - run.x.mean(axis=0), run.v)).sum(axis=0)
        reply = run.run(0.1)
        assert reply.momentum == pytest.approx(first, abs=1e-13)
        centre = mass[:, 0] @ run.x / mass.sum()
        after = (mass * np.cross(run.x - centre, run.v)).sum(axis=0)
        if method == "xpbd":
            assert after == pytest.approx(spin, abs=0.02 * float(np.linalg.norm(spin)))
        ends.append(run.x.copy())
    assert ends[1] == pytest.approx(ends[0] @ turn.T + shift, abs=1e-9)


def test_grips_touches_and_layers_survive_a_snapshot() -> None:
    """A run that was restored in the middle of a fold goes on bit for bit."""
    body = {"kind": "sheet", "size": (0.2, 0.1), "divisions": (20, 10), "density": 0.2, "stretch": 100.0}
    tools = {
        "ground": {"kind": "plane", "friction": 0.5, "point": (0.0, 0.0, -0.004)},
        "hand": {"kind": "sphere", "radius": 0.01, "position": (0.115, 0.0, 0.0)},
    }
    runs = [ParticleRun(particle_scene(body, gravity=(0.0, 0.0, -9.81), tools=tools)) for _ in range(2)]
    for run in runs:
        run.gripping[1] = 1
        run.velocity[1, :3] = -0.4, 0.0, 0.3
    runs[0].run(0.2)
    taken = runs[0].solver.snapshot()
    runs[1].solver.restore(taken)
    runs[1].position, runs[1].orientation = runs[0].position.copy(), runs[0].orientation.copy()
    first, second = (run.run(0.1) for run in runs)
    assert first.extras["held"] > 0
    assert np.array_equal(runs[0].x, runs[1].x)
    assert np.array_equal(first.wrench, second.wrench)
    with pytest.raises(ValueError, match="not a snapshot of a sheet or rope"):
        runs[1].solver.restore(b"nothing")
