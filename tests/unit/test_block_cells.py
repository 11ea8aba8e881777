"""Cells of a block whose scene leaves them open: by its least extent, and by the tools that press between nodes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import solids

from softseam.claims.sibling import cell_edges
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.body.default_cells import block_edge
from softseam_services.tools.build import build_tools

ROD = {"kind": "capsule", "radius": 5e-3, "length": 0.04, "position": [0, 0, 0.06]}
LONG = solids.obj(*solids.box((0.01, 0.01, 0.04)))
PLATE = solids.obj(*solids.box((0.04, 0.03, 1e-3)))
SHORTER = 6e-3
"""edge that 512 cells allow, of which a rod asks for 5 mm [m]"""


def edges(tool: dict[str, Any], **shape: Any) -> list[float]:
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "open",
            "step": 0.01,
            "duration": 0.1,
            "body": {
                "shape": {"kind": "block", "size": [0.06, 0.06, 0.03], **shape},
                "material": {"young": 2e4, "poisson": 0.4, "density": 1000.0},
            },
            "tools": {"ground": {"kind": "plane"}, "tool": tool},
        }
    )
    body = build_body(scene, {"long.obj": LONG, "plate.obj": PLATE})
    return sorted({round(float(edge), 12) for edge in body.edges})


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("tool", "found"),
    [
        (ROD, [SHORTER]),
        ({**ROD, "kind": "cylinder"}, [SHORTER]),
        ({"kind": "mesh", "path": "long.obj", "position": [0, 0, 0.06], "rotation": [0, 1, 0]}, [SHORTER]),
        ({"kind": "mesh", "path": "plate.obj", "position": [0, 0, 0.06]}, [0.01]),
        ({"kind": "sphere", "radius": 0.02, "position": [0, 0, 0.06]}, [0.01]),
        ({"kind": "box", "size": [1e-3, 0.01, 0.01], "position": [0, 0, 0.06]}, [0.01]),
    ],
    ids=["capsule", "cylinder", "mesh", "mesh of a plate", "wide", "box"],
)
def test_narrow_tools_ask_for_shorter_cells(tool: dict[str, Any], found: list[float]) -> None:
    assert edges(tool) == pytest.approx(found)


@pytest.mark.parametrize(
    ("size", "half_width", "n_cells"),
    [
        ((0.06, 0.06, 0.03), np.inf, (6, 6, 3)),
        ((0.06, 0.06, 0.03), 7.5e-3, (8, 8, 4)),
        ((0.06, 0.06, 0.03), 5e-3, (10, 10, 5)),
        ((0.06, 0.06, 0.03), 1e-4, (10, 10, 5)),
        ((0.16, 0.16, 0.08), 5e-3, (10, 10, 5)),
        ((1.0, 1.0, 0.02), np.inf, (54, 54, 1)),
        ((1.0, 1.0, 0.02), 5e-3, (54, 54, 1)),
    ],
)
def test_there_are_never_thousands(size: tuple[float, ...], half_width: float, n_cells: tuple[int, ...]) -> None:
    edge = block_edge(size, half_width)
    assert tuple(max(1, round(extent / edge)) for extent in size) == n_cells


@pytest.mark.kernels
@pytest.mark.parametrize("curved", [False, True])
def test_a_sibling_knows_them(curved: bool) -> None:
    """Of cells that follow a ball it counts so many of one size."""
    shape: dict[str, Any] = {"kind": "block", "size": [0.06, 0.06, 0.03]}
    body: dict[str, Any] = {"shape": shape, "material": {"young": 2e4, "poisson": 0.4, "density": 1000.0}}
    if curved:
        shape["borders"] = "materials"
        ball = {"kind": "sphere", "position": [0, 0, 0.015], "radius": 0.008}
        body["inclusions"] = [{"shape": ball, "material": {"young": 2e5, "poisson": 0.4}}]
    scene = Scene.model_validate(
        {"softseam": 1, "name": "open", "step": 0.01, "duration": 0.1, "body": body, "tools": {"tool": ROD}}
    )
    assert isinstance(scene.body, BodySpec)
    built = build_body(scene, {})
    frame: Any = type("Rest", (), {"x": built.x_rest, "cell_near": np.zeros(built.n_cells)})
    found = pytest.approx([SHORTER] * 3, rel=0.4 if curved else 1e-9)
    assert cell_edges(scene.body, frame) == found
    assert build_tools(scene).half_width == pytest.approx([5e-3])
