"""What FEM computes with has one type for numba, whatever the cells and their element."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.region import build_region
from softseam_services.fem.structures import build_tables
from softseam_services.fem.work import build_work
from softseam_services.server import build_setup
from softseam_services.warm_up import warm_scene

pytestmark = pytest.mark.kernels


def types(element: str, grading: float) -> tuple[Any, ...]:
    """Of model, parameters and scratch, for cells that grow by `grading`."""
    scene = warm_scene("fem").model_dump()
    scene["models"]["fem"]["element"] = element
    scene["body"]["shape"] |= {"size": (0.08, 0.02, 0.02), "grading": grading}
    scene["tools"] = {"ground": scene["tools"]["ground"]}
    scene["motion"] = []
    setup = build_setup(Bundle(Scene.model_validate(scene).model_dump_json(), {}))
    assert isinstance(setup.body, Body)
    cells, no_seam = np.arange(setup.body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32)
    region = build_region(setup.body, cells, no_seam, True)
    model, parameters = build_tables(setup.body, region, setup.tools, setup.scene.models.fem)
    return tuple(
        vars(record)["_numba_type_"]
        for record in (model, parameters, build_work(model, parameters, len(setup.tools.names)))
    )


@pytest.mark.parametrize("element", list(FACTS))
def test_cells_of_any_shape_and_element_need_no_other_kernels(element: str) -> None:
    """A type of its own, be it by the layout of one array, would have the whole step compiled anew (16 s)."""
    plain = types("hex27", 1.0)
    assert types(element, 1.0) == plain
    assert types(element, 2.0) == plain
