"""TetGen's .node and .ele, and .tet files: six tetrahedra of a box."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from solids import box

from softseam_protocol.scene.file import SceneError, load_scene
from softseam_services.body.build import build_body
from softseam_services.body.embed import read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.mesh_io import read_tetrahedra
from softseam_services.body.surface_check import enclosed_volume

POINTS = box((4.0, 3.0, 2.0))[0]
KUHN = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])


def rows(array: np.ndarray, first: int | None = None) -> str:
    count = "" if first is None else "{} "
    return "\n".join(
        count.format(number) + " ".join(map(str, row)) for number, row in enumerate(array.tolist(), first or 0)
    )


def node(first: int) -> str:
    return f"# of a mesher\n8 3 0 0\n{rows(POINTS, first)}\n"


def ele(first: int, regions: bool) -> str:
    cells = np.concatenate([KUHN + first, [[1], [1], [1], [2], [2], [2]]], axis=1) if regions else KUHN + first
    return f"6 4 {int(regions)}\n{rows(cells, first)}\n# end\n"


FILES = {
    "TetGen from 0": ("a.ele", node(0) + ele(0, False)),
    "TetGen from 1, with regions": ("a.node", node(1) + ele(1, True)),
    "lines of v and t": ("a.tet", f"# 8 vertices\nv {rows(POINTS)}\n".replace("\n", "\nv ").removesuffix("\nv ")
                         .replace("v # 8", "# 8").replace("# 8 vertices\nv v", "# 8 vertices\nv")
                         + "\n" + "\n".join(f"t {row}" for row in rows(KUHN).splitlines())),
    "Quartet": ("a.tet", f"tet 8 6\n{rows(POINTS)}\n{rows(KUHN)}\n"),
}  # fmt: skip


@pytest.mark.kernels
@pytest.mark.parametrize(("name", "text"), FILES.values(), ids=FILES.keys())
def test_the_same_box(name: str, text: str) -> None:
    vertices, triangles, _ = read_solid(name, text.encode(), 0.01, "z")
    assert enclosed_volume(vertices, triangles) == pytest.approx(24e-6, rel=1e-12)
    assert len(read_tetrahedra(name, text.encode()).cells) == 6


@pytest.mark.kernels
def test_regions_are_parts() -> None:
    vertices, triangles, _ = read_solid("a.ele", (node(1) + ele(1, True)).encode(), 0.01, "z", "region 2")
    assert enclosed_volume(vertices, triangles) == pytest.approx(12e-6, rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_middle_nodes_stand_with_their_edges(seed: int) -> None:
    """In whatever order they are; TetGen's is another than VTK's."""
    ends = np.random.default_rng(seed).permutation([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
    corners = KUHN[:1]
    points = np.concatenate([POINTS, POINTS[corners[0][ends]].mean(axis=1)])
    text = f"14 3 0 0\n{rows(points, 0)}\n1 10 0\n{rows(np.concatenate([corners, [np.arange(8, 14)]], axis=1), 0)}\n"
    raw = read_tetrahedra("a.ele", text.encode(), middles=True)
    for middle, (a, b) in zip(raw.middles[0], [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]], strict=True):
        np.testing.assert_allclose(raw.points[middle], raw.points[raw.cells[0, [a, b]]].mean(axis=0), atol=1e-12)


WRONG = {
    "nodes alone": ("a.node", node(0), r"^a\.node: has nodes alone"),
    "lost rows": ("a.ele", node(0) + ele(0, False)[:40], "no whole TetGen file"),
    "a point that is not there": ("a.tet", "v 0 0 0\nt 0 1 2 9\n", "a tetrahedron has point 9"),
    "no tetrahedra": ("a.tet", "v 0 0 0\n", "it has no tetrahedra"),
}


@pytest.mark.parametrize(("name", "text", "words"), WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_said(name: str, text: str, words: str) -> None:
    with pytest.raises(MeshError, match=words):
        read_solid(name, text.encode(), 1.0, "z")


SCENE = """softseam: 1
name: tets
step: 0.01
duration: 0.1
body:
  shape: {kind: mesh, path: a.ele, scale: 0.01}
  material: {young: 5.0e4, poisson: 0.4, density: 1000}
tools: {ground: {kind: plane}}
"""


@pytest.mark.kernels
def test_a_scene_names_one_of_the_two_files(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    (tmp_path / "a.ele").write_text(ele(0, False))
    with pytest.raises(SceneError, match=r"scene\.yaml:6:.*body\.shape\.path: .*a\.node cannot be read: No such file"):
        load_scene(path)
    (tmp_path / "a.node").write_text(node(0))
    loaded = load_scene(path)
    assert build_body(loaded.scene, loaded.bundle.files).total_mass == pytest.approx(24e-3, rel=1e-9)
