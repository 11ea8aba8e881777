"""A shape from outside, of tools and of inclusions: an ellipsoid, by its half axes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from pydantic import Field
from solids import obj, sphere

import softseam
from softseam.recording import Recording
from softseam.view.tool_shapes import tool_shapes
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.parts import PARTS, PartSpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Positive, Vector
from softseam_protocol.scene.tools import TOOLS, SolidTool
from softseam_services.body.errors import SettingError
from softseam_services.body.inclusions import holds
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.shapes import SHAPES, Geometry, Sameness, Shape
from softseam_services.shapes.turns import quaternion_turning


class Ellipsoid(SolidTool):
    kind: Literal["ellipsoid"] = "ellipsoid"
    half: tuple[Positive, Positive, Positive] = Field(description="half axes [m]")
    rotation: Vector = Field(default=(0.0, 0.0, 0.0), description="turn at time 0: axis times angle [rad]")


class EllipsoidPart(PartSpec):
    kind: Literal["ellipsoid"] = "ellipsoid"
    half: tuple[Positive, Positive, Positive] = Field(description="half axes [m]")
    rotation: Vector = Field(default=(0.0, 0.0, 0.0), description="turn: axis times angle [rad]")


def distance(numbers, x, y, z):  # type: ignore[no-untyped-def]
    """The nearest point is (a^2 x/(a^2 + t), ...), with the t > -min a^2 that puts it on the surface: halving."""
    aa, bb, cc = numbers[0] ** 2, numbers[1] ** 2, numbers[2] ** 2
    size = np.sqrt(x * x + y * y + z * z)
    largest = max(numbers[0], numbers[1], numbers[2])
    low, high = -min(aa, bb, cc), largest * size + largest * largest
    for _ in range(200):
        t = 0.5 * (low + high)
        if t in (low, high):
            break
        over = aa * (x / (aa + t)) ** 2 + bb * (y / (bb + t)) ** 2 + cc * (z / (cc + t)) ** 2 > 1.0
        low, high = (t, high) if over else (low, t)
    px, py, pz = x / (aa + high), y / (bb + high), z / (cc + high)
    steep = np.sqrt(px * px + py * py + pz * pz)  # p is the gradient of the implicit form there, half of it
    if steep == 0.0:
        return -min(numbers[0], numbers[1], numbers[2]), 0.0, 0.0, 1.0
    return high * steep, px / steep, py / steep, pz / steep


def geometry(spec: Ellipsoid | EllipsoidPart, files: Any) -> Geometry:
    half = np.array(spec.half)
    vertices, triangles = sphere(1.0, 4)
    return Geometry.of_surface(
        half,
        half * vertices,
        triangles.astype(np.int32),
        reach=float(half.max()),
        orientation=quaternion_turning(np.array(spec.rotation)),
        extent=lambda direction: float(np.linalg.norm(half * direction)),
        sameness=Sameness(lengths=spec.half),
        core=np.array([[0.0, 0.0, 0.0, half.min()]]),
    )


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    TOOLS.add("ellipsoid", Ellipsoid)
    PARTS.add("ellipsoid", EllipsoidPart)
    SHAPES.add("ellipsoid", Shape(geometry, distance))
    yield
    TOOLS.remove("ellipsoid")
    PARTS.remove("ellipsoid")
    SHAPES.remove("ellipsoid")


RADIUS, TOP = 0.008, 0.02
HALF = [0.012, 0.008, 0.006]
BALL: dict[str, Any] = {"kind": "ellipsoid", "half": [RADIUS] * 3, "position": [0, 0, TOP + RADIUS]}
SPHERE = {"kind": "sphere", "radius": RADIUS, "position": BALL["position"]}
EGG: dict[str, Any] = {"kind": "ellipsoid", "half": HALF, "position": [0, 0, TOP + HALF[2]]}
MESH = {"kind": "mesh", "path": "egg.obj", "position": EGG["position"]}
FILES = {"egg.obj": obj(np.array(HALF) * sphere(1.0, 5)[0], sphere(1.0, 5)[1])}


def scene(tool: dict[str, Any], model: str, symmetry: tuple[str, ...] = ()) -> Scene:
    """A block on the ground; a tool that is pressed into its middle from above, and held."""
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "press",
            "step": 0.005,
            "gravity": [0, 0, 0],
            "body": {
                "shape": {"kind": "block", "size": [0.04, 0.04, TOP]},
                "cell": 0.01,
                "material": {"young": 2e4, "poisson": 0.3, "density": 1000.0},
            },
            "tools": {"ground": {"kind": "plane"}, "tool": {**tool, "friction": 0.3}},
            "motion": [{"tools": ["tool"], "move": [0, 0, -0.001], "speed": 0.01}, {"hold": 0.1}],
            "regions": {"default": model},
            "symmetry": symmetry,
        }
    )


def force(scene: Scene) -> float:
    """Of the body on the tool at the end, along z [N]."""
    simulation = Simulation(Bundle(scene.model_dump_json(), FILES), EmbeddedTransport())
    report = simulation.step()
    while not report.done:
        report = simulation.step()
    simulation.close()
    return float(report.wrench[1, 2])


@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_shape_from_outside_presses_as_the_same_shape_told_otherwise(model: str) -> None:
    """With equal half axes as a sphere; with others as a fine mesh, whose facets lie a little below it."""
    ball = force(scene(BALL, model))
    assert ball > 0.01
    assert ball == pytest.approx(force(scene(SPHERE, model)), rel=1e-6)
    egg = force(scene(EGG, model))
    assert egg == pytest.approx(force(scene(MESH, model)), rel=0.02)
    assert abs(egg / ball - 1.0) > 0.05


def test_a_shape_from_outside_has_images_in_planes_of_symmetry() -> None:
    """A quarter of the block answers as all of it; turned askew, the ellipsoid has no image."""
    assert force(scene(EGG, "fem", ("x", "y"))) == pytest.approx(force(scene(EGG, "fem")), rel=1e-3)
    with pytest.raises(SettingError, match="tool 'tool' has no image"):
        force(scene(EGG | {"rotation": [0, 0, 0.3]}, "fem", ("x", "y")))


def test_a_part_of_a_body_may_be_of_a_shape_from_outside() -> None:
    """A turned one, which holds as many places at random as its volume says: within four standard deviations."""
    part = EllipsoidPart(position=(0.1, -0.2, 0.3), half=(0.6, 0.4, 0.3), rotation=(0.4, -0.3, 0.9))
    inside = holds(part, np.random.default_rng(1).uniform(-1.0, 1.5, (100_000, 3)))
    share = 4.0 / 3.0 * np.pi * 0.6 * 0.4 * 0.3 / 2.5**3
    assert abs(inside.mean() - share) < 4.0 * np.sqrt(share / len(inside))


def test_a_recording_has_the_surface_of_a_shape_from_outside(tmp_path: Path) -> None:
    with softseam.open(scene(EGG, "fem"), record=tmp_path / "egg.mcap") as sim:
        sim.reset(seed=0)
        sim.step()
    recording = Recording(tmp_path / "egg.mcap")
    assert recording.surfaces
    drawn = tool_shapes(recording.scene, 0.04, recording.surfaces["body"].tools)[1]
    assert drawn.kind == "ellipsoid"
    np.testing.assert_allclose(np.linalg.norm(drawn.vertices / HALF, axis=1), 1.0, atol=1e-12)
    assert len(drawn.triangles) == 8 * 4**4


def test_a_kind_without_a_shape_fails_at_start() -> None:
    TOOLS.add("forgotten", Ellipsoid)
    try:
        with pytest.raises(softseam.BadInput, match="table of shapes: no row 'forgotten'"):
            softseam.open(scene(BALL, "fem"))
    finally:
        TOOLS.remove("forgotten")


def test_a_row_that_does_not_fit_is_told_of() -> None:
    """A distance that returns too little, and a geometry that nobody could draw."""

    def flat(numbers, x, y, z):  # type: ignore[no-untyped-def]
        return z

    def unseen(spec: Ellipsoid, files: Any) -> Geometry:
        return Geometry(np.array(spec.half), np.zeros((1, 3)), 1.0)

    for row, words in ((Shape(geometry, flat), "4 floats"), (Shape(unseen, distance), "has no surface")):
        SHAPES.remove("ellipsoid")
        SHAPES.add("ellipsoid", row)
        with pytest.raises(softseam.BadInput, match=words):
            softseam.open(scene(BALL, "fem"))
