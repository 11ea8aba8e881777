"""A mesh that a file has turned is simulated as it is where the file has it along its axes: its cells turn with it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import solids
from element_statics import Statics
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from test_hardly_filled import star

from softseam.claims.sibling import cell_edges, sibling_of
from softseam.embedded import EmbeddedBackend
from softseam.observation import von_mises
from softseam.session import Session
from softseam.view.surface import DisplaySurface
from softseam_protocol.messages.session import Frame
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.kinds import ELEMENTS, ElementKind
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.body.interpolate import bounding_points, rest_points
from softseam_services.body.tight_box import tightest_axes
from softseam_services.fem.joints import follow_roots
from softseam_services.orchestrator.quantities import RestingBody

Floats = NDArray[np.float64]

SIDE, GAP = 0.05, 5e-4
TURN = 0.7
"""about z, with the plates [rad]"""
ANY = np.linalg.qr(np.array([[0.9, 0.3, 0.2], [-0.4, 0.8, 0.5], [0.1, -0.6, 0.9]]))[0]


def about_z(angle: float) -> Floats:
    return np.array(
        [[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )


def brick() -> tuple[Floats, solids.Triangles]:
    return solids.box((SIDE, 0.8 * SIDE, 0.7 * SIDE))


def loaf() -> tuple[Floats, solids.Triangles]:
    """Half of a cylinder on its flat side: its surface cuts cells however these lie."""
    vertices, triangles = solids.cylinder(0.02, 0.06, 24, np.array([1.0, 0.0, 0.0]))
    angle = np.arctan2(vertices[0, 2], vertices[0, 1])
    about_x = np.array([[1, 0, 0], [0, np.cos(angle), np.sin(angle)], [0, -np.sin(angle), np.cos(angle)]])
    vertices = vertices @ about_x.T  # so that two of its corners are in the plane that cuts it
    vertices[:, 2] = np.maximum(vertices[:, 2], 0.0)
    return vertices, triangles


def squeezed(solid: tuple[Floats, solids.Triangles], turn: float, **keys: Any) -> tuple[Scene, bytes]:
    """Between plates that close along y by a tenth of its width; all is turned about z."""
    about, width = about_z(turn), float(np.ptp(solid[0][:, 1]))
    away = 0.5 * width + GAP + 0.005
    plate = {"kind": "box", "size": [0.1, 0.01, 0.1], "friction": 0.5, "rotation": [0.0, 0.0, turn]}
    scene = {
        "softseam": 1,
        "name": "turned",
        "step": 0.02,
        "body": {
            "shape": {"kind": "mesh", "path": "solid.obj"},
            "material": {"young": 2e4, "poisson": 0.4, "density": 1000.0, "retardation_time": 0.005},
        },
        "tools": {
            "ground": {"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 1], "friction": 0.5},
            **{
                side: {**plate, "position": (about @ [0.0, sign * away, 0.35 * SIDE]).tolist()}
                for side, sign in (("left", -1.0), ("right", 1.0))
            },
        },
        "motion": [
            {"tools": ["left", "right"], "close": (GAP + 0.05 * width) / 0.2, "until": {"time": 0.2}},
            {"hold": 0.1},
        ],
        "quantities": ["grip_force", "von_mises_p99", "sag", "compression"],
        **keys,
    }
    return Scene.model_validate(scene), solids.obj(solid[0] @ about.T, solid[1])


def opened(scene: Scene, file: bytes) -> Session:
    bundle = bundle_scene(scene, {"solid.obj": file})
    return Session(scene, bundle, EmbeddedBackend(bundle))


def run(scene: Scene, file: bytes) -> tuple[list[float], dict[str, float], Frame]:
    """Grip in each step [N], and what is measured, and how it is, in the end."""
    forces: list[float] = []
    with opened(scene, file) as session:
        session.reset()
        session.run(lambda seen: forces.append(seen.grip_force), fields=True)
        return forces, dict(session.last.quantities), session.last.frames["body"]


def built(solid: tuple[Floats, solids.Triangles], turn: Floats, **keys: Any) -> Body:
    body = {
        "shape": {"kind": "mesh", "path": "solid.obj"},
        "material": {"kind": "neo_hookean", "young": 2e4, "poisson": 0.4, "density": 1000.0},
        **keys,
    }
    scene = Scene.model_validate({"softseam": 1, "name": "turned", "duration": 1.0, "body": body})
    return build_body(scene, {"solid.obj": solids.obj(solid[0] @ turn.T, solid[1])})


@pytest.mark.parametrize("solid", [brick, loaf])
def test_it_has_the_cells_that_it_has_along_the_axes(solid: Any) -> None:
    straight, turned = built(solid(), np.eye(3)), built(solid(), ANY)
    assert turned.n_cells == straight.n_cells
    cosines = np.sort(np.abs(turned.axes.T @ ANY), axis=1)  # each is one of the solid's, in some order
    np.testing.assert_allclose(cosines, np.tile([0.0, 0.0, 1.0], (3, 1)), atol=1e-6)
    assert np.sort(turned.edges) == pytest.approx(np.sort(straight.edges), rel=1e-9)
    assert turned.total_mass == pytest.approx(straight.total_mass, rel=1e-9)
    np.testing.assert_allclose(np.sort(turned.fill.sum(axis=1)), np.sort(straight.fill.sum(axis=1)), atol=1e-9)
    np.testing.assert_allclose(turned.axes.T @ turned.axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(turned.axes) == pytest.approx(1.0)


def test_its_surface_is_where_the_file_has_it() -> None:
    vertices, triangles = loaf()
    turned = vertices @ ANY.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    base = np.array([*0.5 * (low + high)[:2], low[2]])
    points = rest_points(built((vertices, triangles), ANY))
    for corner in turned - base:
        assert np.linalg.norm(points - corner, axis=1).min() < 1e-9
    np.testing.assert_allclose(points.min(axis=0), low - base, atol=1e-9)
    np.testing.assert_allclose(points.max(axis=0), high - base, atol=1e-9)


def test_it_reaches_as_far_as_the_solid_does() -> None:
    """Not as far as its cells' nodes, of which some are beyond the surface."""
    vertices, triangles = loaf()
    turned, body = vertices @ ANY.T, built((vertices, triangles), ANY)
    np.testing.assert_allclose(np.ptp(bounding_points(body), axis=0), np.ptp(turned, axis=0), rtol=1e-9)
    rest = RestingBody(body)
    assert rest.top - rest.bottom == pytest.approx(float(np.ptp(turned[:, 2])))
    assert float(np.ptp(body.x_rest[:, 2])) > 1.2 * (rest.top - rest.bottom)


