"""The cloth case of the textbook chapter (9.6.4): a towel of 10,100 springs and 7,498 bends is folded edge to edge.

At the end corner lies on corner, the towel covers half of what it did, and nothing of it has gone through itself.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import softseam

Floats = NDArray[np.float64]
SIDE = 0.5
COARSE = (
    "body.divisions=[25, 25]",
    "body.position=[0, 0, 0.0075]",
    "tools.left.position=[0.2626, -0.2, 0.0075]",
    "tools.right.position=[0.2626, 0.2, 0.0075]",
)
"""a quarter of the particles; layers are then 15 mm thick, in place of 7.5 mm"""


@cache
def folded(*settings: str) -> Floats:
    """Positions along x and y of the lattice (n, n, 3) at the end of the run [m]."""
    with softseam.open("cloth_fold", settings=list(settings)) as sim:
        sim.reset()
        while not sim.done:
            seen = sim.step()
        x = seen.positions
    n = round(len(x) ** 0.5)
    return x.reshape(n, n, 3)


def crossings(x: Floats) -> int:
    """How many edges of the lattice (n, n, 3) go through triangles that they share no corner with."""
    n = len(x)
    number = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    edges = np.concatenate([np.stack(pair, 1) for pair in ((a, b), (a, d), (a, c))])
    flat, spacing = x.reshape(-1, 3), SIDE / (n - 1)
    near = cKDTree(flat[triangles].mean(1)).query_ball_point(flat[edges].mean(1), 1.5 * spacing)
    e = np.repeat(np.arange(len(edges)), [len(found) for found in near])
    t = np.concatenate([np.asarray(found, dtype=int) for found in near])
    apart = (edges[e][:, :, None] != triangles[t][:, None, :]).all(axis=(1, 2))
    (p, q), (u, v, w) = (flat[ids].transpose(1, 0, 2) for ids in (edges[e[apart]], triangles[t[apart]]))

    def side(one: Floats, two: Floats, three: Floats, four: Floats) -> Floats:
        signs: Floats = np.sign(np.einsum("ij,ij->i", np.cross(two - one, three - one), four - one))
        return signs

    through = side(p, q, u, v), side(p, q, v, w), side(p, q, w, u)
    return int(((side(u, v, w, p) != side(u, v, w, q)) & (through[0] == through[1]) & (through[1] == through[2])).sum())


def assert_folded(x: Floats, thickness: float) -> None:
    """Corners and edges within two layers' thickness of one another; in plan half as long as it was, to as much."""
    edge = np.linalg.norm(x[:, 0] - x[:, -1], axis=1)
    assert edge[[0, -1]].max() < 2.0 * thickness and edge.max() < 2.0 * thickness
    extent = np.ptp(x.reshape(-1, 3), axis=0)
    assert extent[0] == pytest.approx(0.5 * SIDE, abs=2.0 * thickness)
    assert extent[1] == pytest.approx(SIDE, abs=2.0 * thickness)
    assert extent[2] < 4.0 * thickness


def closer(x: Floats, thickness: float) -> int:
    """How many pairs of particles that are more than two spacings apart in the sheet are closer than a layer."""
    n = len(x)
    pairs = cKDTree(x.reshape(-1, 3)).query_pairs(0.98 * thickness, output_type="ndarray")
    i, j = np.divmod(pairs, n)
    return int((np.maximum(abs(i[:, 0] - i[:, 1]), abs(j[:, 0] - j[:, 1])) > 2).sum())


@pytest.mark.parametrize("method", ["xpbd", "pbd"])
def test_the_towel_of_the_chapter_is_folded(method: str) -> None:
    """By both methods that the chapter names; the shares of classic PBD are those that scenes begin with."""
    x = folded(f"models.pbd.method={method}")
    assert x.shape == (51, 51, 3)
    assert_folded(x, 0.0075)
    assert crossings(x) == 0 and closer(x, 0.0075) == 0


def test_a_towel_pushed_through_itself_is_told() -> None:
    """The control of `crossings`: some of the upper layer, 12 mm lower, lies below the lower one."""
    x = folded("models.pbd.method=xpbd").copy()
    x[20:30, 35:45, 2] -= 0.012
    assert crossings(x) > 100


def test_layers_that_may_pass_each_other_do() -> None:
    """The control of `closer`: without self-contact a quarter of the particles end side by side in one plane."""
    x = folded(*COARSE, "body.self_contact=false")
    assert closer(x, 0.015) > 100
