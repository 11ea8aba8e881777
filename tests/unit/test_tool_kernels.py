"""Signed distance to tools against brute force, turned tools included; distances of cells; motion."""

from __future__ import annotations

import numpy as np
import pytest

from softseam_protocol.scene.tools import SphereTool
from softseam_services.shapes import SHAPES
from softseam_services.shapes.branches import BOX, PLANE, SPHERE
from softseam_services.tools.kernels import cell_distances, rotate, rotate_back, tool_gap
from softseam_services.tools.motion import tool_motion
from softseam_services.tools.tool_set import ToolSet

HALF = np.array([0.5, 0.3, 0.2])
SHARP = np.append(HALF, 0.0)


def quaternion(seed: int) -> np.ndarray:
    q = np.random.default_rng(seed).normal(size=4)
    return q / np.linalg.norm(q)


def matrix(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.kernels
def test_quaternions_turn_as_their_matrix() -> None:
    q, v = quaternion(1), np.array([0.3, -0.7, 1.1])
    np.testing.assert_allclose(rotate(q, *v), matrix(q) @ v, atol=1e-15)
    np.testing.assert_allclose(rotate_back(q, *v), matrix(q).T @ v, atol=1e-15)


def box_surface(n: int) -> np.ndarray:
    """A fine grid of points on the surface of the box (m, 3)."""
    line = np.linspace(-1.0, 1.0, n)
    u, v = (g.ravel() for g in np.meshgrid(line, line))
    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            face = np.empty((n * n, 3))
            face[:, axis], face[:, (axis + 1) % 3], face[:, (axis + 2) % 3] = side, u, v
            faces.append(face * HALF)
    return np.concatenate(faces)


@pytest.mark.kernels
def test_box_distance_is_the_nearest_point_of_its_surface() -> None:
    """Brute force over a grid of spacing h overestimates by at most h/sqrt(2)."""
    n = 61
    spacing = 2 * HALF.max() / (n - 1)
    surface = box_surface(n)
    position, q = np.array([0.1, -0.2, 0.3]), quaternion(2)
    R = matrix(q)
    for y in np.random.default_rng(3).uniform(-0.9, 0.9, size=(60, 3)):
        brute = np.linalg.norm(surface - y, axis=1).min()
        inside = (np.abs(y) < HALF).all()
        gap, *normal = tool_gap(BOX, SHARP, position, q, position + R @ y)
        assert abs(gap) <= brute + 1e-12
        assert abs(gap) >= brute - spacing / np.sqrt(2)
        assert (gap < 0) == inside
        # Walking back by the gap along the normal lands on the surface.
        foot = R.T @ (R @ y - gap * np.array(normal))
        assert np.abs(np.abs(foot) / HALF).max() == pytest.approx(1.0, abs=1e-12)
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.kernels
@pytest.mark.parametrize(("kind", "shape"), [(PLANE, [0.0, 0.6, 0.8]), (BOX, SHARP), (SPHERE, [0.4, 0.0, 0.0])])
def test_normal_is_the_gradient_of_the_gap(kind: int, shape: list[float]) -> None:
    position, q, h = np.array([0.2, 0.1, -0.3]), quaternion(7), 1e-6
    for point in np.random.default_rng(8).uniform(-1.0, 1.0, size=(30, 3)):
        _, *normal = tool_gap(kind, np.array(shape), position, q, point)
        gradient = [
            (
                tool_gap(kind, np.array(shape), position, q, point + h * e)[0]
                - tool_gap(kind, np.array(shape), position, q, point - h * e)[0]
            )
            / (2 * h)
            for e in np.eye(3)
        ]
        np.testing.assert_allclose(normal, gradient, atol=1e-5)


@pytest.mark.kernels
def test_plane_and_sphere_closed_forms() -> None:
    identity = np.array([1.0, 0.0, 0.0, 0.0])
    half_turn_x = np.array([0.0, 1.0, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(tool_gap(PLANE, up, np.zeros(3), identity, np.array([1, 2, 0.5])), [0.5, 0, 0, 1])
    np.testing.assert_allclose(tool_gap(PLANE, up, np.zeros(3), half_turn_x, np.array([1, 2, 0.5])), [-0.5, 0, 0, -1])
    ball = np.array([0.25, 0.0, 0.0])
    np.testing.assert_allclose(tool_gap(SPHERE, ball, np.ones(3), identity, np.array([1, 1, 2.0])), [0.75, 0, 0, 1])
    gap, *normal = tool_gap(SPHERE, ball, np.ones(3), identity, np.ones(3))
    assert gap == -0.25
    assert np.linalg.norm(normal) == 1.0


@pytest.mark.kernels
def test_cell_distance_is_the_least_over_nodes_and_near_tools() -> None:
    rng = np.random.default_rng(4)
    x = rng.uniform(-1, 1, size=(60, 3))
    cells = rng.permutation(54).reshape(2, 27).astype(np.int32)
    kind = np.array([PLANE, BOX, SPHERE], dtype=np.int64)
    shape = np.array([[0, 0, 1.0, 0], SHARP, [0.1, 0, 0, 0]])
    position = np.array([[0, 0, -5.0], [3.0, 0, 0], [0, 2.0, 0]])
    orientation = np.stack([quaternion(i) for i in range(3)])
    distance = np.empty(2)
    cell_distances(x, cells, kind, shape, position, orientation, np.array([False, True, True]), np.empty(60), distance)
    for c in range(2):
        gaps = [tool_gap(kind[t], shape[t], position[t], orientation[t], x[n])[0] for n in cells[c] for t in (1, 2)]
        assert distance[c] == min(gaps)
    cell_distances(x, cells, kind, shape, position, orientation, np.zeros(3, dtype=bool), np.empty(60), distance)
    assert np.isinf(distance).all()


def test_a_motion_takes_tools_along() -> None:
    tools = ToolSet(
        names=("a",),
        kind=np.array([SPHERE], dtype=np.int64),
        shape=np.array([[0.1, 0, 0]]),
        reach=np.array([0.1]),
        friction=np.zeros(1),
        followed=np.ones(1, dtype=bool),
        position=np.zeros((1, 3)),
        orientation=np.array([[1.0, 0, 0, 0]]),
        geometry=(SHAPES["sphere"].build(SphereTool(radius=0.1, position=(0.0, 0.0, 0.0)), {}),),
    )
    motion = tool_motion(tools.position, tools.orientation, np.array([[1.0, 2.0, 3.0, 0.0, 0.0, 0.0]]), 0.5)
    np.testing.assert_array_equal(motion.position_next, [[0.5, 1.0, 1.5]])
    np.testing.assert_array_equal(motion.orientation_next, motion.orientation)