@pytest.mark.parametrize("element", [kind for kind in ELEMENTS if not kind.startswith("tet")])
def test_at_rest_it_is_not_deformed(element: ElementKind) -> None:
    """Gradients of all tables are along the scene's axes: sum_a x_a (x) grad N_a is the unit matrix, of the whole cell
    and of an octant that is cut."""
    body = built(loaf(), ANY)
    case = Statics(body, element)
    rule, cells = case.parameters.rule, body.x_rest[body.cell_nodes]
    whole = np.einsum("cbai,cbqja->cbqij", cells[:, rule.nodes], rule.gradient[rule.shape])
    np.testing.assert_allclose(whole, np.broadcast_to(np.eye(3), whole.shape), atol=1e-9)
    tables, cut = case.parameters, case.model.cut >= 0
    if len(tables.cut_gradient):
        for gradient in (tables.cut_gradient, tables.own_gradient):
            found = np.einsum("cai,caqj->cqij", cells[cut], gradient.reshape(-1, 27, 8, 3))
            there = body.fill[cut] > 0.0
            np.testing.assert_allclose(found[there], np.broadcast_to(np.eye(3), found[there].shape), atol=1e-6)
        full = np.einsum("cai,aqj->cqij", cells[~cut], tables.gradient.reshape(27, 8, 3))
        np.testing.assert_allclose(full, np.broadcast_to(np.eye(3), full.shape), atol=1e-9)


def test_slivers_follow_their_roots_at_rest() -> None:
    """The same of sliver cells that are joined to another: its functions, extended, have their nodes where they are."""
    body = built(star(), ANY, cell=0.009)
    case = Statics(body, "hex27")
    joints, numbers = case.model.joints, case.parameters.joints
    assert np.abs(body.axes - np.eye(3)).max() > 0.1 and len(joints.cell) > 0 and len(joints.tied) > 0
    np.testing.assert_allclose(follow_roots(joints, numbers, body.x_rest), body.x_rest, atol=1e-12)
    of_group = np.repeat(np.arange(len(joints.cell)), np.diff(joints.group))
    x = np.where(joints.nodes[:, :, None] >= 0, body.x_rest[joints.nodes], 0.0)
    found = np.einsum("gmi,gjm->gij", x[of_group], numbers.gradient)
    np.testing.assert_allclose(found, np.broadcast_to(np.eye(3), found.shape), atol=1e-6)


@pytest.mark.parametrize("keys", [{"fixed": [{"min": [-1, -1, -1], "max": [1, 1, 0.001]}]}, {"linear": True}])
def test_cells_lie_along_the_scene_where_it_speaks_of_its_axes(keys: dict[str, Any]) -> None:
    """A box that clamps nodes, and a law that knows the axes."""
    if keys.pop("linear", False):
        keys["material"] = {"kind": "linear", "young": 2e4, "poisson": 0.4, "density": 1000.0}
    assert np.array_equal(built(brick(), about_z(TURN), **keys).axes, np.eye(3))
    assert not np.array_equal(built(brick(), about_z(TURN)).axes, np.eye(3))


