"""What is repaired of a surface, by how little and with which words; what is not safe is refused."""

from __future__ import annotations

import numpy as np
import pytest
from solids import BOX_TRIANGLES, box, cylinder, join, obj, sphere

from softseam_services.body.embed import read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.repair import repair
from softseam_services.body.surface_check import enclosed_volume

Mesh = tuple[np.ndarray, np.ndarray]
SOLIDS: dict[str, Mesh] = {
    "box": box((0.04, 0.03, 0.02)),
    "ball": sphere(0.03, 3),
    "rod": cylinder(0.01, 0.05, 24, np.array([1.0, 2.0, 0.5])),
}
EACH = pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS.keys())


def read(vertices: np.ndarray, triangles: np.ndarray) -> tuple[float, tuple[str, ...]]:
    """Volume and notes."""
    x, t, notes = read_solid("a.obj", obj(vertices, triangles), 1.0, "z")
    return enclosed_volume(x, t), notes


def refused(vertices: np.ndarray, triangles: np.ndarray, *words: str) -> None:
    with pytest.raises(MeshError) as caught:
        read(vertices, triangles)
    for word in words:
        assert word in str(caught.value), str(caught.value)


@EACH
def test_what_is_sound_stays_as_it_is(solid: Mesh) -> None:
    vertices, triangles = solid[0], solid[1].astype(np.int32)
    found = repair(vertices, triangles, np.arange(len(triangles)))
    assert found.vertices is vertices and found.triangles is triangles
    assert found.notes == ()


@pytest.mark.kernels
@EACH
def test_doubles_are_left_out(solid: Mesh) -> None:
    vertices, triangles = solid
    volume = enclosed_volume(vertices, triangles)
    again = np.concatenate([triangles, triangles[:5, [1, 2, 0]], triangles[[3], [0, 0, 1]][None]])
    found, notes = read(vertices, again)
    assert found == pytest.approx(volume, rel=1e-12)
    assert notes == (
        "1 triangles with a corner twice were left out", "5 triangles that were there twice were left out"
    )  # fmt: skip
    both_sides = np.concatenate([triangles, triangles[:, [0, 2, 1]]])
    assert read(vertices, both_sides)[0] == pytest.approx(volume, rel=1e-12)


@pytest.mark.kernels
@EACH
def test_a_fin_without_thickness_is_left_out(solid: Mesh) -> None:
    vertices, triangles = solid
    middle = vertices.mean(axis=0)
    tip = (middle + 3.0 * (vertices[triangles[0, :2]].mean(axis=0) - middle))[None]
    fin = [[*triangles[0, :2], len(vertices)], [*triangles[0, [1, 0]], len(vertices)]]
    found, notes = read(np.concatenate([vertices, tip]), np.concatenate([triangles, fin]))
    assert found == pytest.approx(enclosed_volume(vertices, triangles), rel=1e-12)
    assert notes == ("2 triangles that were there twice were left out",)


@pytest.mark.kernels
@pytest.mark.parametrize("size", [(0.04, 0.03, 0.02), (0.3, 0.1, 0.01), (1.0, 1.0, 1.0)])
def test_a_wall_between_touching_solids_unites_them(size: tuple[float, float, float]) -> None:
    below, above = box(size), box(size, (0.0, 0.0, size[2]))
    found, notes = read(*join(below, above))
    assert found == pytest.approx(2.0 * np.prod(size), rel=1e-12)
    assert any("triangles that were there twice were left out" in note for note in notes)


