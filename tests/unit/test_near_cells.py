"""Which cells are near while a tool comes and goes, and that a body is not cut where one model is enough."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam.variants import with_settings
from softseam_protocol.messages.participant import Advanced
from softseam_protocol.scene.file import bundle_scene, load_scene, parse_scene
from softseam_protocol.scene.kinds import ELEMENTS
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.region import build_region
from softseam_services.fem.cost import DEARER
from softseam_services.orchestrator.cost import one_is_enough
from softseam_services.orchestrator.cuts import NearCells, Unmet, cut
from softseam_services.orchestrator.parts import Parts
from softseam_services.pbd.cost import substeps
from softseam_services.pbd.model import build_model
from softseam_services.pbd.parameters import build_parameters
from softseam_services.server import build_setup
from softseam_services.tools.build import build_tools

SCENES = Path(__file__).parents[2] / "scenes"
CHEAP = {"pbd": {"substeps": 8}}
"""pbd that costs less than fem while no tool is near"""
FAR_ALONE = Parts(
    "body",
    {"body.far": "pbd"},
    {"body.far": np.arange(3, dtype=np.int32)},
    {"body.far": 63},
    np.zeros(0, dtype=np.int32),
)
TOUCHED = np.array([0.0, 0.01, 0.02])
SMALL, FEW, MIDDLING, LONG = (3, 1, 1), (4, 2, 2), (8, 4, 2), (64, 4, 2)


def _scene(cells: tuple[int, int, int], split: str, models: dict[str, Any]) -> Scene:
    size = [0.01 * n for n in cells]
    near = {"model": "fem", "within": 0.004, "patience": 2, "split": split, "ahead": 0.0}
    return parse_scene(
        json.dumps(
            {
                "softseam": 1,
                "name": "bar",
                "step": 0.01,
                "body": {
                    "shape": {"kind": "block", "size": size},
                    "cell": 0.01,
                    "material": {"kind": "neo_hookean", "young": 2e4, "poisson": 0.45, "density": 1050},
                },
                "tools": {
                    "finger": {
                        "kind": "box",
                        "size": [0.02, 0.2, 0.2],
                        "position": [-0.5 * size[0] - 0.011, 0, 0],
                        "friction": 0.5,
                    }
                },
                "motion": [{"tools": ["finger"], "move": [0.01, 0, 0], "speed": 0.01}],
                "regions": {"default": "pbd", "near": near},
                "models": models,
            }
        ),
        "bar",
    )


def _near(cells: tuple[int, int, int], split: str, models: dict[str, Any] | None = None) -> tuple[NearCells, Parts]:
    scene, body = _scene(cells, split, models or {}), _bar(cells)
    near = NearCells(scene, body, build_tools(scene, body))
    return near, cut("body", body, near.mask, "fem", "pbd")


def _bar(cells: tuple[int, int, int]) -> Body:
    """Their body."""
    return build_body(_scene(cells, "always", {}), {})


def _follow(near: NearCells, sides: Parts, distance: NDArray[np.float64]) -> str:
    replies = {name: SimpleNamespace(cell_distance=distance[cells]) for name, cells in sides.cells.items()}
    return near.follow(sides, cast("dict[str, Advanced]", replies))


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("cells", "split", "n_near"), [(SMALL, "when_cheaper", 3), (SMALL, "always", 1), (LONG, "when_cheaper", 8)]
)
def test_a_body_is_cut_where_that_is_cheaper(cells: tuple[int, int, int], split: str, n_near: int) -> None:
    """Three cells are not worth a seam; of 512 cells, eight touched ones are."""
    near, _ = _near(cells, split)
    assert np.count_nonzero(near.mask) == n_near


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("cells", "models", "whole"),
    [
        (MIDDLING, {"pbd": {"substeps": 11}}, False),
        (MIDDLING, {"pbd": {"substeps": 40}}, True),
        (MIDDLING, {"pbd": {"substeps": 10, "sweeps": 4}}, True),
        (FEW, {}, True),
        (FEW, {"fem": {"element": "hex8_bbar"}}, False),
    ],
)
def test_what_the_models_are_told_to_do_has_its_price(
    cells: tuple[int, int, int], models: dict[str, Any], whole: bool
) -> None:
    """A far side of many substeps or sweeps is worth less of a seam, a dear element more."""
    near, _ = _near(cells, "when_cheaper", models)
    assert near.mask.all() == whole


@pytest.mark.kernels
def test_all_cells_are_lowered_once_the_tool_has_left() -> None:
    near, sides = _near(SMALL, "when_cheaper", CHEAP)
    assert near.mask.all() and not near.enough
    gone = np.ones(3)
    assert _follow(near, sides, gone) == "" != _follow(near, sides, gone)
    assert not near.mask.any()
    assert "one model is enough: fem on all 3 cells" in _follow(near, FAR_ALONE, TOUCHED)
    assert near.mask.all()


@pytest.mark.kernels
def test_a_small_body_has_one_model_whatever_tools_do() -> None:
    """Also where they never come: fem on three cells costs no more than pbd."""
    near, sides = _near(SMALL, "when_cheaper")
    assert "fem on all 3 cells costs 0.68 of pbd at rest" in near.enough and near.mask.all()
    for _ in range(5):
        assert _follow(near, sides, np.ones(3)) == ""
    assert near.mask.all() and near.looks_for == (False, False)
    near.mask = np.zeros(3, dtype=np.bool_)  # by hand: the tool is followed from here on, and was not far away before
    assert near.enough == "" == _follow(near, FAR_ALONE, np.ones(3))
    assert "one model is enough" in _follow(near, FAR_ALONE, TOUCHED) and near.mask.all()
    near.mask = np.array([True, False, False])
    with_far = cut("body", _bar(SMALL), near.mask, "fem", "pbd")
    assert [bool(_follow(near, with_far, np.ones(3))) for _ in range(2)] == [False, True]
    assert near.mask.all() and near.enough  # let go of by the tool


@pytest.mark.kernels
def test_a_body_saved_before_a_tool_came_goes_on_as_it_was() -> None:
    """As versions saved it that had pbd until then."""
    near, _ = _near(SMALL, "when_cheaper")
    arrays = near.to_arrays() | {"cut": np.zeros(3, dtype=np.int32), "near": np.zeros(3, dtype=np.int32)}
    near.take(arrays | {"distance": np.ones(3)})
    assert not near.mask.any()
    assert _follow(near, FAR_ALONE, np.ones(3)) == "" and not near.mask.any()
    assert "one model is enough" in _follow(near, FAR_ALONE, TOUCHED) and near.mask.all()


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("cells", "models"),
    [(SMALL, {}), (FEW, {}), ((3, 3, 2), {"pbd": {"sweeps": 4}}), (MIDDLING, {"pbd": {"substeps": 40}})],
)
def test_where_one_model_is_enough_no_cut_is_cheaper(cells: tuple[int, int, int], models: dict[str, Any]) -> None:
    """None of fifty, each of one patch about a cell."""
    near, _ = _near(cells, "when_cheaper", models)
    assert near.enough
    body, rng = _bar(cells), np.random.default_rng(1)
    alone = near.cost(np.ones(body.n_cells, dtype=np.bool_))
    for _ in range(50):
        middle = body.cell_grid[rng.integers(body.n_cells)]
        chosen = np.abs(body.cell_grid - middle).max(axis=1) <= rng.integers(3)
        if not chosen.all():
            assert near.cost(chosen) > alone
    assert one_is_enough(body, _scene(cells, "always", models).models, 0.01, True) <= 1.0


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("name", "keys", "enough"),
    [
        ("tofu_grasp", [], True),
        ("tofu_grasp", ["regions.near.split=always"], False),
        ("tofu_grasp", ["regions.near.tools=[]"], False),
        ("tofu_grasp", ["regions.near.within=null", "regions.near.stress=4e3"], False),
        ("tofu_grasp", ["models.pbd.coarse.beyond=0.01"], False),
        ("tofu_grasp", ["body.cell=0.0125", "body.material.retardation_time=0"], False),
        ("tofu_drop", [], False),
        ("sausage", [], True),
        ("sausage", ["body.material.retardation_time=0"], False),
        ("dumpling", [], True),
        ("tofu_slab", [], False),
        ("tofu_slab", ["regions.near.split=when_cheaper"], True),
        ("tofu_slab", ["regions.near.split=when_cheaper", "body.material.retardation_time=0"], False),
    ],
)
def test_one_model_is_enough_where_tools_would_ask_for_it(name: str, keys: list[str], enough: bool) -> None:
    """Not where no tool makes cells near, where a cut or coarse blocks are asked for, or where the body rolls,
    but where it is viscous, so that XPBD takes twice the substeps, each of which costs twice as much."""
    loaded = load_scene(SCENES / f"{name}.yaml")
    setup = build_setup(bundle_scene(with_settings(loaded.scene, keys), loaded.bundle.files))
    assert isinstance(setup.body, Body)
    assert bool(NearCells(setup.scene, setup.body, setup.tools).enough) == enough


@pytest.mark.kernels
def test_a_cut_made_by_hand_and_a_spared_one_survive_a_snapshot() -> None:
    near, _ = _near(SMALL, "when_cheaper")
    for mask in (near.mask.copy(), np.array([True, False, False])):
        near.mask = mask
        arrays = near.to_arrays()
        near.reset()
        near.take(arrays)
        assert np.array_equal(near.mask, mask)


@pytest.mark.kernels
@pytest.mark.parametrize("n_touched", [2, 3, 20])
def test_cells_that_never_became_near_are_counted(n_touched: int) -> None:
    """A tool comes to so many columns of eight cells, the first of which are near from the start; the switch is refused
    three times, then made."""
    near, _ = _near(LONG, "always")
    body = _bar(LONG)
    distance = np.where(body.cell_grid[:, 0] < n_touched, 0.0, 1.0)
    sides = cut("body", body, near.mask, "fem", "pbd")

    def switch() -> int:
        """Cells that are near once the rule asks for a switch; after one that was refused it waits."""
        assert any(_follow(near, sides, distance) for _ in range(20))
        return int(near.mask.sum())

    assert near.unmet == Unmet(0, 0, 8)
    for tries in (1, 2, 3):
        assert switch() == 8 * n_touched
        near.refused()
        assert near.unmet == Unmet(tries, 8 * (n_touched - 1), 8 * n_touched)
    switch()
    assert near.unmet == Unmet(3, 0, 8 * n_touched)
    near.take(near.to_arrays())
    assert near.unmet.n_refused == 0


def test_every_element_has_a_price() -> None:
    assert set(DEARER) == set(ELEMENTS)


@pytest.mark.kernels
def test_a_tool_on_its_way_counts_as_closer() -> None:
    """9.7 mm away and 3 mm closer in a step: within 4 mm in two more, which is the default look ahead."""
    masks = []
    for ahead in (0.0, None, 0.018):
        scene = _scene(LONG, "always", {})
        spec = scene.regions.near
        assert spec is not None
        spec = spec.model_copy(update={"ahead": ahead})
        scene = scene.model_copy(update={"regions": scene.regions.model_copy(update={"near": spec})})
        body = build_body(scene, {})
        near = NearCells(scene, body, build_tools(scene, body))
        sides = cut("body", body, near.mask, "fem", "pbd")
        for closest in (0.0217, 0.0187, 0.0157, 0.0127, 0.0097):
            distance = np.asarray(closest + 0.01 * body.cell_grid[:, 0], dtype=np.float64)
            _follow(near, sides, distance)
        masks.append(int(near.mask.sum()))
    assert masks == [0, 8, 0]


@pytest.mark.kernels
def test_what_is_looked_at_survives_a_snapshot() -> None:
    scene = _scene(LONG, "always", {})
    spec = scene.regions.near
    assert spec is not None
    spec = spec.model_copy(update={"stress": 100.0, "error": 0.1})
    scene = scene.model_copy(update={"regions": scene.regions.model_copy(update={"near": spec})})
    body = build_body(scene, {})
    one, other = (NearCells(scene, body, build_tools(scene, body)) for _ in range(2))
    assert one.looks_for == (True, True)
    arrays = one.to_arrays()
    assert {"urgency_stress", "urgency_model_error", "distance", "wait"} <= set(arrays)
    arrays["urgency_stress"] = np.linspace(0.0, 2.0, body.n_cells)
    other.take(arrays)
    for name, each in other.to_arrays().items():
        np.testing.assert_array_equal(each, arrays[name], err_msg=name)
    arrays["urgency_stress"] = np.zeros(3)
    with pytest.raises(ValueError, match="cells"):
        other.take(arrays)


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["tofu_grasp", "tofu_slab", "silken_tofu", "cantilever", "dumpling", "sausage_bend"])
def test_the_cost_knows_pbds_substeps(name: str) -> None:
    """Of the scenes that come along, to one in twenty: by PBD's own tables, with tools and without."""
    loaded = load_scene(SCENES / f"{name}.yaml")
    setup = build_setup(loaded.bundle)
    body = setup.body
    assert isinstance(body, Body)
    region = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
    spec, tools = setup.scene.models.pbd, setup.tools
    parameters = build_parameters(build_model(body, region, tools, spec), body, region, tools, spec)
    wanted = parameters.substeps(setup.scene.step)
    found = substeps(body, setup.scene.models.pbd, setup.scene.step, len(setup.tools.names) > 0)
    assert abs(found - wanted) <= max(1, 0.05 * wanted)
