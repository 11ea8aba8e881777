"""`softseam check` says with which side each tool of a grip meets the body."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from softseam.checking import check_scene

pytestmark = pytest.mark.kernels

SCENE = """\
softseam: 1
name: gripped
body:
  shape: {kind: block, size: [0.04, 0.03, 0.03]}
  cell: 0.015
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.4, density: 1000}
tools:
  left: {kind: box, size: [0.01, 0.02, 0.02], position: [-0.035, 0, 0.015], rotation: [0, 0, TURN]}
  right: {kind: sphere, radius: 0.008, position: [0.035, 0, 0.015]}
motion:
  - {hold: 0.1}
  - {tools: [left, right], close: 0.02, until: {compression: 0.1}}
"""


@pytest.mark.parametrize(
    ("turn", "says"),
    [
        ("0.1", "left, its +x side, after 9.03 mm"),
        ("3.04159265", "left, its -x side, after 9.03 mm"),
        ("0.78539816", "left, its edge or corner between +x and -y, after 4.39 mm"),
    ],
)
def test_the_side_that_grips_is_named_before_a_run(turn: str, says: str, tmp_path: Path) -> None:
    """Of boxes and meshes; a ball has no sides."""
    path, console = tmp_path / "gripped.yaml", Console(record=True, width=400, file=io.StringIO())
    path.write_text(SCENE.replace("TURN", turn))
    check_scene(str(path), (), console)
    told = console.export_text()
    assert says in told, told
    assert "right," not in told
