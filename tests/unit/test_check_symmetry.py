"""`softseam check` says what symmetry leaves to solve for, and how much memory a factor takes."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from softseam.checking import check_scene
from softseam.errors import SceneRefused

pytestmark = pytest.mark.kernels

SCENE = """\
softseam: 1
name: cube
duration: 0.1
body:
  shape: {kind: block, size: [0.06, 0.06, 0.06]}
  cell: 0.00375
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
tools:
  ground: {kind: plane, friction: 0.5}
  ball: {kind: sphere, radius: 0.008, position: [0, 0, 0.08]}
motion:
  - {tools: [ball], move: [0, 0, -0.001], speed: 0.02}
regions: {default: fem}
"""


def said(folder: Path, text: str) -> str:
    path = folder / "cube.yaml"
    path.write_text(text)
    console = Console(record=True, width=400, file=io.StringIO())
    check_scene(str(path), (), console)
    return console.export_text()


def test_a_factor_of_many_unknowns_is_told_of(tmp_path: Path) -> None:
    """16 cells along each edge: 107,811 unknowns; a quarter of them needs no word, nor do PBD's."""
    told = said(tmp_path, SCENE)
    assert "a matrix of 107,811 unknowns, which takes about 1.7 GB" in told and "symmetry  " not in told
    quarter = said(tmp_path, SCENE + "symmetry: [x, y]\n")
    assert "solves for a quarter of them" in quarter and "GB" not in quarter
    assert "GB" not in said(tmp_path, SCENE.replace("default: fem", "default: pbd"))


def test_a_check_refuses_what_is_not_symmetric(tmp_path: Path) -> None:
    uneven = SCENE.replace("material:", "friction_field: {spread: 0.3, length: 0.02}\n  material:") + "symmetry: [x]\n"
    with pytest.raises(SceneRefused, match=r"cube\.yaml:7:19: body\.friction_field: friction varies over both sides"):
        said(tmp_path, uneven)
    askew = SCENE.replace("position: [0, 0, 0.08]", "position: [0.001, 0, 0.08]") + "symmetry: [y, x]\n"
    with pytest.raises(SceneRefused, match="not symmetric in x: tool 'ball' has no image"):
        said(tmp_path, askew)
