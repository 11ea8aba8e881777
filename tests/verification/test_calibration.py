"""What `softseam calibrate` measures, against closed forms and against what it should find."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hexahedra import mesh
from pbd_run import block_scene, cantilever

from softseam import cli
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.calibration.measure import Bench, cheapest, oscillation, settings


@pytest.mark.parametrize("damping", [0.0, 0.5, 5.0])
def test_an_oscillation_tells_its_frequency_and_damping(damping: float) -> None:
    t = 0.01 * np.arange(40)
    q = 3.0 * np.exp(-damping * t) * np.cos(20.0 * t + 0.3)
    np.testing.assert_allclose(oscillation(q, 0.01), (20.0, damping), rtol=1e-9, atol=1e-9)
    assert oscillation(np.exp(-t), 0.01)[0] == 0.0


def test_wanted_is_a_beams_frequency() -> None:
    """A clamped beam, ten times as long as high: omega = 3.516 sqrt(E I/(rho A L^4)), shear takes 2 % of it."""
    bench = Bench(*_of(cantilever((0.2, 0.02, 0.02), (0.02, 0.01, 0.01), 1e5, 0.0)))
    euler = 3.5160 * np.sqrt(1e5 * 0.02**2 / 12.0 / 1000.0) / 0.2**2 / (2.0 * np.pi)
    assert 0.965 < bench.wanted.frequency / euler < 0.995
    assert bench.wanted.blocks == pytest.approx(bench.wanted.frequency, rel=0.02)


@pytest.mark.parametrize("clamped", [True, False])
def test_what_is_shown_is_implicit_eulers(clamped: bool) -> None:
    """The blocks' own frequency to 1e-3; after a period exp(-pi omega h) of the amplitude is left, to 5 %."""
    fixed = ({"min": (-1.0, -1.0, -1.0), "max": (-0.0249, 1.0, 1.0)},) if clamped else ()
    bench = Bench(*_of(block_scene((0.05, 0.05, 0.025), 0.025, step=0.01, fixed=fixed)))
    shown = bench.show(120, 1)
    omega = 2.0 * np.pi * bench.wanted.blocks
    assert shown.stable and not shown.auto
    assert abs(shown.time_error) < 1e-3
    assert shown.loss == pytest.approx(1.0 - np.exp(-np.pi * omega * 0.01 / 120), rel=0.05)


def test_damping_is_wanted_and_shown() -> None:
    """b = 2 ms and a = 4 1/s: the loss that the fit sees is that of zeta = (a/omega + b omega)/2."""
    pbd = {"damping": {"mass": 4.0, "stiffness": 2e-3}}
    bench = Bench(*_of(block_scene((0.05, 0.05, 0.025), 0.025, step=0.01, pbd=pbd)))
    omega = 2.0 * np.pi * bench.wanted.blocks
    ratio = 0.5 * (4.0 / omega + 2e-3 * omega)
    assert bench.wanted.loss == pytest.approx(1.0 - np.exp(-2.0 * np.pi * ratio / np.sqrt(1.0 - ratio**2)))
    shown = bench.show(20, 2)
    assert shown.loss == pytest.approx(bench.wanted.loss, abs=5e-3) and shown.within(0.01)


def test_leapfrog_loses_nothing_and_is_tried_from_its_own_plan_on() -> None:
    """No loss but what the fit leaves; the frequency to its dispersion, 1 + (omega h)^2/24."""
    scene = block_scene((0.05, 0.05, 0.025), 0.025, step=0.01, pbd={"method": "leapfrog"})
    bench = Bench(*_of(scene))
    shown = list(settings(bench, 0.02))
    assert [(each.substeps, each.sweeps) for each in shown] == [(bench.auto(1), 1), (2 * bench.auto(1), 1)]
    assert all(each.within(2e-3) for each in shown)


def test_the_cheapest_setting_is_within_the_tolerance() -> None:
    """Found on the way up from the automatic rule; a looser tolerance is never dearer."""
    bench = Bench(*_of(block_scene((0.05, 0.05, 0.025), 0.025, step=0.01)))
    fine, loose = cheapest(list(settings(bench, 0.02)), 0.02), cheapest(list(settings(bench, 0.2)), 0.2)
    assert fine is not None and loose is not None
    assert fine.loss < 0.02 and loose.loss < 0.2 and loose.substeps < fine.substeps
    assert fine.loss > 0.012


def test_too_many_cells_are_refused() -> None:
    with pytest.raises(ValueError, match="at most 600 cells"):
        Bench(*_of(block_scene((0.1, 0.1, 0.1), 0.01)))


def test_hexahedra_of_a_file_are_refused() -> None:
    shape = {"kind": "mesh", "path": "m.vtk", "cells": "own"}
    scene = block_scene(body={"shape": shape, "cell": None})
    body = build_body(scene, {"m.vtk": mesh((4, 2, 2), (0.2, 0.05, 0.05), 0.05)})
    with pytest.raises(ValueError, match=r"lattice.*or leave out `shape.cells`"):
        Bench(scene, body)


def _of(scene: Scene) -> tuple[Scene, Body]:
    return scene, build_body(scene, {})


def test_the_command_prints_keeps_and_reports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path, report = tmp_path / "beam.yaml", tmp_path / "beam.json"
    scene = block_scene((0.1, 0.025, 0.025), 0.025, step=0.01, fixed=({"min": (-1, -1, -1), "max": (-0.0499, 1, 1)},))
    path.write_text(scene.model_dump_json())

    def command(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["softseam", "calibrate", str(path), *words])
        try:
            code = cli.main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        return code, *capsys.readouterr()

    code, printed, _ = command("--report", str(report))
    assert code == 0 and "wanted" in printed and "recommended" in printed and "cheapest within 5 %" in printed
    found = json.loads(report.read_text())
    assert found["recommended"]["substeps"] in [each["substeps"] for each in found["shown"]]
    seconds = [each["seconds"] for each in found["shown"]]
    command("--report", str(report))
    assert [each["seconds"] for each in json.loads(report.read_text())["shown"]] == seconds
    assert list((tmp_path / "cache").rglob("calibration.json"))
    code, _, error = command("--tolerance", "2")
    assert code == 2 and "--tolerance" in error
    code, _, error = command("--set", "body.cell=0.002")
    assert code == 2 and "at most 600 cells" in error
