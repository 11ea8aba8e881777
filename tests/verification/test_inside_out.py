"""A body that FEM cannot squeeze as far as it is asked to: no wrong force without a word."""

from __future__ import annotations

import numpy as np
import pytest

from softseam_services.fem.failures import SLOPES
from softseam_studies.atlas.runs import squeeze as run
from softseam_studies.atlas.scenes import data_of

DATA = data_of("squeeze")
SPEEDS = DATA["rows"]
TOLD = "monitor of FEM: cells are inside out"
LEAPT = "alarm: energy from nowhere"


@pytest.mark.slow
@pytest.mark.parametrize("speed", (SPEEDS[0], SPEEDS[-1]))
def test_who_is_squeezed_by_70_percent_is_told_that_cells_are_inside_out(speed: float) -> None:
    """Where the body leapt and gained energy, that is told, and it is no verdict of a force: which of both happens at
    the slowest speed goes by rounding, and so by the processor."""
    found = run(0.7, speed, "fem", **DATA["given"])
    leapt = speed == min(SPEEDS) and found.kind == "unstable" and LEAPT in found.warned
    assert found.error is None or found.error < 0.02 or TOLD in found.warned or leapt


@pytest.mark.parametrize("squeeze", [0.3, 0.5, 0.6])
def test_what_is_right_is_not_told_so(squeeze: float) -> None:
    found = run(squeeze, 0.3, "fem", **DATA["given"])
    assert found.error is not None and found.error < 1e-9 and TOLD not in found.warned


def test_slopes_are_those_of_quadratic_fields() -> None:
    """Exact for all that 27 nodes can tell, here x^2 y + z."""
    t = np.array([-1.0, 0.0, 1.0])
    z, y, x = (axis.reshape(-1) for axis in np.meshgrid(t, t, t, indexing="ij"))
    fine = np.linspace(-1.0, 1.0, 5)
    _, at_y, at_x = (axis.reshape(-1) for axis in np.meshgrid(fine, fine, fine, indexing="ij"))
    wanted = np.stack([2.0 * at_x * at_y, at_x**2, np.ones(125)], axis=1)
    assert np.allclose(SLOPES @ (x * x * y + z), wanted, atol=1e-14)
