"""What of a quantity is rounding is shown as 0, in the closing table, the report and a replay; least and most are
signed."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from squeeze import SCENE, Squeeze

from softseam.closing import print_closing
from softseam.recording import Recording
from softseam.replay.facts import summary
from softseam.report import ReportBuilder, Rounding
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.scene import Scene
from softseam_services.recorder.recorder import McapRecorder


def scene(size: float, young: float) -> Scene:
    body = {
        "shape": {"kind": "block", "size": [size, 0.5 * size, 0.5 * size]},
        "material": {"young": young, "poisson": 0.3, "density": 1000},
    }
    return Scene.model_validate({**SCENE, "body": body, "tools": {}, "motion": [], "duration": 1.0, "quantities": []})


@pytest.mark.parametrize(("size", "young"), [(0.05, 2e4), (0.003, 1e9), (0.6, 500.0)])
def test_a_bodys_own_weight_is_more_than_rounding(size: float, young: float) -> None:
    """It strains the body by rho g L/E, at least; what its positions are rounded to does by 1e-16."""
    strain, rounding = 1000 * 9.81 * size / young, Rounding(scene(size, young))
    for scale in (strain, 1e-15):
        small = {"m": scale * size, "Pa": scale * young, "N": scale * young * size**2, "J": scale**2 * young * size**3}
        for unit, value in {**small, "1": scale}.items():
            assert (value > rounding.least(unit, np.array([value]))) == (scale == strain), unit


@pytest.mark.parametrize("most", [90.0, 400.0, 1.7e6])
def test_what_is_nothing_beside_the_largest_is_rounding(most: float) -> None:
    assert 1e-10 * most < Rounding(scene(0.05, 2e4)).least("N", np.array([0.0, -most, 1e-10 * most])) < 1e-8 * most


def squeezed(values: list[float | None], name: str = "lift_height", folder: Path | None = None) -> dict[str, Any]:
    """Report of a run with this quantity after each step, None where it was not measured; also as it is replayed."""
    run = Squeeze(len(values))
    told = iter(values)
    messages = []
    for message in run.messages():
        if isinstance(message, StepReport):
            value = next(told)
            quantities = {other: known for other, known in message.quantities.items() if other != name}
            if value is not None:
                quantities[name] = value
            message = replace(message, quantities=quantities)
        messages.append(message)
    builder = ReportBuilder(run.bundle)
    for message in messages:
        builder.add(message)
    report = builder.build()
    if folder is not None:
        with McapRecorder(folder / "run.mcap", run.begin) as recorder:
            for message in messages:
                recorder.write(message)
        report["replayed"] = summary(Recording(folder / "run.mcap"), builder, {})
    return report


def closing(report: dict[str, Any]) -> str:
    said = StringIO()
    print_closing(Console(file=said, width=200), report)
    return said.getvalue()


def row(text: str, name: str) -> list[str]:
    return next(line for line in text.splitlines() if line.startswith(name)).removeprefix(name).split()


@pytest.mark.kernels
@pytest.mark.parametrize("noise", [-8.7e-19, 3.1e-17, -2e-13])
def test_rounding_is_shown_as_nothing(noise: float, tmp_path: Path) -> None:
    report = squeezed([0.0, noise, 0.031, noise], folder=tmp_path)
    found = report["quantities"]["lift_height"]
    assert [found[key] for key in ("final", "min", "max")] == [0.0, 0.0, 0.031]
    assert found["values"][1] == noise, "the series itself is as it was measured"
    assert row(closing(report), "lift height") == ["0", "mm", "0", "mm", "31", "mm"]
    assert "| lift height | 0 m to 31 mm |" in report["replayed"]


@pytest.mark.kernels
@pytest.mark.parametrize("noise", [-8.7e-19, 3.1e-17])
def test_a_quantity_that_is_all_rounding_is_nothing(noise: float, tmp_path: Path) -> None:
    report = squeezed([noise, -noise, 2.0 * noise], folder=tmp_path)
    assert row(closing(report), "lift height") == ["0", "mm", "0", "mm", "0", "mm"]
    assert "| lift height | 0 m to 0 m |" in report["replayed"]


@pytest.mark.kernels
@pytest.mark.parametrize("small", [-4e-9, 2.5e-8, -1e-7])
def test_what_is_small_but_no_rounding_is_shown(small: float) -> None:
    """A few nanometres that a stiff block of 50 mm sinks by."""
    found = squeezed([0.0, small])["quantities"]["lift_height"]
    assert found["final"] == small and {found["min"], found["max"]} == {0.0, small}


@pytest.mark.kernels
@pytest.mark.parametrize("down", [-0.148, -0.0216, -3e-4])
def test_least_and_most_have_their_signs(down: float, tmp_path: Path) -> None:
    """A tip that goes down by 148 mm and comes back: the largest value is that where it moved least."""
    report = squeezed([-2e-5, down, 0.5 * down], folder=tmp_path)
    found = report["quantities"]["lift_height"]
    assert [found[key] for key in ("min", "max", "final")] == [down, -2e-5, 0.5 * down]
    assert row(closing(report), "lift height")[2:] == [f"{1e3 * down:.4g}", "mm", "-0.02", "mm"]


@pytest.mark.kernels
@pytest.mark.parametrize(("values", "told"), [([1.0, None, 3.0], "2 of 3"), ([None, None, 3.0, 4.0, None], "2 of 5")])
def test_it_says_of_how_many_steps_least_and_most_are(values: list[float | None], told: str) -> None:
    report = squeezed(values, "peak_von_mises")
    assert f"measured in {told} steps: peak von Mises" in closing(report)
    assert "measured in" not in closing(squeezed([value or 0.0 for value in values], "peak_von_mises"))