@pytest.mark.kernels
@EACH
@pytest.mark.parametrize("gap", [1e-6, 1e-5, 1e-4])
def test_points_that_nearly_coincide_are_welded(solid: Mesh, gap: float) -> None:
    """A surface torn along the border of some of its triangles, which has moved by a gap [1]."""
    vertices, triangles = solid
    extent = np.ptp(vertices, axis=0).max()
    torn = np.unique(triangles[: len(triangles) // 3])
    copies = vertices[torn] + gap * extent * np.array([0.6, 0.0, 0.8])
    number = np.arange(len(vertices))
    number[torn] = len(vertices) + np.arange(len(torn))
    moved = triangles.copy()
    moved[: len(triangles) // 3] = number[moved[: len(triangles) // 3]]
    found, notes = read(np.concatenate([vertices, copies]), moved)
    assert found == pytest.approx(enclosed_volume(vertices, triangles), rel=3.0 * gap)
    assert len(notes) == 1 and "double points, up to" in notes[0] and notes[0].endswith("were welded")
    assert f"{1e3 * gap * extent:.3g} mm apart" in notes[0]


def test_a_wide_gap_is_no_double_point() -> None:
    vertices, triangles = SOLIDS["box"]
    lid = np.concatenate([vertices, vertices[4:] + np.array([0.0, 0.0, 0.002])])
    apart = triangles.copy()
    apart[2:4] += 4
    refused(lid, apart, "open edges", "close the holes")


@pytest.mark.kernels
@pytest.mark.parametrize("at", [0.5, 0.3, 0.01])
def test_edges_are_split_at_points_that_lie_on_them(at: float) -> None:
    """One face of a box has a point more on an edge than its neighbour."""
    vertices, triangles = SOLIDS["box"]
    vertices = np.concatenate([vertices, [vertices[0] + at * (vertices[1] - vertices[0])]])
    first = [[0, 2, 8], [8, 2, 1]]  # in place of 0 2 1
    found, notes = read(vertices, np.concatenate([first, triangles[1:]]))
    assert found == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-12)
    assert notes == ("1 open edges were split at points that lie on them",)


@pytest.mark.kernels
@pytest.mark.parametrize("level", [3, 4, 5])
def test_pinholes_are_closed(level: int) -> None:
    vertices, triangles = sphere(0.03, level)
    volume = enclosed_volume(vertices, triangles.astype(np.int32))
    found, notes = read(vertices, triangles[1:])
    assert found == pytest.approx(volume, rel=1e-12)
    width = 1e3 * np.ptp(vertices[triangles[0]], axis=0).max()
    assert notes == (f"a pinhole of 3 edges, up to {width:.3g} mm wide, was closed",)
    if level > 3:
        middle = triangles[len(triangles) // 2, 0]
        around = (triangles == middle).any(axis=1)
        found, notes = read(vertices, triangles[~around])
        assert found == pytest.approx(volume, rel=0.01)
        assert f"a pinhole of {int(around.sum())} edges" in notes[0]


@pytest.mark.kernels
def test_what_was_repaired_before_a_refusal_is_said() -> None:
    """A spike through a pinhole: what closes it is crossed."""
    vertices, triangles = sphere(0.03, 4)
    spike = vertices[triangles[0]].mean(axis=0) * np.array([[0.8], [1.2], [1.2], [0.8]])
    spike[2, 1] += 5e-4
    spike[3, 2] += 5e-4
    thin = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    bead = sphere(0.001, 2)  # a cavity or a body, so that nothing is united
    meshes = join((vertices, triangles[1:]), (spike, thin), bead)
    refused(*meshes, "crosses itself", "(before that, a pinhole of 3 edges")


def test_large_holes_are_not_closed() -> None:
    vertices, triangles = SOLIDS["ball"]
    cap = vertices[triangles].mean(axis=1)[:, 2] > 0.02
    refused(vertices, triangles[~cap], "open edges (with one triangle)", "close the holes")
    refused(*(SOLIDS["box"][0], SOLIDS["box"][1][1:]), "3 open edges")


@pytest.mark.kernels
@pytest.mark.parametrize("at", [0.5, 0.25, 0.9])
def test_triangles_without_area_are_joined_to_their_neighbours(at: float) -> None:
    """A cap: three corners on a line, between two faces of a box."""
    vertices, triangles = SOLIDS["box"]
    vertices = np.concatenate([vertices, [vertices[0] + at * (vertices[1] - vertices[0])]])
    faces = [[0, 2, 8], [8, 2, 1], [0, 8, 1]]  # 0 2 1 has given way to two and a cap
    found, notes = read(vertices, np.concatenate([faces, triangles[1:]]))
    assert found == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-12)
    assert notes == ("1 triangles without area were joined to their neighbours",)


def test_a_triangle_whose_own_corner_lies_on_its_open_edge_is_left_out() -> None:
    """A cap that is too many, beside a hole whose corner it has; and a box with an edge that is split."""
    vertices, triangles = SOLIDS["box"]
    vertices = np.concatenate([vertices, 0.5 * (vertices[:1] + vertices[1:2])])
    others = [each for each in triangles.tolist() if each not in ([0, 2, 1], [0, 1, 4])]
    one = np.array([*others, [8, 2, 1], [0, 8, 4], [8, 1, 4], [0, 1, 8]])  # without 0 2 8
    two = np.array([*others, [8, 2, 1], [0, 2, 8], [0, 1, 4]])
    refused(*join((vertices, one), (vertices + 1.0, two)), "3 open edges", "2 open edges were split")


def test_triangles_with_a_corner_twice_enclose_nothing() -> None:
    lines = np.array([[0, 0, 1], [1, 1, 2], [2, 2, 0], [3, 3, 1]])
    refused(SOLIDS["box"][0], lines, "encloses nothing (4 triangles with a corner twice")


@pytest.mark.kernels
@pytest.mark.parametrize("size", [0.02, 0.013, 0.03])
def test_a_solid_that_touches_itself_along_an_edge(size: float) -> None:
    """A ring of boxes of which two meet at an edge only: one body, whose edge has four triangles."""
    places = [(0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0)]  # the last touches the first at an edge
    corners = np.array([(x, y, z) for z in (0, 1) for y in range(4) for x in range(4)], dtype=float) * size

    def at(x: int, y: int, z: int) -> int:
        return x + 4 * y + 16 * z

    squares = []
    for x, y in places:
        low, high = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)], places
        squares += [[at(*p, 0) for p in reversed(low)], [at(*p, 1) for p in low]]
        for k, (dx, dy) in enumerate([(0, -1), (1, 0), (0, 1), (-1, 0)]):
            if (x + dx, y + dy) not in high:
                (ax, ay), (bx, by) = low[k], low[(k + 1) % 4]
                squares.append([at(ax, ay, 0), at(bx, by, 0), at(bx, by, 1), at(ax, ay, 1)])
    triangles = np.array([half for a, b, c, d in squares for half in ([a, b, c], [a, c, d])])
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert np.unique(sides, axis=0, return_counts=True)[1].max() == 4
    found, notes = read(corners, triangles)
    assert found == pytest.approx(7.0 * size**3, rel=1e-12)
    assert notes == ("1 edges along which the surface touches itself were parted",)


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("extent", "scale", "words"),
    [
        (120.0, 1.0, "this looks like millimetres: set scale: 0.001, which makes it 120 mm long"),
        (12.0, 1.0, "this looks like millimetres: set scale: 0.001, which makes it 12 mm long"),
        (7.0, 0.1, "this looks like millimetres: set scale: 0.001, which makes it 70 mm long"),
        (2.0, 1.0, ""),
        (0.3, 0.001, "this looks like metres: set scale: 1, which makes it 300 mm long"),
    ],
)
def test_units_are_guessed_and_told(extent: float, scale: float, words: str) -> None:
    data = obj(extent * SOLIDS["box"][0] / 0.04, BOX_TRIANGLES)
    if extent * scale > 100.0:
        with pytest.raises(MeshError) as caught:
            read_solid("a.obj", data, scale, "z")
        assert f"more than 100 m; {words}" in str(caught.value)
        return
    vertices, _, notes = read_solid("a.obj", data, scale, "z")
    assert np.ptp(vertices, axis=0).max() == pytest.approx(extent * scale), "it is never applied"
    assert notes == ((words,) if words and not 1e-3 <= extent * scale <= 5.0 else ())
