"""Elements of tetrahedra in a block meet tools that touch inside its faces."""

from __future__ import annotations

import numpy as np
import pytest
from fem_run import FemRun, block

from softseam_services.tools.face_points import face_points

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("element", ["tet4", "tet4_fbar", "tet10"])
def test_a_small_tool_presses_a_block_of_tetrahedra(element: str) -> None:
    """A ball that presses between nodes: rows sum to 1 and tilts to 0, and a step is taken with a force on the ball."""
    ball = {"kind": "sphere", "radius": 0.01, "position": [0.007, 0.005, 0.0595]}
    scene = block(tools={"ground": {"kind": "plane"}, "ball": ball})
    models = scene.models.model_copy(update={"fem": scene.models.fem.model_copy(update={"element": element})})
    run = FemRun(scene.model_copy(update={"models": models}))
    found = face_points(
        run.body, run.region, run.solver.tables.whole.model.faces, "tet10" if element == "tet10" else "tet4"
    )
    assert len(found.cell) > 0
    np.testing.assert_allclose(np.add.reduceat(found.weight, found.indptr[:-1]), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.add.reduceat(found.tilt, found.indptr[:-1]), 0.0, atol=1e-12)
    told = run.solver.advance(run.request({"ball": (0.0, 0.0, -0.05)}))
    assert told.status.name == "CONVERGED" and told.wrench[1, 2] > 0.0
