"""Points at which tools touch a surface: they stand for its area where that is, not where its vertices stick out."""

from __future__ import annotations

import numpy as np
import pytest
import solids

from softseam_services.body.body import Ints
from softseam_services.body.embed import embed
from softseam_services.body.surface_check import triangle_areas
from softseam_services.body.surface_points import contact_points

RADIUS = 0.03
STRETCHES = [(1.0, 1.0, 1.0), (1.0, 1.7, 0.6), (0.5, 1.0, 2.0)]


def pressed(vertices: solids.Floats, triangles: Ints, longest: float) -> tuple[solids.Floats, solids.Floats]:
    """Areas (k,) and places (k, 3) of what tools press."""
    places, area, *_ = contact_points(vertices, triangles, longest)
    assert (places[: len(vertices)] == vertices).all()
    return area[area > 0.0], places[area > 0.0]


def areas_of(vertices: solids.Floats, triangles: Ints) -> solids.Floats:
    """Of the triangles (T,) [m^2]."""
    return np.asarray(np.linalg.norm(triangle_areas(vertices, triangles), axis=1))


def ball_of(refinements: int) -> tuple[solids.Floats, Ints]:
    """Vertices (n, 3) [m] and triangles (T, 3)."""
    vertices, triangles = solids.sphere(RADIUS, refinements)
    return vertices, triangles.astype(np.int32)


@pytest.mark.parametrize("longest", [1e-3, 4e-3, 12e-3], ids=["refined", "as it is", "gathered"])
@pytest.mark.parametrize("stretch", STRETCHES)
def test_what_varies_linearly_is_summed_exactly(stretch: tuple[float, float, float], longest: float) -> None:
    ball, triangles = ball_of(4)
    vertices = ball * stretch + [0.1, -0.05, 0.2]
    area, places = pressed(vertices, triangles, longest)
    areas = areas_of(vertices, triangles)
    assert area.sum() == pytest.approx(areas.sum())
    assert area @ places == pytest.approx(areas @ vertices[triangles].mean(axis=1), rel=1e-12)
    assert (len(area) > 4 * len(ball)) == (longest < 2e-3) and (len(area) < 0.5 * len(ball)) == (longest > 6e-3)


@pytest.mark.parametrize("refinements", [2, 3, 4])
def test_points_are_about_as_deep_as_facets(refinements: int) -> None:
    ball, triangles = ball_of(refinements)
    _, places = pressed(ball, triangles, 2.0 * RADIUS / 2**refinements)
    inside = RADIUS - np.linalg.norm(places, axis=1)
    deepest = RADIUS - np.linalg.norm(ball[triangles].mean(axis=1), axis=1).min()
    assert 0.2 * deepest < inside.min() and inside.max() < 1.2 * deepest


@pytest.mark.parametrize("size", [(0.02, 0.03, 0.04), (0.05, 0.01, 0.01), (0.03, 0.03, 0.002)])
def test_edges_and_corners_are_pressed_where_they_are(size: tuple[float, float, float]) -> None:
    vertices, corners = solids.box(size)
    triangles = corners.astype(np.int32)
    area, places = pressed(vertices, triangles, 3e-3)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert (np.isclose(places, low) | np.isclose(places, high)).any(axis=1).all()
    for corner in vertices:
        assert (places == corner).all(axis=1).any()
    assert area.sum() == pytest.approx(areas_of(vertices, triangles).sum())


@pytest.mark.kernels
@pytest.mark.parametrize("cell", [0.005, 0.01, 0.02])
def test_no_empty_cell_is_kept_for_a_point_inside_a_fold(cell: float) -> None:
    """A step with a slope of 45 degrees: at its foot, a line of the lattice, what is nearest to a vertex has its middle
    above the flat part, where no cell is filled."""
    width = 0.06
    profile = 0.02 * np.array([[-3, 0], [3, 0], [3, 3], [2, 3], [0, 1], [-3, 1]])
    vertices = np.concatenate([np.insert(profile, 1, y, axis=1) for y in (0.0, width)])
    front = [(0, 1, 4), (0, 4, 5), (1, 2, 3), (1, 3, 4)]
    sides = [((i, i + 6, j + 6), (i, j + 6, j)) for i, j in zip(range(6), [1, 2, 3, 4, 5, 0], strict=True)]
    back = [(a + 6, c + 6, b + 6) for a, b, c in front]
    triangles = np.array([*front, *back, *(one for two in sides for one in two)], dtype=np.int32)
    embedded = embed("step.obj", vertices, triangles, np.full(3, cell))
    assert embedded.moments[:, :, 0].sum(axis=1).min() > 0.1
    assert embedded.surface.area.sum() == pytest.approx(areas_of(vertices, triangles).sum())
