"""Bad input on the command line: exit code 2, one message that names the trouble and the remedy, no traceback.

What was begun and failed has exit code 1.
"""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from softseam import cli, connected, errors
from softseam_studies.study.planner import NoPlan

GOOD = """\
softseam: 1
name: cube
duration: 0.1
body:
  shape: {kind: block, size: [0.02, 0.02, 0.02]}
  cell: 0.01
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
tools:
  ground: {kind: plane, friction: 0.5}
"""

BAD_SCENES = {
    "unknown key": (GOOD + "gravitas: [0, 0, -9.81]\n", ["bad.yaml:10", "gravitas", "gravity"]),
    "wrong type": (GOOD.replace("young: 2.0e4", "young: soft"), ["bad.yaml:7", "body.material.young"]),
    "poisson": (GOOD.replace("0.45", "0.5"), ["bad.yaml:7", "body.material.poisson", "0.5"]),
    "density": (GOOD.replace("density: 1000", "density: -1"), ["bad.yaml:7", "density"]),
    "not a scene": ("just words\n", ["bad.yaml:1"]),
    "broken yaml": ("a: [1, 2\n", ["bad.yaml:"]),
    "missing mesh": (
        GOOD.replace("{kind: block, size: [0.02, 0.02, 0.02]}", "{kind: mesh, path: none.vtk}"),
        ["none.vtk", "body.shape.path"],
    ),
    "other version": (GOOD.replace("softseam: 1", "softseam: 7"), ["bad.yaml:1", "softseam"]),
    "tool inside": (
        GOOD + "  ball: {kind: sphere, radius: 0.005, position: [0, 0, 0.018]}\n",
        ["bad.yaml:10:9: tools.ball: it starts", "move it clear"],
    ),
    "too few substeps of leapfrog": (
        GOOD.replace("tools:\n  ground: {kind: plane, friction: 0.5}\n", "")
        + "regions: {default: pbd}\nmodels: {pbd: {method: leapfrog, substeps: 1}}\nstep: 0.01\n",
        ["bad.yaml:9:44: models.pbd.substeps: leapfrog is unstable with 1 substeps in 0.01 s", "leave it out"],
    ),
    "goal of too many cells": (
        GOOD.replace("cell: 0.01", "cell: 0.0012") + "probes: {inside: [0, 0, 0.01]}\nregions: {goal: inside}\n",
        ["bad.yaml:11:17: regions.goal: ", "unknowns", "body.cell"],
    ),
    "probe outside": (
        GOOD + "probes: {above: [0, 0, 0.03]}\n",
        ["bad.yaml:10:", "probes.above: [0.0, 0.0, 0.03]", "name a point inside"],
    ),
}

