"""`softseam check` names tools that fit between the corners of coarse cells."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from softseam.checking import check_scene

pytestmark = pytest.mark.kernels

SCENE = """\
softseam: 1
name: narrow
duration: 0.1
body:
  shape: {kind: block, size: [0.06, 0.06, 0.06]}
  cell: 0.02
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
tools:
  ground: {kind: plane, friction: 0.5}
  plate: {kind: box, size: [0.1, 0.1, 0.004], position: [0, 0, 0.08]}
  ball: {kind: sphere, radius: 0.008, position: [0, 0, 0.08]}
  wide: {kind: sphere, radius: 0.01, position: [0, 0, 0.09]}
  rod: {kind: capsule, radius: 0.006, length: 0.1, axis: [1, 0, 0], position: [0, 0, 0.08]}
  bar: {kind: box, size: [0.1, 0.012, 0.012], position: [0, 0, 0.08]}
motion:
  - {tools: [ball], move: [0, 0, -0.001], speed: 0.02}
models: {pbd: {coarse: {beyond: 0.001}}}
regions: {default: pbd}
"""
BEYOND = "models: {pbd: {coarse: {beyond: 0.001}}}"
FOLLOWS = "{default: pbd, near: {model: fem, within: 0.03}}"


def said(folder: Path, text: str) -> str:
    path = folder / "narrow.yaml"
    path.write_text(text)
    console = Console(record=True, width=400, file=io.StringIO())
    check_scene(str(path), (), console)
    return console.export_text()


def test_tools_narrower_than_coarse_cells_are_named(tmp_path: Path) -> None:
    """A bar, too, but no plate that covers the block."""
    told = said(tmp_path, SCENE)
    assert "edge of 20 mm: ball (16 mm), bar (12 mm), rod (12 mm). " in told
    assert "models.pbd.coarse.beyond" in told


def test_tools_that_fit_between_points_are_named(tmp_path: Path) -> None:
    """In both models: four points along each edge of a cell, and less than 2.4 of their spacings across."""
    for model in ("pbd", "fem"):
        scene = SCENE.replace(BEYOND, "").replace("{default: pbd}", f"{{default: {model}}}")
        told = said(tmp_path, scene.replace("cell: 0.02", "cell: 0.06"))
        assert (
            "points 15 mm apart" in told
            and "ball (16 mm), bar (12 mm), rod (12 mm), wide (20 mm). Make cells 0.02 m" in told
        )
        assert "mm apart" not in said(tmp_path, scene)


@pytest.mark.parametrize(("radius", "told"), [(0.002, True), (0.0025, True), (0.0028, True), (0.003, False)])
def test_rods_that_cut_into_a_block_are_named(tmp_path: Path, radius: float, told: bool) -> None:
    """On cells of 10 mm, pressed in 10 mm, rods of 4, 5 and 5.6 mm pass between points from 3, 5 and 8 mm on."""
    rod = f"{{kind: cylinder, radius: {radius}, length: 0.03, axis: [1, 0, 0], position: [0, 0, 0.09]}}"
    scene = SCENE.replace(BEYOND, "").replace("cell: 0.02", "cell: 0.01")
    scene = scene.replace("motion:", f"  thin: {rod}\nmotion:")
    assert (f"thin ({2e3 * radius:.3g} mm)" in said(tmp_path, scene)) == told


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (SCENE.replace(BEYOND, ""), ""),
        (SCENE.replace("{default: pbd}", "{default: fem}"), ""),
        (SCENE.replace("{default: pbd}", FOLLOWS), "rod (12 mm)"),
    ],
)
def test_where_they_meet_no_coarse_cell_they_are_not(tmp_path: Path, text: str, names: str) -> None:
    """Nothing is coarse; PBD has nothing; or cells that the ball comes near to are FEM's."""
    told = "".join(line for line in said(tmp_path, text).splitlines() if "narrower" in line)
    assert "ball" not in told
    assert (names in told) and bool(told) == bool(names)
