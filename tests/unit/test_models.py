"""A model that extensions add by rows is labelled, coloured, offered and solved like softseam's own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from softseam.choice import choices
from softseam.columns import spent
from softseam.variants import models, with_model
from softseam.view import colors
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Bundle, Configure, Failure
from softseam_protocol.messages.session import PartReport
from softseam_protocol.models import (
    FAR_DEFAULT,
    MODELS,
    NEAR_DEFAULT,
    ModelFacts,
    facts_of,
    roles,
    service_of,
    some_read,
)
from softseam_protocol.scene.file import SceneError, load_scene, scene_schema
from softseam_protocol.scene.models import ModelsSpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.table import MissingRow
from softseam_services.health import expected
from softseam_services.launch import route
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.server import ParticipantServer
from softseam_services.solvers import SOLVERS
from softseam_services.tables import check_tables
from softseam_services.warm_up import warm_scene

SAND = (214, 178, 96)
FACTS = ModelFacts(label="Grains", colour=SAND)
TEXT = """softseam: 1
name: press
duration: 0.05
body: {shape: {kind: block, size: [0.04, 0.02, 0.02]}, cell: 0.02, material: {young: 2.0e4, poisson: 0.4, density: 1e3}}
regions: {default: grains}
"""


SHEET = "body: {kind: sheet, size: [1, 1], divisions: [2, 2], density: 1, stretch: 1}"


@pytest.fixture
def grains() -> Iterator[str]:
    """A model that a service of softseam's is to answer for."""
    MODELS.add("grains", FACTS)
    yield "grains"
    MODELS.remove("grains")


@pytest.fixture
def milled() -> Iterator[str]:
    """One that a service from outside answers for."""
    MODELS.add("grains", replace(FACTS, service="mill"))
    yield "grains"
    MODELS.remove("grains")


@pytest.fixture
def solved(grains: str) -> Iterator[str]:
    """One with a solver here: another model's, which is as good as any."""
    SOLVERS.add(grains, SOLVERS[FAR_DEFAULT])
    yield grains
    SOLVERS.remove(grains)


def _scene(tmp_path: Path, text: str = TEXT) -> Scene:
    path = tmp_path / "press.yaml"
    path.write_text(text)
    return load_scene(path).scene


def test_a_scene_may_name_it_and_its_schema_lists_it(grains: str, tmp_path: Path) -> None:
    assert _scene(tmp_path).regions.default == grains
    default = json.loads(scene_schema())["$defs"]["RegionsSpec"]["properties"]["default"]
    assert default["anyOf"][0]["enum"] == [NEAR_DEFAULT, FAR_DEFAULT, grains]


def test_errors_name_it_as_the_nearest(grains: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r'"grain" is not in the table of models; did you mean \'grains\'\?'):
        _scene(tmp_path, TEXT.replace("grains", "grain"))
    sheet = TEXT.replace(TEXT.splitlines()[3], SHEET)
    with pytest.raises(SceneError, match="a sheet is made of particles, not cells: only pbd can simulate it"):
        _scene(tmp_path, sheet)


def test_it_is_unknown_without_its_row(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r'regions\.default: "grains" is not in the table of models'):
        _scene(tmp_path)
    assert facts_of("grains").label == "GRAINS"  # as in a recording of who has the row


def test_what_takes_no_cells_is_refused_for_a_body_in_cells(tmp_path: Path) -> None:
    MODELS.add("grains", replace(FACTS, takes=frozenset({"particles"})))
    try:
        with pytest.raises(SceneError, match=r"regions\.default: grains does not take these cells: use fem or pbd"):
            _scene(tmp_path)
    finally:
        MODELS.remove("grains")


def test_it_is_labelled_and_coloured(grains: str, tmp_path: Path) -> None:
    scene = _scene(tmp_path)
    assert colors.parts({"body.far": grains}) == {"body.far": ("Grains", SAND)}
    assert colors.parts({"body.far": grains, "body.near": NEAR_DEFAULT})["body.far"] == ("far part: Grains", SAND)
    assert choices(scene, {"body.far": PartReport("body", grains, 2, 45, 0.0, 0.0, 0.0, 1, 0.0)}, []) == {
        "body": "Grains on all 2 cells, as the scene's regions say"
    }
    assert ModelsSpec().label(FAR_DEFAULT) == "XPBD"
    assert colors.parts({"body.far": FAR_DEFAULT}) == {"body.far": ("PBD", colors.FAR)}


def test_commands_offer_it(grains: str, tmp_path: Path) -> None:
    assert models() == (NEAR_DEFAULT, FAR_DEFAULT, grains, "hybrid")
    assert with_model(_scene(tmp_path), grains).regions.default == grains
    assert spent() == (NEAR_DEFAULT, FAR_DEFAULT, grains, "coupling", "bus", "record")
    assert roles() == ("router", NEAR_DEFAULT, FAR_DEFAULT, grains, "orchestrator", "recorder")
    assert route(f"{grains}=mill") == (grains, "mill")
    assert expected() == (NEAR_DEFAULT, FAR_DEFAULT, grains, "orchestrator", "recorder")


@pytest.mark.kernels
def test_a_service_from_outside_answers_for_it(milled: str, tmp_path: Path) -> None:
    assert service_of(milled) == "mill"
    assert milled not in roles() and "mill" in expected()
    check_tables()
    bundle, header = (
        Bundle(_scene(tmp_path).model_dump_json(), {}),
        Header(SCHEMA_VERSION, "s", "body.far", 0, 0, 0, 0.0),
    )
    cells, none = np.arange(2, dtype=np.int32), np.zeros(0, np.int32)
    here = ParticipantServer().handle(Configure(header, bundle, milled, cells, none))
    assert isinstance(here, Failure)
    assert "the model 'grains' is solved by the service 'mill'" in here.message


def test_a_model_without_a_solver_fails_at_start_by_name(grains: str) -> None:
    with pytest.raises(MissingRow, match="table of solvers: no row 'grains', which the table of models names"):
        check_tables()


@pytest.mark.kernels
def test_its_solver_is_stepped_like_any(solved: str) -> None:
    check_tables()
    bundle = Bundle(warm_scene(solved).model_dump_json(), {})
    simulation = Simulation(bundle, EmbeddedTransport(), session="s", emit=lambda message: None)
    for _ in range(2):
        report = simulation.step(None, fields=True)
    simulation.close()
    assert {part.model for part in report.parts.values()} == {solved}
    assert report.seconds[solved] > 0.0


def test_every_setting_is_read_by_a_model_and_every_key_that_models_read_is_a_setting() -> None:
    keys = {
        f"{name}.{field.alias or key}"
        for name, section in ModelsSpec.model_fields.items()
        for key, field in type(section.default).model_fields.items()
    }
    assert keys == set().union(*(facts.reads for facts in MODELS.values()))
    assert some_read([NEAR_DEFAULT, None], "fem.element") and not some_read([FAR_DEFAULT, None], "fem.element")