FEM_CONFIG = str(Path(__file__).parents[2] / "scenes" / "templates" / "fem_config.yaml")
BAD_CALLS = {
    "no such scene": (["run", "tofu_gras"], ["tofu_grasp"]),
    "no route": (["up", "--route", "far"], ["'far' is no route", "PART=SERVICE"]),
    "a route of no part": (["up", "--route", "far=mine"], ["'far=mine' is no route", "body.far=my_solver"]),
    "no router to conform": (["conform", "tcp/127.0.0.1:9", "--service", "fem"], ["no router answers"]),
    "no such check": (["conform", "tcp/127.0.0.1:9", "--check", "momentun"], ["did you mean 'momentum'"]),
    "no such file": (["run", "folder/none.yaml"], ["none.yaml"]),
    "no such model": (["run", "tofu_grasp", "--model", "magic"], ["magic", "hybrid"]),
    "no such command": (["simulate"], ["simulate"]),
    "no such option": (["run", "tofu_grasp", "--fast"], ["--fast"]),
    "set without value": (["run", "tofu_grasp", "--set", "step"], ["key=value"]),
    "set unknown tool": (["run", "tofu_grasp", "--set", "tools.lefft.friction=1"], ["lefft", "left"]),
    "set bad value": (["run", "tofu_grasp", "--set", "step=-1"], ["step", "-1"]),
    "hybrid without tools": (["run", "GOOD", "--model", "hybrid", "--set", "tools={}"], ["no tools", "near"]),
    "recording's name": (["run", "tofu_grasp", "--record", "run.txt"], [".mcap"]),
    "report is a folder": (["run", "tofu_grasp", "--report", "."], ["--report .", ".json"]),
    "report over its scene": (
        ["run", "good.json", "--report", "./good.json"],
        ["--report good.json", "the scene itself"],
    ),
    "report of another kind": (["run", "GOOD", "--report", "GOOD"], ["--report GOOD.yaml", ".json"]),
    "report twice": (["run", "GOOD", "--report", "x.json", "--pictures", "x.json"], ["--pictures x.json", "--report"]),
    "pictures into a file": (["run", "GOOD", "--pictures", "bad.yaml"], ["--pictures bad.yaml", "a file"]),
    "report of a name too long": (["run", "GOOD", "--report", 300 * "x" + ".json"], ["too long"]),
    "calibration over its scene": (["calibrate", "good.json", "--report", "good.json"], ["the scene itself"]),
    "chart over its scene": (["chart", "chart.json", "--out", "."], ["--out chart.json", "the scene itself"]),
    "chart over its rivals": (["chart", "tofu_grasp", "--out", ".", "--rivals", "chart.json"], ["--rivals"]),
    "chart into a file": (["chart", "tofu_grasp", "--out", "bad.yaml"], ["bad.yaml"]),
    "atlas into a file": (["atlas", "--out", "bad.yaml"], ["--out bad.yaml", "a file"]),
    "demo over its scene": (
        ["demo", "--scene", "report.json", "--out", "."],
        ["--out report.json", "the scene itself"],
    ),
    "schema into a folder": (["schema", "--out", "."], ["--out", "a folder"]),
    "schema into what is no folder": (["schema", "--out", "bad.yaml/schema.json"], ["bad.yaml/schema.json"]),
    "import of a scene": (["import", "GOOD"], ["GOOD.yaml:1:1: ", "fem_config or pbd_config"]),
    "import over a file": (["import", FEM_CONFIG, "--out", "bad.yaml"], ["--out bad.yaml", "is there already"]),
    "import under another name": (["import", FEM_CONFIG, "--out", "run.txt"], ["--out run.txt", ".yaml"]),
    "no router": (["run", "tofu_grasp", "--connect", "tcp/127.0.0.1:1"], ["tcp/127.0.0.1:1", "softseam up"]),
    "no recording": (["replay", "none.mcap"], ["none.mcap"]),
    "chart of a mesh's own cells": (["chart", "calamari"], ["calamari.yaml:8:", "its own", "body.shape.cells=boxes"]),
    "plan of a mesh's own cells": (
        ["plan", "calamari", "--tolerance", "0.1", "--set", "body.shape.cells=own"],
        ["--set body.shape.cells=own: body.shape.cells: ", "its own", "body.shape.cells=boxes"],
    ),
    "chart of nothing": (["chart", "GOOD"], ["quantities"]),
    "chart in no time": (["chart", "tofu_grasp", "--minutes", "0"], ["--minutes"]),
    "chart without rivals": (["chart", "tofu_grasp", "--rivals", "none.json"], ["none.json"]),
    "foreign recording": (["replay", "bad.yaml"], ["bad.yaml"]),
    "replay's name": (["replay", "bad.yaml", "--save", "run.txt"], ["run.txt", ".rrd"]),
}

COPIES = ("good.json", "chart.json", "report.json")
"""scenes whose names are those of outputs"""