def test_axes_stay_where_a_box_around_the_solid_is_hardly_tighter() -> None:
    ball, _ = solids.sphere(0.02, 4)
    assert np.array_equal(tightest_axes(ball @ ANY.T), np.eye(3))
    assert np.array_equal(tightest_axes(brick()[0]), np.eye(3))
    assert np.array_equal(tightest_axes(brick()[0] * [1.0, 1.0, 0.0]), np.eye(3))  # flat


@pytest.mark.parametrize("solid", [brick, loaf])
@pytest.mark.parametrize(
    ("regions", "off"),
    [
        ({"default": "fem"}, 1e-3),
        ({"default": "pbd"}, 2e-3),
        ({"default": "pbd", "near": {"model": "fem", "within": 0.012}}, 5e-3),
    ],
    ids=["fem", "pbd", "hybrid"],
)
def test_forces_and_stress_turn_with_it(solid: Any, regions: dict[str, Any], off: float) -> None:
    """In both models and in a hybrid: the grip in every step, what is measured, and the stress of the octants."""
    (straight, measured, as_drawn), (turned, measured_turned, as_turned) = (
        run(*squeezed(solid(), turn, regions=regions)) for turn in (0.0, TURN)
    )
    assert turned == pytest.approx(straight, rel=off, abs=off * max(straight))
    assert measured_turned["compression"] == pytest.approx(measured["compression"], abs=1e-9)
    assert measured_turned["sag"] == pytest.approx(measured["sag"], abs=5e-6)
    assert measured_turned["von_mises_p99"] == pytest.approx(measured["von_mises_p99"], rel=5 * off)
    stress = [np.sort(von_mises(frame.cauchy).ravel()) for frame in (as_drawn, as_turned)]
    np.testing.assert_allclose(stress[1], stress[0], atol=5 * off * stress[0].max())


@pytest.mark.parametrize("solid", [brick, loaf])
def test_probes_and_estimates_turn_with_it(solid: Any) -> None:
    found = []
    for turn in (0.0, TURN):
        at = (about_z(turn) @ [0.011, 0.004, 0.007]).tolist()
        scene, file = squeezed(solid(), turn, regions={"default": "fem"}, probes={"inside": at})
        with opened(scene, file) as session:
            session.reset()
            last = session.run(fields=True)
            estimate = session.estimate_errors()
        assert estimate is not None
        probed = {name: value for name, value in last.quantities.items() if name.startswith("inside")}
        found.append((probed, estimate.mesh_error))
    (probed, mesh), (probed_turned, mesh_turned) = found
    assert len(probed) >= 2
    assert probed_turned == pytest.approx(probed, rel=0.01)
    assert mesh_turned == pytest.approx(mesh, rel=0.02)


def test_its_sibling_has_half_as_many_cells_along_each_axis() -> None:
    found = []
    for turn in (0.0, TURN):
        scene, file = squeezed(loaf(), turn, regions={"default": "fem"})
        with opened(scene, file) as session:
            frames = session.reset().frames
            sibling = sibling_of(scene, frames)
        assert isinstance(scene.body, BodySpec) and isinstance(sibling.scene.body, BodySpec)
        other = build_body(sibling.scene, {"solid.obj": file})
        assert isinstance(sibling.scene.body.cell, tuple)
        found.append((cell_edges(scene.body, frames["body"]), sibling.scene.body.cell, other.n_cells))
    (edges, cell, cells), (edges_turned, cell_turned, cells_turned) = found
    np.testing.assert_allclose(edges_turned, edges, rtol=1e-6)
    np.testing.assert_allclose(cell_turned, cell, rtol=1e-6)
    assert cells_turned == cells


def test_it_is_drawn_with_the_stress_that_it_is_drawn_with_along_the_axes() -> None:
    drawn = []
    for turn in (0.0, TURN):
        scene, file = squeezed(loaf(), turn, regions={"default": "fem"})
        with opened(scene, file) as session:
            session.reset()
            session.run(fields=True)
            mesh = session.surface_meshes()["body"]
            surface, frame = DisplaySurface(mesh), session.last.frames["body"]
        corners = np.unique(mesh.triangles)
        drawn.append(
            ((mesh.point_rest @ about_z(turn))[corners], surface.load(frame)[corners], len(surface.cell_lines))
        )
    (at, load, lines), (at_turned, load_turned, lines_turned) = drawn
    away, there = cKDTree(at).query(at_turned)
    same = away < 1e-9  # edges of equal length may be split in another order
    assert same.mean() > 0.9
    np.testing.assert_allclose(load_turned[same], load[there[same]], atol=0.01 * load.max())
    assert lines_turned > 0.9 * lines > 0
