"""A look before the run: where tools go if nothing pushes back, what of them touches first, and the picture of it."""

from __future__ import annotations

import os
import subprocess
import sys
from io import StringIO
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from rich.console import Console
from solids import box, obj

import softseam
from softseam.checking import check_scene
from softseam.errors import BadInput
from softseam.view.scene_picture import _tool
from softseam.view.tool_shapes import tool_shapes
from softseam_protocol.scene.file import load_scene
from softseam_services.orchestrator.preview import Preview, preview
from softseam_services.server import Setup, build_setup

pytestmark = pytest.mark.kernels

SCENE = """softseam: 1
name: look
step: 0.01
regions: {default: pbd}
body:
  shape: {kind: block, size: [0.04, 0.04, 0.03]}
  cell: 0.02
  material: {young: 2.0e4, poisson: 0.4, density: 1000}
tools:
  ground: {kind: plane}
  left: {kind: box, size: [0.01, 0.02, 0.02], position: [-0.035, 0, 0.02]}
  right: {kind: mesh, path: finger.obj, position: [0.035, 0, 0.02]}
motion:
  - MOTION
  - {hold: 0.5}
  - {tools: [left, right], move: [0, 0.01, 0.03], speed: 0.05}
  - {tools: [left, right], turn: [0, 0, 1.5707963], speed: 1.0}
"""


def ahead(folder: Path, motion: str) -> tuple[Setup, Preview]:
    (folder / "finger.obj").write_bytes(obj(*box((0.01, 0.02, 0.02))))
    (folder / "look.yaml").write_text(SCENE.replace("MOTION", motion))
    loaded = load_scene(folder / "look.yaml")
    setup = build_setup(loaded.bundle)
    return setup, preview(loaded.scene, {"body": setup.body}, setup.tools)


FORCE = "{tools: [left, right], close: 0.02, force: 1.0, until: {force: 0.9, time: 3.0}}"
MOTIONS = {"by a force": (FORCE, 0.025), "by way": (FORCE.replace("force: 1.0, until: {force: 0.9, time: 3.0}",
                                                                  "until: {compression: 0.25}"), 0.02)}  # fmt: skip


@pytest.mark.parametrize(("motion", "gap"), MOTIONS.values(), ids=MOTIONS.keys())
def test_tools_go_where_the_motion_takes_them(tmp_path: Path, motion: str, gap: float) -> None:
    """They close until they touch, or to three quarters of 4 cm; rise by 3 cm; turn by 90 degrees about the middle."""
    _, found = ahead(tmp_path, motion)
    _, left, right = found.position[-1]
    np.testing.assert_allclose(left, [0.0, 0.01 - gap, 0.05], atol=3e-4)  # a step of .2 mm
    np.testing.assert_allclose(right, [0.0, 0.01 + gap, 0.05], atol=3e-4)
    np.testing.assert_allclose(np.abs(found.orientation[-1, 1]), [0.5**0.5, 0, 0, 0.5**0.5], atol=1e-6)
    np.testing.assert_allclose(found.orientation[0, :, 0], 1.0)
    assert found.touch[0] == 0, "the body stands on the ground"
    for tool in (1, 2):
        assert abs(found.position[found.touch[tool], tool, 0]) == pytest.approx(0.025, abs=3e-4)
    assert len(found.position) < 700, "steps in which nothing moves are left out"


def test_the_side_that_grips_is_what_touches_first(tmp_path: Path) -> None:
    """Of a box its face towards the body, of a mesh likewise, both where they start; of neither anything else."""
    setup, found = ahead(tmp_path, FORCE)
    mesh = found.surfaces["body"]
    skin = mesh.point_rest[mesh.triangles]
    shapes = tool_shapes(setup.scene, 0.04, mesh.tools)
    for number, x in ((1, -0.03), (2, 0.03)):
        tool = _tool(
            shapes[number],
            found.position[:, number],
            found.orientation[:, number],
            int(found.touch[number]),
            skin,
            number,
        )
        assert len(tool.touching) > 10
        np.testing.assert_allclose(tool.touching[..., 0], x, atol=1e-9)


def test_a_belt_that_is_much_larger_than_the_body(tmp_path: Path) -> None:
    """It reaches behind the eye; its name and its way are where it touches."""
    belt = "ground: {kind: box, size: [1.0, 0.3, 0.02], position: [0.3, 0, -0.01]}"
    text = SCENE.replace("ground: {kind: plane}", belt).replace("left, right", "ground")
    (tmp_path / "finger.obj").write_bytes(obj(*box((0.01, 0.02, 0.02))))
    (tmp_path / "look.yaml").write_text(text.replace("MOTION", "{tools: [ground], move: [0.18, 0, 0], speed: 0.3}"))
    check_scene(str(tmp_path / "look.yaml"), (), Console(file=StringIO()), tmp_path / "look.png")
    assert (tmp_path / "look.png").is_file()
    setup = build_setup(load_scene(tmp_path / "look.yaml").bundle)
    look = preview(setup.scene, {"body": setup.body}, setup.tools)
    mesh = look.surfaces["body"]
    shape = tool_shapes(setup.scene, 0.04, mesh.tools)[0]
    skin = mesh.point_rest[mesh.triangles]
    tool = _tool(shape, look.position[:, 0], look.orientation[:, 0], int(look.touch[0]), skin, 0)
    np.testing.assert_allclose(tool.middle, 0.0, atol=0.01)
    np.testing.assert_allclose(tool.way[0], tool.middle)


def test_a_picture_from_a_session(tmp_path: Path) -> None:
    ahead(tmp_path, FORCE)
    with softseam.open(tmp_path / "look.yaml") as sim:
        path = sim.picture(tmp_path / "new" / "look.png")
        with pytest.raises(BadInput, match=r"ends in \.png"):
            sim.picture(tmp_path / "look.jpg")
    pixels = matplotlib.image.imread(path)[..., :3]
    red = (pixels[..., 0] > 0.7) & (pixels[..., 1] < 0.35)
    assert pixels.shape[0] > 900 and 0.0005 < red.mean() < 0.05


@pytest.mark.slow
def test_check_draws_without_a_screen_and_without_solvers(tmp_path: Path) -> None:
    """To scene.png where no name is given, whatever follows; both by one process."""
    ahead(tmp_path, FORCE)
    code = (
        "import sys; from softseam.cli import main\n"
        "for sys.argv[1:] in ARGS:\n"
        "    try:\n        main()\n    except SystemExit as ended:\n        assert not ended.code\n"
        "    finally:\n"
        "        assert not [name for name in sys.modules if name.endswith(('fem.solver', 'pbd.solver'))]"
    )
    hidden = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    commands = [
        ["check", "look.yaml", "--picture", "--set", "step=0.02"],
        ["check", "--picture", "own.png", "look.yaml"],
    ]
    run = [sys.executable, "-c", code.replace("ARGS", repr(commands))]
    done = subprocess.run(run, cwd=tmp_path, env=hidden, capture_output=True, text=True, timeout=120, check=False)
    for name in ("scene.png", "own.png"):
        assert f"picture: {name}" in done.stdout and (tmp_path / name).is_file(), done.stdout + done.stderr
    assert "AssertionError" not in done.stderr, done.stderr


def test_a_picture_takes_no_file_that_the_scene_is_read_from(tmp_path: Path) -> None:
    ahead(tmp_path, FORCE)
    (tmp_path / "look.yaml").rename(tmp_path / "look.png")

    with pytest.raises(BadInput, match="that is the scene itself"):
        check_scene(str(tmp_path / "look.png"), (), Console(file=StringIO()), tmp_path / "look.png")