def call(arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr("sys.argv", ["softseam", *arguments])
    try:
        return cli.main()
    except SystemExit as exit_:
        return int(exit_.code or 0)


@pytest.fixture
def folder(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setattr(connected, "CONNECT_TIMEOUT", 0.5)
    (tmp_path / "GOOD.yaml").write_text(GOOD)
    (tmp_path / "bad.yaml").write_text("softseam: 1\n")
    return tmp_path


def assert_refused(
    arguments: list[str], words: list[str], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    assert call(arguments, monkeypatch) == 2
    told = capfd.readouterr()
    assert told.out == ""
    assert "Traceback" not in told.err
    assert len(re.findall(r"^error: |─ Error ─", told.err, re.MULTILINE)) == 1, told.err
    for word in words:
        assert word in told.err


@pytest.mark.kernels
@pytest.mark.parametrize("name", BAD_SCENES)
@pytest.mark.parametrize("command", ["run", "check"])
def test_bad_scene(
    name: str, command: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    text, words = BAD_SCENES[name]
    (folder / "bad.yaml").write_text(text)
    assert_refused([command, "bad.yaml"], words, monkeypatch, capfd)


@pytest.mark.kernels
@pytest.mark.parametrize("name", BAD_CALLS)
def test_bad_call(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    arguments, words = BAD_CALLS[name]
    arguments = ["GOOD.yaml" if argument == "GOOD" else argument for argument in arguments]
    copies = [folder / name for name in arguments[1:] if name in COPIES]
    for copy in copies:
        copy.write_text('{"rivals": []}' if "--rivals" in arguments else GOOD + "quantities: [sag]\n")
    assert_refused(arguments, words, monkeypatch, capfd)
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        ["GOOD.yaml", "bad.yaml", *(copy.name for copy in set(copies))]
    )  # nothing half-written
    assert all(copy.read_text() in (GOOD + "quantities: [sag]\n", '{"rivals": []}') for copy in copies)


FAILURES = [
    errors.SimulationFailed,
    errors.ServicesFailed,
    errors.SchemaMismatch,
    errors.SessionClosed,
    errors.SoftseamError,
    NoPlan,
]
REFUSALS = [errors.SceneRefused, errors.BadInput, errors.BadSnapshot, errors.MissingExtra, errors.NoConnection]


@pytest.mark.parametrize(("kind", "code"), [*((kind, 1) for kind in FAILURES), *((kind, 2) for kind in REFUSALS)])
def test_what_failed_has_another_exit_code_than_what_was_refused(
    kind: type[errors.SoftseamError],
    code: int,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    def broken(*_: object) -> None:
        raise kind("it went wrong")

    monkeypatch.setattr("softseam.running.run", broken)
    assert call(["run", "GOOD.yaml"], monkeypatch) == code
    assert capfd.readouterr().err == "error: it went wrong\n"


@pytest.mark.kernels
def test_what_there_is_too_little_time_for_has_failed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    short = ["--set", "quantities=[sag]", "--tolerance", "0.1", "--minutes", "1e-9"]
    assert call(["plan", "GOOD.yaml", *short], monkeypatch) == 1
    assert "give more --minutes" in capfd.readouterr().err


def test_internal_error_is_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """What nobody foresaw ends with exit code 1, one line, and the way to its traceback."""

    def broken(*_: object) -> None:
        raise RuntimeError("the cat\nate it")

    monkeypatch.setattr("softseam.running.run", broken)
    assert call(["run", "GOOD.yaml"], monkeypatch) == 1
    told = capfd.readouterr().err
    assert "internal error" in told and "SOFTSEAM_TRACEBACK=1" in told and "Traceback" not in told
    monkeypatch.setenv("SOFTSEAM_TRACEBACK", "1")
    with pytest.raises(RuntimeError):
        call(["run", "GOOD.yaml"], monkeypatch)


def test_help_teaches(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    """Every command's help has an example or needs none."""
    for command in ("run", "demo", "replay", "check"):
        assert call([command, "--help"], monkeypatch) == 0
        assert f"softseam {command}" in capfd.readouterr().out


def test_schema(folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    assert call(["schema"], monkeypatch) == 0
    assert '"Scene"' in capfd.readouterr().out


def test_packages_that_an_extra_must_bring_are_in_its_lock() -> None:
    """One that was left out of the lock was asked for still, and nothing started where it was not installed."""
    locked = set(re.findall(r"^([\w.-]+)==", (Path(__file__).parents[2] / "requirements-dev.lock").read_text(), re.M))
    brought_by = packages_distributions()
    for package, extra in errors.EXTRA_OF.items():
        if extra in ("solve", "view", "gym", "camera"):
            assert locked & {name.lower().replace("_", "-") for name in brought_by.get(package, [package])}, package


@pytest.mark.kernels
def test_the_package_runs_as_a_module() -> None:
    """As `softseam` does, with its exit codes."""
    command = [sys.executable, "-m", "softseam", "check", "nowhere.yaml"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2
    assert "nowhere.yaml" in done.stderr
