"""docs/start: what a newcomer types does what the pages say."""

from __future__ import annotations

import re
import shutil
from io import StringIO
from pathlib import Path

import matplotlib
import pytest
from rich.console import Console

import softseam
from softseam.checking import check_scene

ROOT = Path(__file__).parents[2]
START = ROOT / "docs" / "start"


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (START / page).read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.kernels
def test_programs_measure_forces(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The first draws a curve and prints the largest force; the second grips until 5 N are felt."""
    matplotlib.use("Agg")
    first, second = blocks("forces-in-python.md", "python")
    here: dict[str, list[float]] = {}
    exec(compile(first, "forces-in-python.md", "exec"), here)
    assert (folder / "forces.png").stat().st_size > 10_000
    assert f"largest grip force {max(here['grip']):.2f} N" in capsys.readouterr().out
    assert min(force[0] for force in here["left"]) < -5.0  # type: ignore[index]  # of the body on the left plate: -x
    exec(compile(second, "forces-in-python.md", "exec"), {})
    assert float(capsys.readouterr().out.split()[0]) > 5.0


@pytest.mark.slow
@pytest.mark.kernels
def test_the_mesh_is_gripped(folder: Path) -> None:
    """The scene as printed, with the mesh that the page names: it is checked without complaint, gripped and lifted."""
    shutil.copy(ROOT / "scenes" / "dumpling.obj", folder / "mine.obj")
    (scene,) = blocks("own-mesh.md", "yaml")
    (folder / "mine.yaml").write_text(scene, encoding="utf-8")
    check_scene("mine.yaml", (), Console(file=StringIO(), width=200))
    said = re.search(r"lift height +([0-9.]+) mm", (START / "own-mesh.md").read_text(encoding="utf-8"))
    assert said
    with softseam.open("mine.yaml") as sim:
        seen = sim.reset()
        while not sim.done:
            seen = sim.step()
    assert seen.quantities["lift_height"] * 1e3 == pytest.approx(float(said[1]), abs=0.05)  # as the page prints it
    assert seen.grip_force == pytest.approx(1.0, rel=0.02)  # the force that the scene holds
