"""Which cells are near while a tool comes and goes, and that a body is not cut where one model is enough."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any, cast, get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_protocol.kinds import ElementKind
from softseam_protocol.messages import Advanced
from softseam_protocol.scene import Scene
from softseam_protocol.scene_file import parse_scene
from softseam_services.body.build import build_body
from softseam_services.orchestrator.cost import DEARER
from softseam_services.orchestrator.near_cells import NearCells
from softseam_services.orchestrator.sides import Sides, cut
from softseam_services.tools.build import build_tools

SMALL, FEW, MIDDLING, LONG = (3, 1, 1), (4, 2, 2), (8, 4, 2), (64, 4, 2)


def _scene(cells: tuple[int, int, int], split: str, models: dict[str, Any]) -> Scene:
    size = [0.01 * n for n in cells]
    near = {"model": "fem", "within": 0.004, "patience": 2, "split": split}
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


def _near(cells: tuple[int, int, int], split: str, models: dict[str, Any] | None = None) -> tuple[NearCells, Sides]:
    scene = _scene(cells, split, models or {})
    body = build_body(scene, {})
    near = NearCells(scene, body, build_tools(scene, body))
    return near, cut(body, near.mask, "fem", "pbd")


def _follow(near: NearCells, sides: Sides, distance: NDArray[np.float64]) -> str:
    replies = {name: SimpleNamespace(cell_distance=distance[cells]) for name, cells in sides.cells.items()}
    return near.follow(sides, cast("dict[str, Advanced]", replies))


@pytest.mark.parametrize(
    ("cells", "split", "n_near"), [(SMALL, "when_cheaper", 3), (SMALL, "always", 1), (LONG, "when_cheaper", 8)]
)
def test_a_body_is_cut_where_that_is_cheaper(cells: tuple[int, int, int], split: str, n_near: int) -> None:
    """Three cells are not worth a seam; of 512 cells, eight touched ones are."""
    near, _ = _near(cells, split)
    assert np.count_nonzero(near.mask) == n_near


@pytest.mark.parametrize(
    ("cells", "models", "whole"),
    [
        (MIDDLING, {}, False),
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


def test_all_cells_are_lowered_once_the_tool_has_left() -> None:
    near, sides = _near(SMALL, "when_cheaper")
    assert near.mask.all()
    gone = np.ones(3)
    assert _follow(near, sides, gone) == "" != _follow(near, sides, gone)
    assert not near.mask.any()
    sides = Sides({"far": "pbd"}, {"far": np.arange(3, dtype=np.int32)}, {"far": 63}, np.zeros(0, dtype=np.int32))
    touched = np.array([0.0, 0.01, 0.02])
    assert "one model is enough: fem on all 3 cells" in _follow(near, sides, touched)
    assert near.mask.all()


def test_a_cut_made_by_hand_and_a_spared_one_survive_a_snapshot() -> None:
    near, _ = _near(SMALL, "when_cheaper")
    for mask in (near.mask.copy(), np.array([True, False, False])):
        near.mask = mask
        arrays = near.to_arrays()
        near.reset()
        near.take(arrays)
        assert np.array_equal(near.mask, mask)


def test_every_element_has_a_price() -> None:
    assert set(DEARER) == set(get_args(ElementKind))
