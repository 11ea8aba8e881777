"""Points at which tools touch a surface: they stand for its area where that is, not where its vertices stick out."""

from __future__ import annotations

import numpy as np
import pytest
import solids

from softseam_services.body.surface_check import triangle_areas
from softseam_services.body.surface_points import contact_points

RADIUS = 0.03
STRETCHES = [(1.0, 1.0, 1.0), (1.0, 1.7, 0.6), (0.5, 1.0, 2.0)]


def pressed(solid: tuple[solids.Floats, solids.Triangles], longest: float) -> tuple[solids.Floats, solids.Floats]:
    """Areas (k,) and places (k, 3) of what tools press."""
    places, area, _ = contact_points(*solid, longest)
    assert (places[: len(solid[0])] == solid[0]).all()
    return area[area > 0.0], places[area > 0.0]


def integral(solid: tuple[solids.Floats, solids.Triangles]) -> solids.Floats:
    """Of the place over the surface (3,) [m^3]."""
    vertices, triangles = solid
    areas = np.linalg.norm(triangle_areas(vertices, triangles), axis=1)
    return np.asarray(areas @ vertices[triangles].mean(axis=1))


@pytest.mark.parametrize("longest", [1e-3, 4e-3, 12e-3], ids=["refined", "as it is", "gathered"])
@pytest.mark.parametrize("stretch", STRETCHES)
def test_what_varies_linearly_is_summed_exactly(stretch: tuple[float, float, float], longest: float) -> None:
    ball, triangles = solids.sphere(RADIUS, 4)
    solid = ball * stretch + [0.1, -0.05, 0.2], triangles
    area, places = pressed(solid, longest)
    assert area.sum() == pytest.approx(np.linalg.norm(triangle_areas(*solid), axis=1).sum())
    assert area @ places == pytest.approx(integral(solid), rel=1e-12)
    assert (len(area) > 4 * len(ball)) == (longest < 2e-3) and (len(area) < 0.5 * len(ball)) == (longest > 6e-3)


@pytest.mark.parametrize("refinements", [2, 3, 4])
def test_points_are_about_as_deep_as_facets(refinements: int) -> None:
    ball, triangles = solids.sphere(RADIUS, refinements)
    _, places = pressed((ball, triangles), 2.0 * RADIUS / 2**refinements)
    inside = RADIUS - np.linalg.norm(places, axis=1)
    deepest = RADIUS - np.linalg.norm(ball[triangles].mean(axis=1), axis=1).min()
    assert 0.2 * deepest < inside.min() and inside.max() < 1.2 * deepest


@pytest.mark.parametrize("size", [(0.02, 0.03, 0.04), (0.05, 0.01, 0.01), (0.03, 0.03, 0.002)])
def test_edges_and_corners_are_pressed_where_they_are(size: tuple[float, float, float]) -> None:
    vertices, triangles = solids.box(size)
    area, places = pressed((vertices, triangles), 3e-3)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert (np.isclose(places, low) | np.isclose(places, high)).any(axis=1).all()
    for corner in vertices:
        assert (places == corner).all(axis=1).any()
    assert area.sum() == pytest.approx(np.linalg.norm(triangle_areas(vertices, triangles), axis=1).sum())
