"""The condition number of XPBD's springs, and Jacobi's radius: closed forms, a dense matrix built spring by spring."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from particle_run import ParticleRun, particle_scene

from softseam_services.body.particles import ParticleBody
from softseam_services.pbd.particles.condition import spring_spectrum

CLAMP = {"min": (-1.0, -1.0, -1.0), "max": (-0.49, 1.0, 1.0)}


def rope(divisions: int, stretch: float = 50.0, **other: Any) -> ParticleBody:
    spec = {"kind": "rope", "length": 1.0, "divisions": divisions, "density": 0.3, "stretch": stretch, **other}
    return ParticleRun(particle_scene(spec)).body


@pytest.mark.parametrize("substep", [1e-4, 1e-2, 1.0])
def test_two_springs_have_a_closed_form(substep: float) -> None:
    """A = [[d, -w], [-w, d]] with d = w' + w + alpha/h^2, w of the middle, w' of the ends: (d + w)/(d - w)."""
    body = rope(2)
    end, middle = 1.0 / body.mass[:2]
    d = end + middle + 1.0 / (body.springs.stiffness[0] * substep**2)
    assert spring_spectrum(body, substep).condition == pytest.approx((d + middle) / (d - middle), rel=1e-12)


def test_it_grows_with_the_square_of_a_stiff_rope_s_spacings() -> None:
    """The least eigenvalue of -1, 2, -1 on n springs falls as 1/n^2: twice as many, four times the number."""
    few, many = (spring_spectrum(rope(n, stretch=1e12, fixed=(CLAMP,)), 0.01).condition for n in (50, 100))
    assert many / few == pytest.approx(4.0, rel=0.03)


@pytest.mark.parametrize("substep", [1e-3, 1e-2])
def test_a_sheet_against_a_dense_matrix(substep: float) -> None:
    """More springs than particles have directions, and clamped ones."""
    spec = {"kind": "sheet", "size": (0.2, 0.2), "divisions": (6, 6), "density": 0.2, "stretch": 100.0}
    body = ParticleRun(particle_scene({**spec, "fixed": ({"min": (-1, -1, -1), "max": (-0.09, 1, 1)},)})).body
    weight = np.where(body.fixed, 0.0, 1.0 / body.mass)
    gradients = np.zeros((len(body.springs.rest), body.n_nodes, 3))
    for row, (i, j) in enumerate(body.springs.nodes):
        along = body.x_rest[j] - body.x_rest[i]
        gradients[row, i], gradients[row, j] = -along / np.linalg.norm(along), along / np.linalg.norm(along)
    A = np.einsum("anc,n,bnc->ab", gradients, weight, gradients)
    A += np.diag(1.0 / (body.springs.stiffness * substep**2))
    scale = np.diag(A) ** -0.5
    values = np.linalg.eigvalsh(scale[:, None] * A * scale)
    found = spring_spectrum(body, substep)
    assert found.condition == pytest.approx(values[-1] / values[0], rel=1e-5)
    iteration = np.linalg.eigvals(np.eye(len(A)) - A / np.diag(A)[:, None])
    assert found.jacobi == pytest.approx(np.abs(iteration).max(), rel=1e-5)
    assert (found.omega is None) == (substep == 1e-2)


def test_short_substeps_leave_each_spring_alone() -> None:
    """The chapter's claim (9.4.4): compliance and step bound it; as h goes to 0 it goes to 1."""
    body = rope(60, stretch=5e3)
    numbers = [spring_spectrum(body, h).condition for h in (1e-2, 1e-3, 1e-4, 1e-6)]
    assert numbers == sorted(numbers, reverse=True) and numbers[-1] == pytest.approx(1.0, abs=0.01)
