"""The renderer where things reach behind the eye, as a belt under the camera does."""

from __future__ import annotations

import numpy as np
import pytest

from softseam.view.raster import Camera, Canvas

CAMERA = Camera(np.array([0.0, -1.0, 0.3]), np.array([0.0, 0.0, 0.0]))
RED = np.array([0.9, 0.1, 0.1])


def drawn(canvas: Canvas) -> np.ndarray:
    return np.asarray(canvas.image()[..., 1] < 200)


@pytest.mark.parametrize("behind", [0.9, 1.0, 50.0])
def test_a_line_from_before_the_eye_to_behind_it(behind: float) -> None:
    """It is drawn as far as the picture goes, at once."""
    pictures = []
    for end in (-0.8, -behind):  # at -0.8 it has left the picture
        canvas = Canvas(80, 60, CAMERA)
        canvas.lines(np.array([[[0.0, 0.5, 0.0], [0.0, end, 0.0]]]), RED, width=2.0)
        pictures.append(drawn(canvas))
    assert pictures[0].sum() > 60
    np.testing.assert_array_equal(pictures[0], pictures[1])


def test_a_line_behind_the_eye_is_not_drawn() -> None:
    canvas = Canvas(80, 60, CAMERA)
    canvas.lines(np.array([[[0.0, -2.0, 0.0], [0.0, -3.0, 1.0]]]), RED)
    assert not drawn(canvas).any()


@pytest.mark.parametrize("alpha", [1.0, 0.5])
def test_triangles_that_reach_behind_the_eye(alpha: float) -> None:
    """A plate under the eye fills what one does that ends before it, outside of the picture, and shades alike."""
    pictures = []
    for reach in (0.6, 40.0):
        vertices = np.array([[-30.0, -reach, 0.0], [30.0, -reach, 0.0], [30.0, 0.2, 0.0], [-30.0, 0.2, 0.0]])
        canvas = Canvas(80, 60, CAMERA)
        triangles, normals = np.array([[0, 1, 2], [0, 2, 3]]), np.tile([0.0, 0.0, 1.0], (4, 1))
        canvas.mesh(vertices, normals, triangles, np.broadcast_to(RED, (2, 3, 3)), alpha=alpha)
        pictures.append(canvas.image().astype(int))
    assert drawn(canvas)[-1].all() and not drawn(canvas)[0].any()
    assert np.abs(pictures[0] - pictures[1]).max() <= 1
