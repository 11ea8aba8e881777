"""`softseam check` warns of what is known to be unsteady before anything moves: by file, line, key and remedy."""

from __future__ import annotations

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from softseam.checking import check_scene

SCENE = """\
softseam: 1
name: cube
step: 0.01
body:
  shape: {kind: block, size: [0.02, 0.02, 0.02]}
  cell: 0.01
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
tools:
  left: {kind: box, size: [0.01, 0.03, 0.03], position: [-0.0155, 0, 0.016]}
  right: {kind: box, size: [0.01, 0.03, 0.03], position: [0.0155, 0, 0.016]}
motion:
  - {hold: 0.05}
  - {tools: [left, right], close: 0.02, until: {time: 0.05}}
regions: {default: pbd}
models: {pbd: {substeps: 40}}
"""


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        ("", "", "", ""),
        ("substeps: 40", "substeps: 3", ":15:26: ", "models.pbd.substeps: 3 in a step of 10 ms are fewer than the"),
        ("close: 0.02", "close: 0.6", ":13:5: ", "motion.1: right moves half its thickness in a step of 10 ms"),
        ("{pbd: {substeps: 40}}", "{fem: {element: tet4}}", ":15:25: ", "models.fem.element: tet4 is too"),
    ],
    ids=["steady", "few substeps", "too swift a tool", "an element that locks"],
)
def test_a_warning_tells_where(tmp_path: Path, old: str, new: str, place: str, words: str) -> None:
    path, said = tmp_path / "cube.yaml", StringIO()
    text = SCENE.replace(old, new)
    path.write_text(text.replace("default: pbd", "default: fem") if "fem" in new else text)
    check_scene(str(path), (), Console(file=said, width=1000))
    warnings = [line for line in said.getvalue().splitlines() if line.startswith("warning")]
    assert any(line.startswith(f"warning: {path}{place}{words}") for line in warnings) if words else not warnings
