"""A scene whose friction varies over a body says so: in `softseam check`, and at the end of a run."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

import softseam
from softseam.checking import check_scene
from softseam.closing import print_closing
from softseam.report import ReportBuilder
from softseam.scenes import bundle_of

pytestmark = pytest.mark.kernels

CUBE = """\
softseam: 1
name: cube
step: 0.005
duration: 0.02
body:
  shape: {kind: block, size: [0.04, 0.04, 0.04]}
  cell: 0.02
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
  friction_field: {spread: 0.3, length: 0.012, seed: 4}
tools:
  ground: {kind: plane, friction: 0.5}
regions: {default: pbd}
"""
SHEET = """\
softseam: 1
name: sheet
duration: 0.02
body: {kind: sheet, size: [0.1, 0.1], divisions: [10, 10], density: 0.2, stretch: 100, friction_field: {spread: 0.3, length: 0.02}}
tools:
  ground: {kind: plane, point: [0, 0, -0.01], friction: 0.5}
"""  # noqa: E501 - a scene's line


def said(folder: Path, text: str) -> str:
    path = folder / "scene.yaml"
    path.write_text(text)
    console = Console(record=True, width=400, file=io.StringIO())
    check_scene(str(path), (), console)
    return console.export_text()


@pytest.mark.parametrize(
    ("scene", "long", "short", "apart", "remedy", "place"),
    [
        (CUBE, "0.012", "0.009", "10 mm", "shorter cells", "9:41"),
        (SHEET, "0.02", "0.009", "10 mm", "more divisions", "4:126"),
    ],
    ids=["cells", "particles"],
)
def test_a_check_tells_how_friction_varies_and_where_points_miss_it(
    tmp_path: Path, scene: str, long: str, short: str, apart: str, remedy: str, place: str
) -> None:
    """Points of the cube are 10 mm apart, half a cell; those of the sheet a spacing."""
    told = said(tmp_path, scene)
    length = f"{1e3 * float(long):g} mm"
    assert f"varies by 30 % over {length} (seed" in told and "times the tools' own" in told
    assert "warning" not in told
    told = said(tmp_path, scene.replace(f"length: {long}", f"length: {short}"))
    warning = next(line for line in told.splitlines() if "warning" in line)
    assert f"scene.yaml:{place}: body.friction_field.length" in warning
    assert "friction varies over 9 mm" in warning and f"{apart} apart" in warning and remedy in warning


@pytest.mark.parametrize("even", [False, True])
def test_a_run_tells_how_friction_varied(tmp_path: Path, even: bool) -> None:
    path = tmp_path / "cube.yaml"
    path.write_text("".join(line for line in CUBE.splitlines(True) if not (even and "friction_field" in line)))
    report = ReportBuilder(bundle_of(path)[1])
    with softseam.open(path) as sim:
        sim.run(lambda seen: report.add(seen.report))
    built = report.build()
    console = Console(record=True, width=200, file=io.StringIO())
    print_closing(console, built)
    expected = "" if even else "varies by 30 % over 12 mm (seed 4)"
    assert built["uneven_friction"] == expected
    assert ("friction varies" in console.export_text()) != even
