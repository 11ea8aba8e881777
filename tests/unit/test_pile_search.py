"""What touches what in a pile: few triangles are tried, and what is found is what a search of all finds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from cubes import EDGE, FIRM, cube, scene_of
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from softseam_coupling.interfaces.contact import REACH
from softseam_coupling.kernels.nearest_face import nearest_faces, point_normals
from softseam_protocol.scene.file import bundle_scene
from softseam_services.pbd.between import Between
from softseam_services.pbd.guests import Guests
from softseam_services.pbd.kernels.eights import NODE, ROW
from softseam_services.pbd.kernels.pairs import EIGHT
from softseam_services.pbd.kernels.touch import CORNER, NORMAL, PLACE, POINT, RANK, SHARE
from softseam_services.pbd.pile_pieces import Pieces
from softseam_services.pbd.surfaces import Contact
from softseam_services.server import build_setup

pytestmark = pytest.mark.kernels

Floats = NDArray[np.float64]
DT = 0.005
MEETINGS = ((0, 1), (2, 1), (0, 2), (3, 2))


class Four:
    """Cubes of two cells an edge, which meet one another by their nodes."""

    def __init__(self) -> None:
        bodies = {f"cube{k}": cube(k, 4, cells, material=FIRM) for k, cells in enumerate((2, 2, 2, 2))}
        bundle = bundle_scene(scene_of(bodies))
        self.pieces = Pieces([build_setup(bundle, name) for name in bodies])
        contacts = {f"{a}{b}": Contact((a, b), 0.3) for a, b in MEETINGS}
        self.between = Between(contacts, self.pieces, Guests([], len(bodies)))
        self.rest = [piece.body.x_rest - piece.body.x_rest.mean(axis=0) for piece in self.pieces.each]
        self.x = [piece.states[0].x for piece in self.pieces.each]
        self.v = [piece.states[0].v for piece in self.pieces.each]

    def find(self) -> None:
        none = np.zeros(4, dtype=np.bool_)
        self.between.find(self.pieces.rows()[0], none, none, 0, DT)

    def found(self) -> dict[int, tuple[Floats, Floats, Floats]]:
        """Rows by place: corners, weights, normal."""
        touch, n = self.between.touch, int(self.between.touch.start[-1])
        ints, rows = touch.ints[:n], touch.rows[:n]
        return {
            int(i[PLACE]): (
                i[CORNER : CORNER + 3].astype(float),
                r[SHARE : SHARE + 3].copy(),
                r[NORMAL : NORMAL + 3].copy(),
            )
            for i, r in zip(ints, rows, strict=True)
        }

    def expected(self) -> dict[int, tuple[Floats, Floats, Floats]]:
        """The same by a search of all triangles for all points."""
        touch, every = self.between.touch, {}
        for meeting, bodies in enumerate(MEETINGS):
            reach = REACH * min(touch.spacing[list(bodies)])
            surfaces = [self._surface(body) for body in bodies]
            gone = [to - at for _, _, at, to in surfaces]
            means = [each.mean(axis=0) for each in gone]
            way = np.linalg.norm(means[0] - means[1])
            way += sum(np.linalg.norm(g - mean, axis=1).max() for g, mean in zip(gone, means, strict=True))
            for side in (0, 1):
                (_, corners, at, to), (their, triangles, their_at, their_to) = surfaces[side], surfaces[1 - side]
                points, faces, far = (to, their_to, reach) if way <= reach else (at, their_at, reach + way)
                p = len(points)
                out, face, share = np.zeros((p, 3)), np.zeros(p, dtype=np.int64), np.zeros((p, 3))
                beside, normal = np.zeros(p), np.zeros((p, 3))
                point_normals(to, corners, out)
                nearest_faces(points, out, faces, triangles, far, reach, face, share, beside, normal)
                check_nearest(points, out, faces[triangles], far, reach, face)
                for i in np.flatnonzero((face >= 0) & (beside < reach)):
                    a, b, c = faces[triangles[face[i]]]
                    edges = np.stack((b - a, c - a), axis=1)
                    weights = np.linalg.lstsq(edges, points[i] - a, rcond=None)[0]
                    row = touch.row[bodies[1 - side]] + their[triangles[face[i]]]
                    s = np.array([1.0 - weights.sum(), *weights])
                    every[int(touch.place[meeting, side] + i)] = row.astype(float), s, normal[i].copy()
        return every

    def _surface(self, body: int) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats, Floats]:
        """Nodes of its points, triangles between these, places as a step begins and ends."""
        touch = self.between.touch
        nodes = touch.node[touch.first[body] : touch.first[body + 1]]
        corners = touch.corners[touch.first_triangle[body] : touch.first_triangle[body + 1]]
        return nodes, corners, self.x[body][nodes], self.x[body][nodes] + DT * self.v[body][nodes]


def check_nearest(
    points: Floats, out: Floats, triangles: Floats, far: float, deepest: float, face: NDArray[np.int64]
) -> None:
    """That of the triangles (t, 3, 3) that look at a point, which is behind them by `deepest` at most, none within
    `far` is nearer than its face."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    for point, outward, nearest in zip(points, out, face, strict=True):
        ahead = np.einsum("tj,tj->t", point - triangles[:, 0], normals) >= -deepest
        found = np.where(ahead & (normals @ outward <= -0.3), distances(point, triangles, normals), np.inf)
        if nearest < 0:
            assert found.min() >= far * (1.0 - 1e-9)
        else:
            assert found[nearest] <= found.min() * (1.0 + 1e-8) + 1e-15 and found.min() <= far * (1.0 + 1e-9)


