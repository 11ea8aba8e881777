"""`softseam fit` finds the numbers of scenes that made the curves, and says what a curve does not tell."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from gradient_cases import grasp
from rich.console import Console

import softseam
from softseam.errors import BadInput
from softseam_protocol.scene.file import scene_json
from softseam_studies.cli_fitting import Fit as Wishes
from softseam_studies.fit.command import fit_scene
from softseam_studies.fit.least_squares import Answer

SQUEEZE: list[dict[str, Any]] = [
    {"tools": ["left", "right"], "close": 0.02, "until": {"compression": 0.15}},
    {"hold": 0.05},
]
LIFT: list[dict[str, Any]] = [
    {"tools": ["left", "right"], "close": 0.04, "until": {"compression": 0.12}},
    {"tools": ["left", "right"], "move": [0, 0, 0.02], "speed": 0.1},
]


def _scene(motion: list[dict[str, Any]], young: float, friction: float) -> softseam.Scene:
    document = json.loads(scene_json(grasp(friction, tolerance=3e-5, motion=motion)))
    document["body"]["material"]["young"] = young
    document["duration"] = None
    return softseam.Scene.model_validate_json(json.dumps(document))


def _measured(scene: softseam.Scene, columns: list[str], noise: float = 0.0) -> np.ndarray:
    """Times and forces of a run, each force off by a share that is drawn."""
    rows: list[list[float]] = []

    def see(seen: softseam.Observation) -> None:
        forces = {tool: wrench[:3] for tool, wrench in seen.wrench.items()}
        row = [seen.time]
        for column in columns:
            tool, _, axis = column.partition(".")
            row.append(float(forces[tool]["xyz".index(axis)] if axis else np.linalg.norm(forces[tool])))
        rows.append(row)

    with softseam.open(scene) as sim:
        sim.run(see)
    table = np.array(rows)
    table[:, 1:] *= 1.0 + noise * np.random.default_rng(2).standard_normal(table[:, 1:].shape)
    return table


def _fit(
    tmp_path: Path, start: softseam.Scene, table: np.ndarray, columns: list[str], find: str, out: Path | None = None
) -> tuple[Answer, str]:
    scene, curve = tmp_path / "scene.yaml", tmp_path / "curve.csv"
    scene.write_text(yaml.safe_dump(json.loads(scene_json(start))))
    lines = [",".join(["time", *columns]), *(",".join(repr(float(v)) for v in row) for row in table)]
    curve.write_text("\n".join(lines))
    console = Console(width=200, record=True, quiet=False, file=(tmp_path / "told").open("w"))
    answer = fit_scene(Wishes(str(scene), curve, find, out), console)
    return answer, console.export_text()


@pytest.mark.parametrize(("young", "noise", "off"), [(26.4e3, 0.0, 1e-3), (12e3, 0.0, 1e-3), (26.4e3, 0.05, 0.02)])
def test_a_modulus_is_found_from_a_squeeze(tmp_path: Path, young: float, noise: float, off: float) -> None:
    table = _measured(_scene(SQUEEZE, young, 0.6), ["left"], noise)
    answer, told = _fit(tmp_path, _scene(SQUEEZE, 20e3, 0.6), table, ["left"], "young", tmp_path / "fitted.yaml")
    assert answer.values[0] == pytest.approx(young, rel=off)
    assert answer.settled and answer.runs <= 6 and f"fitted in {answer.runs} runs" in told
    assert all(f"run {run}: young " in told for run in range(1, answer.runs + 1))
    if noise > 0.0:
        assert abs(answer.values[0] - young) < 3.0 * answer.errors[0] < 0.05 * young
    fitted = softseam.load_scene(tmp_path / "fitted.yaml")
    assert fitted.body.material.young == pytest.approx(answer.values[0])  # type: ignore[attr-defined]


def test_modulus_and_friction_are_found_from_a_lift(tmp_path: Path) -> None:
    columns = ["left.x", "left.z"]
    table = _measured(_scene(LIFT, 15e3, 0.2), columns)
    answer, told = _fit(tmp_path, _scene(LIFT, 20e3, 0.3), table, columns, "young,friction")
    np.testing.assert_allclose(answer.values, [15e3, 0.2], rtol=0.01)
    assert answer.settled and answer.runs <= 10
    assert "--set tools.ground.friction=0." in told and "--set body.material.young=1" in told


def test_friction_of_what_touches_nothing_is_not_told(tmp_path: Path) -> None:
    """A shelf that nothing is laid on: its friction stays as it was, and the modulus is found beside it."""
    shelf = {"shelf": {"kind": "box", "size": [0.1, 0.1, 0.01], "position": [0, 0, 0.3], "friction": 0.7}}

    def with_shelf(young: float) -> softseam.Scene:
        document = json.loads(scene_json(_scene(SQUEEZE, young, 0.6)))
        document["tools"] |= shelf
        return softseam.Scene.model_validate_json(json.dumps(document))

    table = _measured(with_shelf(26.4e3), ["left"])
    answer, told = _fit(tmp_path, with_shelf(20e3), table, ["left"], "young,friction.shelf")
    assert list(answer.untold) == [1] and answer.values[1] == 0.7
    assert answer.values[0] == pytest.approx(26.4e3, rel=1e-3)
    assert "cannot be determined: the curve does not change with it" in told


def test_bad_wishes_are_refused(tmp_path: Path) -> None:
    scene, table = _scene(SQUEEZE, 20e3, 0.6), np.array([[0.1, 1.0], [9.0, 1.0]])
    for find, words in (
        ("yuong", r"--find yuong: nothing is called 'yuong'; did you mean 'young'\?"),
        ("young,young", "name each number once"),
        ("young", "times go to 9 s, and the scene's run ends at"),
    ):
        with pytest.raises(BadInput, match=words):
            _fit(tmp_path, scene, table, ["left"], find)
