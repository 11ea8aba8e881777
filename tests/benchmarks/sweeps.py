"""What four kinds of sweeps leave of the residual of hanging ropes and sheets: a table of docs/results/particles.md.

By hand: PYTHONPATH=tests python tests/benchmarks/sweeps.py. Without times: the others cost what Gauss-Seidel does, or
more.
"""

from __future__ import annotations

import numpy as np
from particle_run import G, ParticleRun, particle_scene
from spring_sweeps import SpringSweeps

from softseam_services.body.particles import ParticleBody

SWEEPS = (4, 16, 64)
STEP = 0.01
"""[s]"""


def hanging(kind: str, divisions: int) -> ParticleBody:
    """A rope or sheet of 1 kN or 1 kN/m that hangs by its upper end; 0.3 kg/m or kg/m^2."""
    own = {"length": 1.0, "divisions": divisions, "rotation": (0.0, np.pi / 2, 0.0)}
    if kind == "sheet":
        own = {"size": (1.0, 1.0), "divisions": (divisions, divisions), "rotation": (np.pi / 2, 0.0, 0.0)}
    top = {"min": (-1.0, -1.0, 0.4999), "max": (1.0, 1.0, 1.0)}
    return ParticleRun(particle_scene({"kind": kind, "density": 0.3, "stretch": 1e3, "fixed": [top], **own})).body


def main() -> None:
    print("| | substeps | Jacobi's radius | omega |", " | ".join(f"{n} sweeps" for n in SWEEPS), "|")
    print("|---" * (4 + len(SWEEPS)) + "|")
    for kind, divisions in (("rope", 40), ("rope", 160), ("sheet", 10), ("sheet", 40)):
        body = hanging(kind, divisions)
        for substeps in (8, 1):
            h, kept = STEP / substeps, []
            for n in SWEEPS:
                left = [
                    SpringSweeps(body, h, G).after(way, n) for way in ("gauss_seidel", "sor", "jacobi", "chebyshev")
                ]
                kept.append(", ".join(f"{value:.2g}" if value < 10.0 else "grows" for value in left))
            found = SpringSweeps(body, h, G).spectrum
            omega = "1.3" if found.omega is None else f"{found.omega:.3g}"
            print(f"| {kind}, {divisions} | {substeps} | {found.jacobi:.4g} | {omega} |", " | ".join(kept), "|")


if __name__ == "__main__":
    main()
