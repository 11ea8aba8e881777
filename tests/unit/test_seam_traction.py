"""The traction jump across a face: nothing where the stress goes on, its size where it jumps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.traction import face_normals, face_tractions, traction_jump

Floats = NDArray[np.float64]
OCTANTS = np.array([(o & 1, o >> 1 & 1, o >> 2 & 1) for o in range(8)]) - 0.5


def stress(x: Floats) -> Floats:
    """A linear field (..., 6) at x (..., 3)."""
    rng = np.random.default_rng(3)
    return np.asarray(rng.normal(size=6) + x @ rng.normal(size=(3, 6)))


def test_a_linear_stress_does_not_jump_whatever_the_samples() -> None:
    """Cells at the origin and beyond each of its faces, one sampled at Gauss points, one at the octants' middles."""
    normal = np.array([[0.6, 0.0, 0.8]])
    for face in range(6):
        beyond = np.zeros(3)
        beyond[face // 2] = 2 * (face % 2) - 1
        here = face_tractions(stress(OCTANTS / np.sqrt(3.0))[None], face, 1.0 / np.sqrt(3.0), normal)
        there = face_tractions(stress(beyond + 0.5 * OCTANTS)[None], face ^ 1, 0.5, normal)
        np.testing.assert_allclose(here, there, atol=1e-13)
        np.testing.assert_allclose(traction_jump(here, there), 0.0, atol=1e-13)


def test_only_what_pulls_at_the_face_counts() -> None:
    """sigma_xx and sigma_xy jump over a face along x; sigma_yy may."""
    near, far = np.zeros((2, 1, 8, 6))
    far[..., 0], far[..., 1], far[..., 5] = 3.0, 7.0, 4.0
    normal = np.array([[1.0, 0.0, 0.0]])
    jump = traction_jump(face_tractions(near, 1, 0.5, normal), face_tractions(far, 0, 0.5, normal))
    np.testing.assert_allclose(jump, 5.0)


def test_normals_of_a_face() -> None:
    corners = np.array([[[0, 0, 0], [2, 0, 0], [0, 1, 1], [2, 1, 1]]], dtype=np.float64)
    np.testing.assert_allclose(np.abs(face_normals(corners)), [[0.0, np.sqrt(0.5), np.sqrt(0.5)]])
