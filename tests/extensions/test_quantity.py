"""A quantity added from outside: two rows, and every scene may ask for it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from numpy.testing import assert_allclose

import softseam
from softseam.report import ReportBuilder
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.quantities import QUANTITIES, Quantity
from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.quantities import MEASUREMENTS, Look, Measurement

LENGTH = 0.04
SCENE = """
softseam: 1
name: falling
gravity: [0, 0, -10]
step: 0.01
duration: 0.1
body: {shape: {kind: block, size: [0.04, 0.02, 0.02]}, cell: 0.02, material: {young: 1e6, poisson: 0.3, density: 1000}}
regions: {default: fem}
quantities: [span, drop]
"""


def span(look: Look) -> float:
    """Length of the body along x."""
    return float(np.ptp(look.fields.x[:, 0]))


def drop(look: Look) -> float:
    """How far the lowest point is below where it was at rest."""
    return look.rest.bottom - min(float(reply.bounds[0, 2]) for reply in look.replies.values())


@contextmanager
def added() -> Iterator[None]:
    """What an extension's module does as it is imported."""
    QUANTITIES.add("span", Quantity("m", "length of the body along x", of="cells"))
    MEASUREMENTS.add("span", Measurement("fields", span))
    QUANTITIES.add("drop", Quantity("m", "how far the lowest point came down", at_rest=0.0))
    MEASUREMENTS.add("drop", Measurement("step", drop))
    try:
        yield
    finally:
        for table in (QUANTITIES, MEASUREMENTS):
            table.remove("span")
            table.remove("drop")


def test_it_is_reported_from_the_start_with_its_unit() -> None:
    """A block that falls keeps its length; after n steps of implicit Euler it is g dt^2 n (n + 1)/2 lower."""
    with added(), softseam.open(parse_scene(SCENE)) as sim:
        found = sim.reset().quantities
        assert_allclose([found["span"], found["drop"]], [LENGTH, 0.0], rtol=1e-12)
        builder = ReportBuilder(Bundle(sim.scene.model_dump_json(), {}))
        for _ in range(10):
            seen = sim.step()
            builder.add(seen.report)
        assert_allclose(seen.quantities["span"], LENGTH, rtol=1e-9)
        assert_allclose(seen.quantities["drop"], 10.0 * 0.01**2 * 55, rtol=1e-6)
        entry = builder.build()["quantities"]["drop"]
    assert entry["unit"] == "m" and entry["asked"] and entry["max"] == entry["final"] > entry["min"] > 0.0


def test_a_scene_that_asks_for_what_no_row_has_is_refused_where_it_does() -> None:
    with pytest.raises(
        SceneError, match=r"my\.yaml:9:14: quantities\.0: \"grip_forse\" is not in the table of quantities"
    ):
        parse_scene(SCENE.replace("span", "grip_forse"), "my.yaml")
    with pytest.raises(SceneError, match="did you mean 'grip_force'"):
        parse_scene(SCENE.replace("span", "grip_forse"))


@pytest.mark.parametrize(
    ("forgotten", "title"), [(MEASUREMENTS, "measurements of quantities"), (QUANTITIES, "quantities")]
)
def test_a_forgotten_row_fails_at_start(forgotten: object, title: str) -> None:
    table = QUANTITIES if forgotten is MEASUREMENTS else MEASUREMENTS
    table.add("span", QUANTITIES["sag"] if table is QUANTITIES else MEASUREMENTS["sag"])  # type: ignore[arg-type]
    scene = Scene.model_validate(parse_scene(SCENE.replace("span, drop", "sag")))
    try:
        with pytest.raises(softseam.BadInput, match=f"table of {title}: no row 'span'"):
            softseam.open(scene)
    finally:
        table.remove("span")
