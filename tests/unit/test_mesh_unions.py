"""Closed bodies that overlap or touch are one solid, and points at which a surface pokes through itself are left out;
what is neither is refused as before."""

from __future__ import annotations

import numpy as np
import pytest
from scene_files import collada
from solids import box, join, obj, sphere

from softseam_services.body.embed import read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.surface_check import enclosed_volume

pytestmark = pytest.mark.kernels

Mesh = tuple[np.ndarray, np.ndarray]
CUBE = box((0.04, 0.03, 0.02))
TURN = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]


def read(*parts: Mesh) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    return read_solid("a.obj", obj(*join(*parts)), 1.0, "z")


def turned(mesh: Mesh) -> Mesh:
    """As a file has it that rounds to a picometre."""
    return np.round(mesh[0] @ TURN.T, 12), mesh[1]


# bodies, and the volume of their union
UNIONS: dict[str, tuple[list[Mesh], float]] = {
    "through a face": ([CUBE, box((0.02, 0.01, 0.03), (0.01, 0.011, -0.005))], 2.4e-5 + 2e-6),
    "faces in alignment": ([CUBE, box((0.04, 0.03, 0.02), (0.02, 0.015, 0.01))], 4.8e-5 - 3e-6),
    "face on face": ([CUBE, box((0.02, 0.01, 0.01), (0.04, 0.01, 0.005))], 2.4e-5 + 2e-6),
    "hulls of a finger": (
        [box((0.01, 0.02, 0.05)), box((0.03, 0.018, 0.01), (0.005, 0.001, 0.035)),
         box((0.01, 0.016, 0.03), (0.03, 0.002, 0.02))],
        1e-5 + 5.4e-6 - 0.005 * 0.018 * 0.01 + 4.8e-6 - 0.005 * 0.016 * 0.01,
    ),
}  # fmt: skip


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize(("parts", "volume"), UNIONS.values(), ids=UNIONS.keys())
def test_bodies_that_overlap_or_touch_are_united(parts: list[Mesh], volume: float, turns: bool) -> None:
    parts = [turned(part) for part in parts] if turns else parts
    vertices, triangles, notes = read(*parts)
    assert enclosed_volume(vertices, triangles) == pytest.approx(volume, rel=1e-6)
    assert f"{len(parts)} closed bodies that overlap or touch were united: {1e6 * volume:.3g} cm^3 of the" in notes[0]
    again = read(*parts)
    assert (again[0] == vertices).all() and (again[1] == triangles).all()


def test_cavities_stay_and_those_that_another_body_fills_do_not() -> None:
    """A hollow cube, a bar through one wall that ends in the hollow: what it fills of that is solid."""
    hollow = box((0.02, 0.02, 0.02), (0.01, 0.005, 0.0))
    shell = join(
        box((0.04, 0.03, 0.02), (0, 0, -0.0)), (hollow[0] * [1, 1, 0.5] + [0, 0, 0.005], hollow[1][:, [0, 2, 1]])
    )
    bar = box((0.03, 0.004, 0.004), (0.015, 0.01, 0.008))
    vertices, triangles, notes = read(shell, bar)
    outside, inside = 0.005 * 0.004**2, 0.015 * 0.004**2
    assert enclosed_volume(vertices, triangles) == pytest.approx(2.4e-5 - 4e-6 + outside + inside, rel=1e-9)
    assert "2 closed bodies" in notes[0]


def test_nodes_of_a_scene_that_overlap_are_united() -> None:
    """Two boxes of 4 x 3 x 2, one 2 along x from the other."""
    nodes = '<node id="a"><instance_geometry url="#g"/></node><node id="b"><translate>2 0 0</translate>'
    data = collada(nodes + '<instance_geometry url="#g"/></node>', '<unit meter="0.01"/>')
    vertices, triangles, _ = read_solid("a.dae", data, None, None)
    assert enclosed_volume(vertices, triangles) == pytest.approx(36e-6, rel=1e-6)
    assert enclosed_volume(*read_solid("a.dae", data, None, None, "a")[:2]) == pytest.approx(24e-6, rel=1e-6)


@pytest.mark.parametrize("level", [5, 6])
def test_points_that_poke_out_at_the_other_side_are_left_out(level: int) -> None:
    vertices, triangles = sphere(0.02, level)
    poked = vertices.copy()
    poked[[200, 230]] *= -1.2
    found, turned, notes = read((poked, triangles))
    whole = enclosed_volume(vertices, triangles.astype(np.int32))
    assert enclosed_volume(found, turned) == pytest.approx(whole, rel=1e-3)
    assert notes[0].startswith("2 points at which it pokes through itself were left out, which changes its volume by")


def plate(n: int) -> Mesh:
    """A plate of 40 x 40 x 2 mm, its large faces of n x n squares, whose upper middle point pokes through it."""
    at = np.linspace(-0.02, 0.02, n + 1)
    x, y = (each.ravel() for each in np.meshgrid(at, at, indexing="ij"))
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    up = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    rim = np.concatenate([number[:-1, 0], number[-1, :-1], number[:0:-1, -1], number[0, :0:-1]])
    after, n_points = np.roll(rim, -1), len(x)
    sides = np.concatenate(
        [np.stack([rim, after, after + n_points], axis=1), np.stack([rim, after + n_points, rim + n_points], axis=1)]
    )
    points = np.concatenate([np.stack([x, y, np.full_like(x, z)], axis=1) for z in (0.0, 0.002)])
    points[n_points + number[n // 2, n // 2], 2] = -0.001
    return points, np.concatenate([up[:, ::-1], up + n_points, sides])  # fmt: skip


def test_a_point_that_pokes_through_a_wall_is_left_out() -> None:
    vertices, triangles, notes = read(plate(30))
    assert enclosed_volume(vertices, triangles) == pytest.approx(3.2e-6, rel=1e-3)
    assert notes[0].startswith("1 point at which it pokes through itself was left out")


def test_what_cannot_be_mended_is_refused_as_before() -> None:
    with pytest.raises(MeshError, match=r"2 separate bodies .*`part: 1`"):
        read(CUBE, box((0.01, 0.01, 0.01), (0.05, 0.0, 0.0)))
    # an island in a cavity that faces outward may be meant as either
    with pytest.raises(MeshError, match="crosses itself"):
        read(CUBE, box((0.02, 0.01, 0.03), (0.01, 0.011, -0.005)), box((0.002, 0.002, 0.002), (0.001, 0.001, 0.001)))
    # a twisted bar crosses itself in its whole length
    bow = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1], [1, 0, 1], [0, 0, 1]], dtype=float
    )
    with pytest.raises(MeshError, match="crosses itself"):
        read((0.02 * bow, CUBE[1]))
