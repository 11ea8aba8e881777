"""Surrogates: polynomials in place of runs, what they claim to be off by, and what they refuse."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import softseam
from softseam.app import app
from softseam.errors import BadInput, SimulationFailed
from softseam_studies.surrogate import Surrogate
from softseam_studies.surrogate.learn import Curve, common_squeezes, fitted, learn
from softseam_studies.surrogate.surrogate import Floats, Varied, spread

VARIED = (Varied("body.material.young", 10e3, 40e3), Varied("body.material.poisson", 0.3, 0.48))
SQUEEZE = np.linspace(0.01, 0.3, 40)


def _press(young: float, poisson: float, squeeze: Floats) -> Floats:
    """A force that no polynomial is."""
    return np.asarray(1e-4 * young * squeeze**1.1 / (1.0 - 1.6 * poisson) * (1.0 + squeeze * np.exp(poisson)))


def _curve(point: Floats) -> Curve:
    young, poisson = (one.value(float(at)) for one, at in zip(VARIED, point, strict=True))
    return SQUEEZE, np.log(_press(young, poisson, SQUEEZE))[None]


def _learned(n: int = 64) -> Surrogate:
    within = spread(n, 2, seed=0)
    curves = [_curve(point) for point in within]
    grid = common_squeezes(curves)
    return Surrogate("press", VARIED, ("grip_force",), grid, *fitted(within, curves, grid), n, 0.0)


def _covered(surrogate: Surrogate, n: int = 400) -> float:
    random, held = np.random.default_rng(5), 0
    low, high = float(surrogate.squeezes[0]), float(surrogate.squeezes[-1])
    for _ in range(n):
        young, poisson, squeeze = random.uniform(10e3, 40e3), random.uniform(0.3, 0.48), random.uniform(low, high)
        told = surrogate.at({VARIED[0].key: young, VARIED[1].key: poisson}, squeeze)["grip_force"]
        held += abs(told.value - float(_press(young, poisson, np.array(squeeze)))) <= told.claim
    return held / n


def test_claims_cover_what_was_not_run() -> None:
    surrogate = _learned()
    assert _covered(surrogate) >= 0.95
    assert _covered(replace(surrogate, claims=0.1 * surrogate.claims)) < 0.9  # they are no wider than they need be
    assert float(surrogate.claims.max()) < 0.03


@pytest.mark.kernels
def test_a_scene_is_told_as_fem_finds_it(tmp_path: Path) -> None:
    """Pieces that were not run, at every step of theirs; by hand, without the session that made the surrogate."""
    settings = ["motion=[{tools: [left, right], close: 0.02, until: {compression: 0.15}}]", "body.cell=0.025"]
    young, friction = "body.material.young", "tools.left.friction+tools.right.friction"
    varied = [Varied(young, 10e3, 40e3), Varied(friction, 0.3, 0.8)]
    learn("tofu_grasp", varied, ["grip_force", "peak_von_mises"], 20, settings).write(tmp_path / "tofu.json")
    surrogate = Surrogate.read(tmp_path / "tofu.json")
    off = []
    for stiff, rough in ((13e3, 0.7), (35e3, 0.35), (20e3, 0.5)):
        chosen = [f"{young}={stiff}", *(f"tools.{pad}.friction={rough}" for pad in ("left", "right"))]
        with softseam.open("tofu_grasp", model="fem", settings=[*settings, *chosen]) as session:
            session.reset()
            squeeze = 0.0
            while squeeze < 0.14:
                seen = session.step({"left": [0.02, 0, 0], "right": [-0.02, 0, 0]})
                squeeze = seen.quantities["compression"]
                if surrogate.squeezes[0] <= squeeze <= surrogate.squeezes[-1]:
                    told = surrogate.at({young: stiff, friction: rough}, squeeze)
                    off += [(told[name].value - seen.quantities[name]) / told[name].claim for name in told]
    assert len(off) > 40 and np.mean(np.abs(off) <= 1.0) > 0.9
    assert max(np.expm1(surrogate.claims).max(axis=1)) < 0.1


def test_what_was_not_run_is_refused() -> None:
    surrogate = _learned(24)
    values = {VARIED[0].key: 20e3, VARIED[1].key: 0.4}
    with pytest.raises(BadInput, match=r"body.material.young=90000.0: runs were made from 10000 to 40000"):
        surrogate.at({**values, VARIED[0].key: 90e3}, 0.1)
    with pytest.raises(BadInput, match=r"squeeze=0.6: runs are of 0.015 to 0.3"):
        surrogate.at(values, 0.6)
    with pytest.raises(BadInput, match=r"body.material.poisson: values are wanted of"):
        surrogate.at({VARIED[0].key: 20e3}, 0.1)
    with pytest.raises(BadInput, match=r"density: values are wanted of"):
        surrogate.at({**values, "density": 1.0}, 0.1)


def test_files_that_are_none_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with pytest.raises(BadInput, match="cannot read"):
        Surrogate.read(path)
    _learned(24).write(path)
    whole = path.read_text()
    path.write_text(whole[:-40])
    with pytest.raises(BadInput, match="is no surrogate"):
        Surrogate.read(path)
    document = json.loads(whole)
    for change, words in (({"softseam_surrogate": 9}, "another version"), ({"claims": [[1.0]]}, "another version")):
        path.write_text(json.dumps({**document, **change}))
        with pytest.raises(BadInput, match=words):
            Surrogate.read(path)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "--vary: name what may differ"),
        (["--vary", "body.material.young"], "give KEY=LOW..HIGH"),
        (["--vary", "body.material.young=3..2"], "LOW the less"),
        (["--vary", "body.material.yung=1..2"], "body.material.yung"),
        (["--vary", "body.material.poisson=0.3..0.7"], "poisson"),
        (["--vary", "step=0.01..0.02", "--vary", "step=0.01..0.02"], "step is given twice"),
        (["--vary", "step=0.01..0.02", "--of", "weight"], "no quantity is called so"),
        (["--vary", "step=0.01..0.02", "--runs", "5"], "20 runs at least"),
        (["--vary", "step=0.01..0.02", "--out", "a.txt"], "ends in .json"),
    ],
)
def test_bad_wishes_are_named(
    arguments: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = CliRunner().invoke(app, ["surrogate", "tofu_grasp", "--out", "a.json", *arguments])
    assert found.exit_code and words in str(found.exception)
    assert not (tmp_path / "a.json").exists()


@pytest.mark.kernels
def test_a_scene_that_squeezes_nothing_is_named() -> None:
    with pytest.raises(BadInput, match="is squeezed in 0 steps"):
        learn("cantilever", [Varied("body.material.young", 1e5, 2e5)], ["peak_von_mises"], 20, ["duration=0.01"])


@pytest.mark.kernels
def test_a_run_that_fails_says_with_which_values() -> None:
    high = [f"tools.{pad}.position=[{x}, 0, 0.3]" for pad, x in (("left", -0.02), ("right", 0.02))]
    missing = [*high, "motion=[{tools: [left, right], close: 0.5, until: {force: 5}}]"]
    with pytest.raises(SimulationFailed, match=r"with body.material.young=1\d+\.\d*: .*; vary less, or shorten `step`"):
        learn("tofu_grasp", [Varied("body.material.young", 10e3, 20e3)], ["grip_force"], 20, missing)


def test_runs_that_have_no_squeeze_in_common_are_named() -> None:
    curves = [(squeezes, np.zeros((1, 3))) for squeezes in (np.array([0.01, 0.02, 0.03]), np.array([0.05, 0.1, 0.2]))]
    with pytest.raises(BadInput, match=r"ends squeezed by 0.03, another one's first step squeezes by 0.05: vary less"):
        common_squeezes(curves)
