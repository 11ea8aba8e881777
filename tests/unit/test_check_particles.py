"""`softseam check` tells what holds a sheet or rope, and how hard that is to sweep."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from softseam.app import app

pytestmark = pytest.mark.kernels

SHEET = """
softseam: 1
name: towel
duration: 0.1
step: 0.01
gravity: [0, 0, -9.81]
body: {kind: sheet, size: [0.2, 0.2], divisions: [10, 10], density: 0.2, stretch: 1000, constraints: [ADDED]}
"""
HINGES = "{kind: hinge, bending: 1.0e-4}"


def check(scene: str) -> str:
    result = CliRunner().invoke(app, ["check", scene], env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    return str(result.output)


def test_a_sheet_s_hinges_are_counted(tmp_path: Path) -> None:
    """Of 10 x 10 cells: 9 in each of 11 rows and 11 columns, and one a cell."""
    said = {}
    for added in ("", HINGES):
        file = tmp_path / "towel.yaml"
        file.write_text(SHEET.replace("ADDED", added))
        said[added] = check(str(file))
    assert "298 of kind hinge" in said[HINGES]
    assert "of kind" not in said[""]


def test_jacobi_s_radius_suggests_an_omega_for_a_rope_and_none_for_a_towel() -> None:
    assert "suggests omega = 1." in check("rope")
    assert "diverges" in check("cloth_fold")


def test_a_sheet_in_short_substeps_converges_without_an_omega(tmp_path: Path) -> None:
    """Its springs are no chain: Young's formula is not its."""
    file = tmp_path / "towel.yaml"
    file.write_text(SHEET.replace("ADDED", "") + "models: {pbd: {substeps: 200}}\n")
    said = check(str(file))
    assert "converges" in said and "omega" not in said
