"""Surfaces as others touch them: points that stand for all of the area and follow the nodes, and where each looks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import solids

from softseam_protocol.scene.kinds import Functions
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.errors import SettingError
from softseam_services.body.sampled_faces import SampledFaces, sampled_faces

pytestmark = pytest.mark.kernels

RADIUS = 0.025
BALL = solids.obj(*solids.sphere(RADIUS, 3))
BOX = solids.obj(*solids.box((0.03, 0.05, 0.02)))


def body_of(shape: dict[str, Any], **keys: Any) -> Body:
    spec = {"shape": shape, "cell": 0.01, "material": {"young": 1e5, "poisson": 0.3, "density": 1000.0}} | keys
    scene = Scene.model_validate({"softseam": 1, "name": "one", "duration": 1.0, "body": spec})
    return build_body(scene, {"ball.obj": BALL, "box.obj": BOX})


MESHES = {"ball": {"kind": "mesh", "path": "ball.obj"}, "box": {"kind": "mesh", "path": "box.obj"}}
BLOCK = {"kind": "block", "size": [0.03, 0.05, 0.02]}
SHAPES = MESHES | {"block": BLOCK}
FUNCTIONS: tuple[Functions, ...] = ("hex8", "hex27")


def triangle_area(body: Body, faces: SampledFaces) -> float:
    x = faces.places(body.x_rest[faces.nodes])[faces.triangles]
    return float(0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum())


@pytest.mark.parametrize("functions", FUNCTIONS)
@pytest.mark.parametrize("name", SHAPES)
def test_points_stand_for_all_of_the_surface(name: str, functions: Functions) -> None:
    body = body_of(SHAPES[name])
    faces = sampled_faces(body, functions, 0.005)
    assert faces.area.sum() == pytest.approx(triangle_area(body, faces), rel=1e-12)
    if name == "ball":
        assert faces.area.sum() == pytest.approx(4.0 * np.pi * RADIUS**2, rel=0.015)  # by facets
    else:
        assert faces.area.sum() == pytest.approx(2.0 * (0.03 * 0.05 + 0.03 * 0.02 + 0.05 * 0.02), rel=1e-9)


@pytest.mark.parametrize("functions", FUNCTIONS)
@pytest.mark.parametrize("name", SHAPES)
def test_points_follow_a_linear_field_exactly(name: str, functions: Functions) -> None:
    """Also where nodes are clamped, with what these add at rest."""
    clamped = [{"min": [-1.0, -1.0, -1.0], "max": [1.0, 1.0, 0.006]}]
    turn = np.array([[0.9, 0.2, -0.1], [0.0, 1.1, 0.3], [0.2, -0.1, 0.8]])
    for keys in ({}, {"fixed": clamped}):
        body = body_of(SHAPES[name], **keys)
        faces = sampled_faces(body, functions, 0.005)
        rest = faces.places(body.x_rest[faces.nodes])
        assert bool(body.fixed.any()) == bool(keys)
        if keys:
            moved = faces.places(body.x_rest[faces.nodes] + [0.0, 0.0, 0.01])
            held = 1.0 - np.asarray(faces.weights.sum(axis=1))
            np.testing.assert_allclose(moved, rest + np.outer(1.0 - held, [0.0, 0.0, 0.01]), atol=1e-12)
        else:
            np.testing.assert_allclose(faces.places(body.x_rest[faces.nodes] @ turn.T), rest @ turn.T, atol=1e-12)


@pytest.mark.parametrize("name", SHAPES)
def test_patches_take_up_all_of_each_point(name: str) -> None:
    faces = sampled_faces(body_of(SHAPES[name]), "hex27", 0.005)
    np.testing.assert_allclose(faces.part.sum(axis=1), 1.0, rtol=1e-12)
    assert faces.part.min() >= 0.0
    used = np.unique(faces.among[faces.part > 0.0])
    np.testing.assert_array_equal(used, np.arange(faces.n_patches))
    assert faces.n_patches <= len(faces.area)


@pytest.mark.parametrize("functions", FUNCTIONS)
def test_a_ball_is_rounded_and_a_box_has_edges(functions: Functions) -> None:
    """Points look along the radius to 3 degrees, and those inside a box's faces along its normals."""
    body = body_of(MESHES["ball"])
    faces = sampled_faces(body, functions, 0.005)
    assert faces.rounded.all()
    x = faces.places(body.x_rest[faces.nodes])
    radial = (x - [0.0, 0.0, RADIUS]) / np.linalg.norm(x - [0.0, 0.0, RADIUS], axis=1, keepdims=True)
    np.testing.assert_allclose(faces.upon_share.sum(axis=1), 1.0, rtol=1e-12)
    upon = np.einsum("pk,pki->pi", faces.upon_share, x[faces.upon])
    assert np.linalg.norm(upon - x, axis=1).max() < 0.02 * RADIUS
    normal = np.einsum("pk,pki->pi", faces.upon_share, radial[faces.upon])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert np.einsum("pi,pi->p", normal, radial).min() > np.cos(np.radians(3.0))
    box = body_of(MESHES["box"])
    faces = sampled_faces(box, functions, 0.005)
    x = faces.places(box.x_rest[faces.nodes])
    sides = np.column_stack([np.abs(x[:, :2]) - [0.015, 0.025], x[:, 2], x[:, 2] - 0.02])
    on_faces = np.isclose(sides, 0.0, atol=1e-9).sum(axis=1)
    corners = faces.triangles
    assert not faces.rounded[on_faces[corners] > 1].any() and faces.rounded[on_faces[corners] == 1].all()


def test_tetrahedra_are_refused() -> None:
    body = body_of(BLOCK)
    object.__setattr__(body, "tetrahedra", True)
    with pytest.raises(SettingError, match="tetrahedra"):
        sampled_faces(body, "hex8", 0.005)
