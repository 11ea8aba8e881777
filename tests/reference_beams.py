"""A beam that hangs or swings and a pulse in a bar, problems with known answers, on cells of any size by FEM alone.

Each function returns its quantities by the names of `reference_values`, or errors against a closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from element_statics import Floats
from fem_run import FemRun, block
from reference_values import TIP, Found

from softseam_protocol.messages.participant import Advanced
from softseam_protocol.scene.models import FemSpec


def _beam(n: int, seam: bool, **keys: Any) -> FemRun:
    """Beam of case SWING on 5n x n x n cells; seam: forces may act on its end."""
    integrator = keys.pop("integrator")
    clamp = {"min": (-1e-6, -1.0, -1.0), "max": (1e-6, 1.0, 1.0)}
    body = {"position": (0.05, 0.0, -0.01), "fixed": [clamp]}
    scene = block((0.1, 0.02, 0.02), 0.02 / n, 1e5, keys.pop("poisson", 0.3), 1000.0, body=body, **keys)
    fem = FemSpec(integrator=integrator, tolerance=1e-7)
    scene = scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})})
    if not seam:
        return FemRun(scene)
    return FemRun(scene, seam=lambda body, cells: np.flatnonzero(body.x_rest[:, 0] > 0.1 - 1e-9).astype(np.int32))


def _tip(run: FemRun) -> Callable[[], float]:
    node = int(np.argmin(np.linalg.norm(run.body.x_rest - [0.1, 0.0, 0.0], axis=1)))
    return lambda: float(run.x[node, 2] - run.body.x_rest[node, 2])


def simpson(x: Floats) -> Floats:
    """Shares of a uniform load that the nodes x (n,) of quadratic elements in a row take (n,), sum 1."""
    share = np.zeros(len(x))
    for i in range(0, len(x) - 2, 2):
        share[i : i + 3] += (x[i + 2] - x[i]) * np.array([1.0, 4.0, 1.0]) / 6.0
    return np.asarray(share / (x[-1] - x[0]))


def _uniform(run: FemRun) -> Floats:
    """Shares of a uniform load on the seam's nodes, a rectangle across x (s,)."""
    at = run.body.x_rest[run.region.seam][:, 1:]
    lines = [np.unique(np.round(at[:, axis], 12)) for axis in (0, 1)]
    parts = [simpson(line)[np.searchsorted(line, at[:, axis] - 1e-9)] for axis, line in enumerate(lines)]
    return np.asarray(parts[0] * parts[1])


def hanging(n: int) -> Found:
    """On 5n x n x n cells."""
    found: Found = {}
    for poisson in (0.3, 0.495):
        run = _beam(n, False, integrator="static", poisson=poisson)
        run.step()
        found[f"gravity, nu {poisson}"] = _tip(run)()
    run = _beam(n, True, integrator="static", gravity=(0.0, 0.0, 0.0))
    for load in (0.25, 0.5, 0.75, 1.0):
        run.step(force=np.outer(_uniform(run), [0.0, 0.0, -0.2 * load]))
    return found | {"end force, nu 0.3": _tip(run)()}


def swing(n: int, dt: float = 0.002, duration: float = 0.6) -> Found:
    """On 5n x n x n cells, midpoint: lowest tip of the first swing; largest distance from TIP over its largest."""
    run = _beam(n, False, integrator="midpoint", step=dt)
    tip = _tip(run)
    path = [0.0]
    for _ in range(round(duration / dt)):
        run.step()
        path.append(tip())
    every = round(0.01 / dt)
    seen = np.array(path[::every])
    low = int(np.argmin(path[: round(0.2 / dt)]))
    a, b, c = path[low - 1 : low + 2]
    vertex = low + 0.5 * (a - c) / (a - 2.0 * b + c)
    off = float(np.abs(seen - TIP[: len(seen)]).max() / np.abs(TIP).max())
    return {"lowest": min(path[: round(0.2 / dt)]), "time of it": float(vertex * dt), "farthest off": off}


# ---- a pulse in a bar ------------------------------------------------------------------------------------------

LENGTH, WIDTH, SPEED, IMPEDANCE, PULSE, PRESSURE = 1.0, 0.05, 10.0, 1e4, 0.02, 10.0
"""bar [m], wave speed sqrt(E/rho) [m/s], rho c [Pa s/m], duration of the pulse [s], its peak [Pa]"""
PULSE_ENERGY = 1.875e-7
"""int p^2/Z dt over the section [J]"""
STATIONS = (0.25, 0.5, 0.75)


def _pulse(t: Floats | float) -> Floats:
    t = np.asarray(t, dtype=np.float64)
    return np.asarray(np.where((t > 0.0) & (t < PULSE), PRESSURE * np.sin(np.pi * t / PULSE) ** 2, 0.0))


def velocity_in_bar(x: float, t: Floats, free: bool) -> Floats:
    """d'Alembert, up to the first reflection at x = LENGTH: v = p(t - x/c)/Z -+ p(t - (2 L - x)/c)/Z [m/s]."""
    back = _pulse(t - (2.0 * LENGTH - x) / SPEED)
    return np.asarray(_pulse(t - x / SPEED) + (back if free else -back)) / IMPEDANCE


def bar(n: int, free: bool = True, courant: float = 0.0625, until: float = 0.2) -> Found:
    """On n x 1 x 1 cells, midpoint, steps of `courant` n-ths of the time a wave takes for the bar.

    Returns the largest error of the velocity at STATIONS over its peak, the error of the energy between pulse and
    reflection, and the tail behind the incident pulse at the first station, over the peak.
    """
    dt = courant * LENGTH / n / SPEED
    body: dict[str, Any] = {"position": (LENGTH / 2.0, 0.0, 0.0)}
    if not free:
        body["fixed"] = [{"min": (LENGTH - 1e-6, -1, -1), "max": (LENGTH + 1e-6, 1, 1)}]
    scene = block(
        (LENGTH, WIDTH, WIDTH), (LENGTH / n, WIDTH, WIDTH), 1e5, 0.0, 1000.0, kind="linear", body=body, step=dt,
        gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    fem = FemSpec(integrator="midpoint", tolerance=1e-10)
    scene = scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})})
    run = FemRun(scene, seam=lambda body, cells: np.flatnonzero(body.x_rest[:, 0] < 1e-9).astype(np.int32))
    share = _uniform(run)
    nodes = [int(np.argmin(np.abs(run.body.x_rest - [x, 0.0, WIDTH / 2.0]).sum(axis=1))) for x in STATIONS]
    seen, energy = [], []
    for step in range(round(until / dt)):
        push = float(_pulse((step + 0.5) * dt)) * WIDTH**2
        reply: Advanced = run.step(force=np.outer(share, [push, 0.0, 0.0]))
        seen.append(run.solver.state.v[nodes, 0].copy())
        energy.append(reply.kinetic + reply.strain)
    t = dt * np.arange(1.0, len(seen) + 1.0)
    peak = PRESSURE / IMPEDANCE
    exact = np.stack([velocity_in_bar(x, t, free) for x in STATIONS], axis=1)
    wrong = np.abs(np.array(seen) - exact)
    tail = wrong[(t > STATIONS[0] / SPEED + PULSE) & (t < 0.09), 0]
    return {
        "velocity, largest error": float(wrong.max() / peak),
        "tail": float(tail.max() / peak),
        "energy error": abs(float(np.mean(np.array(energy)[(t > 0.05) & (t < 0.08)])) / PULSE_ENERGY - 1.0),
    }