def distances(point: Floats, triangles: Floats, normals: Floats) -> Floats:
    """From a point to triangles (t,): to their planes where the foot is inside, else to the nearest of their sides."""
    sides = np.roll(triangles, -1, axis=1) - triangles
    away = point - triangles
    inside = (np.einsum("tij,tj->ti", np.cross(sides, away), normals) >= 0.0).all(axis=1)
    along = np.clip(np.einsum("tij,tij->ti", away, sides) / np.einsum("tij,tij->ti", sides, sides), 0.0, 1.0)
    beside = np.linalg.norm(away - along[:, :, None] * sides, axis=2).min(axis=1)
    return np.asarray(np.where(inside, np.abs(np.einsum("tj,tj->t", away[:, 0], normals)), beside))


def poses(four: Four) -> Iterator[str]:
    """Put the cubes near one another and move them: little, much, fast, turning, back to where they were."""
    random = np.random.default_rng(7)
    centres = EDGE * np.array([[0.0, 0.0, 0.0], [0.15, 0.1, 1.005], [0.9, 0.2, 0.3], [1.6, -0.1, 1.0]])
    turns = [
        Rotation.identity(),
        Rotation.identity(),
        Rotation.from_rotvec([0.1, 0.2, 0.3]),
        Rotation.random(random_state=3),
    ]
    bent = [1.0 + 0.05 * random.standard_normal(3) for _ in range(4)]
    for step in range(30):
        kind = ("rest", "little", "turn", "much", "fast")[step % 5 if step > 10 else step % 2]
        for k in range(4):
            if kind in ("much", "turn"):
                turns[k] = Rotation.from_rotvec(0.1 * random.standard_normal(3)) * turns[k]
            centres[k] += {"rest": 0.0, "little": 1e-4, "turn": 1e-4}.get(kind, 2e-3) * random.standard_normal(3)
            four.x[k][:] = centres[k] + turns[k].apply(four.rest[k] * bent[k])
            four.v[k][:] = (5.0 if kind == "fast" else 0.0 if kind == "rest" else 0.02) * random.standard_normal(3)
        yield kind


def test_few_triangles_give_what_all_give() -> None:
    """Corners and normals to the bit, weights to roundoff; and lists are kept where little moves."""
    four, counts, kept = Four(), [], 0
    for kind in poses(four):
        before = four.between.touch.since.copy()
        four.find()
        found, expected = four.found(), four.expected()
        assert found.keys() == expected.keys()
        for place, (corners, weights, normal) in expected.items():
            np.testing.assert_array_equal(found[place][0], corners)
            np.testing.assert_array_equal(found[place][2], normal)
            np.testing.assert_allclose(found[place][1], weights, atol=1e-9)
        counts.append(len(found))
        kept += kind in ("rest", "little") and np.array_equal(before, four.between.touch.since)
    assert min(counts[:10]) > 40 and kept > 5


def test_points_above_corners_of_a_grid() -> None:
    """Where six triangles are as near, it is the same one that a search of all takes."""
    four = Four()
    for step in range(3):
        for k, centre in enumerate(((0.0, 0.0, 0.0), (0.0, 0.0, 1.004), (0.0, 1.004, 0.0), (0.0, 1.004, 1.004))):
            four.x[k][:], four.v[k][:] = four.rest[k] + EDGE * np.array(centre) + 1e-5 * step, 0.0
        four.find()
        found, expected = four.found(), four.expected()
        assert found.keys() == expected.keys() and len(found) > 60
        for place, (corners, _, normal) in expected.items():
            np.testing.assert_array_equal(found[place][0], corners)
            np.testing.assert_array_equal(found[place][2], normal)


def test_eights_share_no_node() -> None:
    """Each row is in one; those that share a node come in their order, those that touch before others that are near."""
    four = Four()
    for _ in poses(four):
        four.find()
        touch, n = four.between.touch, int(four.between.touch.start[-1])
        laid = four.between.eights.laid[: four.between.groups.first_eight[four.between.n_groups]]
        rows = laid[:, ROW : ROW + EIGHT]
        assert sorted(rows[rows >= 0]) == list(range(n))
        nodes = laid[:, NODE : NODE + 4 * EIGHT].reshape(-1, 4, EIGHT)
        last: dict[int, tuple[int, int]] = {}
        for own, of in zip(nodes, rows, strict=True):
            taken = own[:, of >= 0].ravel()
            assert len(set(taken.tolist())) == len(taken)
            for lane in np.flatnonzero(of >= 0):
                r = int(of[lane])
                np.testing.assert_array_equal(own[:, lane], touch.ints[r, POINT : CORNER + 3])
                for node in own[:, lane].tolist():
                    assert last.get(node, (0, -1)) < (touch.ints[r, RANK], r)
                    last[node] = int(touch.ints[r, RANK]), r
