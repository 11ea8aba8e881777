"""How two round surfaces yield to one another: hinges against the law that they stand for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_services.pbd.kernels.flattening import HINGES, find_hinges
from softseam_services.pbd.kernels.touch import FADE, N_INTS, N_NUMBERS, SHARE
from softseam_services.tools.kernels import SAG

pytestmark = pytest.mark.kernels

LIGHT, SPACING, YIELDS = 0.125, 5e-3, 1e-8
RISE = 1.25e-4
"""h^2/8R, of h = 5 mm and R = 25 mm [m]"""
Floats = NDArray[np.float64]


def met(octant: tuple[float, ...], rise: float, fade: float = 1.0) -> tuple[int, Floats, Floats]:
    """Hinges of a point of one surface at this place among octants on the first corner of another, both as round."""
    touch: Any = SimpleNamespace(
        sides=np.array([[0, 1]], dtype=np.int32),
        yields=np.full(2, YIELDS),
        light=np.full(2, LIGHT),
        spacing=np.full(2, SPACING),
        curved=np.ones(2, dtype=np.bool_),
        first=np.array([0, 1, 4], dtype=np.int32),
        octant=np.tile(octant, (4, 1)),
        rise=np.tile([rise, rise, 0.0], (4, 1)),
        spread=np.tile([8.0 * RISE, 8.0 * RISE, 0.0], (4, 1)) / 8.0 * 0.025,
        mean=np.full(4, rise / RISE / 0.025),
    )
    ints, row = np.zeros(N_INTS, dtype=np.int32), np.zeros(N_NUMBERS)
    ints[2:4], row[SHARE], row[FADE] = (1, 2), 1.0, fade
    depth, stiff = np.zeros(HINGES), np.zeros(HINGES)
    return find_hinges.py_func(touch, 0, ints, row, depth, stiff), depth, stiff


def test_hinges_are_the_law() -> None:
    """In the middle of an octant's face, of two alike: p(d) of either on a plane by half of d, within 15 %, never less,
    convex, and from there on as steep as what is flat."""
    n, depth, stiff = met((0.5, 0.5, 0.0), RISE)
    sag = 8.0 * SAG * 2.0 * RISE
    pressure = LIGHT * sag / YIELDS * np.geomspace(0.05, 20.0, 60)
    law = YIELDS * pressure + (1.0 - LIGHT) * sag * pressure / (pressure + LIGHT * sag / YIELDS)
    found = np.maximum(0.0, 2.0 * law[:, None] - depth) @ stiff
    assert n == HINGES and (stiff > 0.0).all() and stiff.sum() == pytest.approx(0.5 / YIELDS)
    inside = pressure < 3.0 * LIGHT * sag / YIELDS
    assert (found[inside] >= pressure[inside] * (1.0 - 1e-9)).all()
    np.testing.assert_allclose(found, pressure, rtol=0.15, atol=0.04 * LIGHT * sag / YIELDS)


@pytest.mark.parametrize(
    ("octant", "rise", "fade"),
    [((0.0, 3.0, 0.0), RISE, 1.0), ((0.5, 0.5, 0.0), 0.0, 1.0), ((0.5, 0.5, 0.0), RISE, 0.0)],
)
def test_at_nodes_and_where_it_is_flat_or_far_it_yields_as_what_is_flat(
    octant: tuple[float, ...], rise: float, fade: float
) -> None:
    n, depth, stiff = met(octant, rise, fade)
    assert n == 1 and depth[0] == 0.0 and stiff[0] == pytest.approx(0.5 / YIELDS)
