"""One spring: a projection, its answer to a sinusoidal force step by step, and the exact discrete transfer function."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from particle_run import ParticleRun, particle_scene

from softseam_services.pbd.particles.batches import batches
from softseam_services.pbd.particles.kernels import distance

Floats = NDArray[np.float64]


class Spring:
    """Two particles and a distance between them, projected by the kernel."""

    def __init__(self, weight: Floats, rest: float, stiffness: float, h: float, share: float = 0.0) -> None:
        self._batches = batches(2, np.array([[0, 1]], dtype=np.int32))
        self.xw = np.zeros((10, 4))
        self.xw[:2, 3] = weight
        self._rest = self._batches.lanes(np.array([rest]), 1.0)
        shape = self._rest.shape
        compliance = np.full(shape, 0.0 if np.isinf(stiffness) else 1.0 / stiffness)
        self._inverse, self._soft, self.lam = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        distance.prepare_distances(self.xw, self._batches.nodes, compliance, h, share, self._inverse, self._soft)
        self._ws = np.zeros(distance.N_WORK)

    def project(self) -> None:
        distance.project_distances(
            self._ws, self.xw, self._batches.nodes, self._rest, self._inverse, self._soft, self.lam
        )


def project_once(x: Floats, weight: Floats, rest: float) -> Floats:
    """Positions (2, 3) after one projection without compliance."""
    spring = Spring(weight, rest, np.inf, 1.0)
    spring.xw[:2, :3] = x
    spring.project()
    return spring.xw[:2, :3].copy()


def transfer(stiffness: float, mass: float, h: float, frequency: float) -> complex:
    """Displacement over force [m/N] of XPBD's single spring at a frequency [Hz]: 1/(k + m (1 - 1/z)^2/h^2), z = e^(i w
    h).

    The force is that of the substep that it acts in, as gravity's is.
    """
    z = np.exp(2j * np.pi * frequency * h)
    return complex(1.0 / (stiffness + mass * (1.0 - 1.0 / z) ** 2 / h**2))


def forced_spring(
    stiffness: float, mass: float, h: float, frequency: float, sweeps: int = 1, share: float = 0.0
) -> tuple[float, float]:
    """Amplitude over force [m/N] and phase [rad] that settle when cos(w t) pulls a mass on a spring along x.

    Every substep is XPBD's: prediction, sweeps from a multiplier of zero, velocity. The answer is the part at the
    frequency over whole periods after the start has died away.
    """
    spring = Spring(np.array([0.0, 1.0 / mass]), 1.0, stiffness, h, share)
    spring.xw[1, 0] = 1.0
    x, v = 1.0, 0.0
    period = round(1.0 / (frequency * h))
    settle = int(np.ceil(60.0 / np.log(max(1.0 + h * h * stiffness / mass, 1.0 + 1e-4))))
    settle = -(-settle // period) * period
    total, n = 0.0 + 0.0j, 20 * period
    for k in range(settle + n):
        angle = 2.0 * np.pi * frequency * h * (k + 1)
        v += h * np.cos(angle) / mass
        spring.xw[1, 0] = x + h * v
        spring.lam[:] = 0.0
        for _ in range(sweeps):
            spring.project()
        v = (spring.xw[1, 0] - x) / h
        x = float(spring.xw[1, 0])
        if k >= settle:
            total += (x - 1.0) * np.exp(-1j * angle)
    answer = 2.0 * total / n
    return float(abs(answer)), float(np.angle(answer))


def softness(sweeps: int, substeps: int, method: str, per_substep: bool = False) -> float:
    """Stretch [m] of a link that bears 0.1 kg at g = 10 m/s^2: k = 100 N/m in XPBD, a stiffness of 0.5 in classic PBD.

    Substeps divide a step of 0.01 s.
    """
    rope = {
        "kind": "rope",
        "length": 0.1,
        "divisions": 1,
        "density": 2.0,
        "stretch": 10.0,
        "rotation": (0.0, np.pi / 2, 0.0),
        "damping": 100.0,
        "fixed": [{"min": (-1.0, -1.0, 0.04), "max": (1.0, 1.0, 1.0)}],
    }
    pbd = {
        "method": method,
        "sweeps": sweeps,
        "substeps": substeps,
        "classic": {"stretch": 0.5, "per_substep": per_substep},
    }
    run = ParticleRun(particle_scene(rope, gravity=(0.0, 0.0, -10.0), pbd=pbd))
    run.run(2.0)
    return float(np.ptp(run.x[:, 2])) - 0.1
