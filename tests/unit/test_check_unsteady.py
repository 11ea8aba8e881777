"""`softseam check` warns of what is known to be unsteady before anything moves: by file, line, key and remedy."""

from __future__ import annotations

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from softseam.checking import check_scene

pytestmark = pytest.mark.kernels

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
        (
            "young: 2.0e4",
            "young: 150",
            ":7:40: ",
            "body.material.young: 150 Pa; the body would sink by some 131 % of its height",
        ),
        (", 0.02, 0.02]}", ", 6, 0.02]}", ":5:10: ", "body.shape: 6 m from end to end is unlike what a hand grips; is"),
        (
            "1000}",
            "1000, retardation_time: 9}",
            ":7:95: ",
            "body.material.retardation_time: 9 s, but the motion lasts",
        ),
        (
            "  cell: 0.01\n",
            "  fixed: [{min: [1, 1, 1], max: [2, 2, 2]}]\n  cell: 0.01\n",
            ":6:11: ",
            "body.fixed.0: no node is in this box: the body spans [-0.01, -0.01, 0.0] .. [0.01, 0.01, 0.02] m at rest",
        ),
        (
            "{default: pbd}",
            "{default: pbd, near: {model: fem, boxes: [{min: [1, 1, 1], max: [2, 2, 2]}]}}",
            ":14:52: ",
            "regions.near.boxes.0: no cell's middle is in this box: the body spans",
        ),
        (
            "  cell: 0.01\n",
            "  fixed: [{min: [-1, -1, -1], max: [2, 2, 2]}]\n  cell: 0.01\n",
            ":6:10: ",
            "body.fixed: all of the body is clamped, and nothing moves; make the boxes smaller",
        ),
        ("close: 0.02", "close: 0.6", ":13:5: ", "motion.1: right moves half its thickness in a step of 10 ms"),
        (
            "{hold: 0.05}",
            "{tools: [left], turn: [0, 0, 90], speed: 1}",
            ":12:27: ",
            "motion.0.turn: 90 rad are 14.3 full turns; is it in rad, not in degrees?",
        ),
        (
            "{hold: 0.05}",
            "{tools: [left], move: [0, 0, 20], speed: 0.1}",
            ":12:27: ",
            "motion.0.move: 20 m are 1e+03 times the body's 0.02 m; is it in m, not in mm?",
        ),
        (
            "until: {time: 0.05}",
            "until: {force: 2}",
            ":13:48: ",
            "motion.1.until: 2 N may never be reached, and then the run does not end: give `time`",
        ),
        (
            "{tools: [left, right], close: 0.02, until: {time: 0.05}}\n",
            "{tools: [left], move: [0.01, 0, 0], speed: 0.1}\nquantities: [sag, grip_force]\n",
            ":14:13: ",
            "quantities: grip_force: no phase of the motion closes two tools",
        ),
        ("regions:", "quantities: [grip_force, compression]\nregions:", "", ""),
        ("until: {time: 0.05}", "until: {force: 2, compression: 0.5}", "", ""),
        ("{hold: 0.05}", "{tools: [left], move: [0, 0, 0.5], speed: 0.1}", "", ""),
        ("{hold: 0.05}", "{tools: [left], turn: [0, 0, 6.3], speed: 1}", "", ""),
        ("{pbd: {substeps: 40}}", "{fem: {element: tet4}}", ":15:25: ", "models.fem.element: tet4 is too"),
        (
            "{hold: 0.05}",
            "{tools: [left], move: [-0.3, 0, 0], speed: 0.6, acceleration: 3}",
            ":12:5: ",
            "motion.0: left moves half its thickness in a step of 10 ms",
        ),
    ],
    ids=[
        "steady",
        "few substeps",
        "young",
        "size",
        "viscosity",
        "no node",
        "no cell",
        "all nodes",
        "too swift a tool",
        "degrees",
        "millimetres",
        "a force alone",
        "no grip",
        "a grip",
        "a force or a squeeze",
        "a long way",
        "one full turn",
        "an element that locks",
        "fast in the middle",
    ],
)
def test_a_warning_tells_where(tmp_path: Path, old: str, new: str, place: str, words: str) -> None:
    path, said = tmp_path / "cube.yaml", StringIO()
    text = SCENE.replace(old, new)
    path.write_text(text.replace("default: pbd", "default: fem") if "{fem:" in new else text)
    check_scene(str(path), (), Console(file=said, width=1000))
    warnings = [line for line in said.getvalue().splitlines() if line.startswith("warning")]
    assert any(line.startswith(f"warning: {path}{place}{words}") for line in warnings) if words else not warnings


@pytest.mark.parametrize(
    "setting", ["body.shape.size=[0.02, 6, 0.02]", "body.shape={kind: block, size: [0.02, 6, 0.02]}", "body.cell=0.6"]
)
def test_a_warning_of_what_a_setting_changed_names_the_setting(tmp_path: Path, setting: str) -> None:
    """Whether that is the key warned of, one in it, or one that it lies in; others leave file and line."""
    path, said = tmp_path / "cube.yaml", StringIO()
    path.write_text(SCENE.replace("[0.02, 0.02, 0.02]", "[0.02, 6, 0.02]").replace("cell: 0.01", "cell: 0.5"))
    check_scene(str(path), (setting,), Console(file=said, width=1000))
    warned = [line for line in said.getvalue().splitlines() if "6 m from end to end" in line]
    where = f"{path}:5:10: " if "cell" in setting else f"--set {setting}: "
    assert [line.partition("body.shape: 6")[0] for line in warned] == [f"warning: {where}"]
