"""A kind of body from outside that XPBD moves: a drop of beads, points without cells that nothing joins."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from pydantic import Field
from rich.console import Console
from test_discretisation import CORNERS, FACES

from softseam.checking import check_scene
from softseam_protocol.scene.bodies import BODIES
from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_protocol.scene.regions import OwnRegions
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Positive
from softseam_protocol.table import MissingRow
from softseam_services.bodies import DISCRETISATIONS, Points, Surface
from softseam_services.body.errors import MeshError
from softseam_services.orchestrator.cuts import cut
from softseam_services.orchestrator.parts import part_mesh
from softseam_services.tables import check_tables

RADIUS, MASS = 0.004, 2e-3


class BeadsBody(OwnRegions):
    """Beads side by side, which nothing joins."""

    kind: Literal["beads"] = "beads"
    count: int = Field(ge=1, description="of beads along x and y")
    height: Positive = Field(description="of their middles above the ground [m]")


def beads(spec: BeadsBody, files: Any) -> Points:
    at = np.stack(np.meshgrid(*2 * [np.arange(spec.count) * 3.0 * RADIUS]), axis=-1).reshape(-1, 2)
    x = np.column_stack([at, np.full(len(at), spec.height)])
    own = np.arange(len(x))
    surface = Surface(
        owner=own.repeat(6),
        offset=np.tile(RADIUS * CORNERS, (len(x), 1)),
        triangles=(FACES + 6 * own[:, None, None]).reshape(-1, 3),
    )
    return Points(x_rest=x, mass=np.full(len(x), MASS), surface=surface)


ROWS = ((BODIES, "beads", BeadsBody), (DISCRETISATIONS, "beads", beads))


def scene(**changes: Any) -> Scene:
    """16 beads, 1 mm above the ground."""
    body = {"kind": "beads", "count": 4, "height": RADIUS + 0.001}
    data = {"softseam": 1, "name": "beads", "step": 5e-3, "duration": 0.2, "body": body}
    return Scene.model_validate(data | {"tools": {"ground": {"kind": "plane"}}} | changes)


def test_a_check_says_what_they_are(tmp_path: Path) -> None:
    path = tmp_path / "beads.yaml"
    path.write_text(
        "softseam: 1\nname: beads\nduration: 0.1\nbody: {kind: beads, count: 4, height: 0.01}\n"
        "tools: {ground: {kind: plane}}\n"
    )
    said = StringIO()
    check_scene(str(path), (), Console(file=said, width=1000))
    assert "beads, 36 x 36 x 0 mm" in said.getvalue() and "32 g" in said.getvalue()


def test_a_part_of_points_has_a_mesh_without_cells() -> None:
    """By which a model from outside knows its points, and which surface points follow them."""
    spec, alone = BeadsBody(count=2, height=0.01), scene(body={"kind": "beads", "count": 2, "height": 0.01})
    body = beads(spec, {}).stand(alone, spec)
    mesh = part_mesh(body, cut("body", body, np.zeros(0, dtype=bool), "pbd", "pbd"), "body.far")
    assert mesh is not None and mesh.cell_nodes.shape == (0, 27)
    np.testing.assert_array_equal(mesh.mass, np.full(4, MASS))
    np.testing.assert_array_equal(mesh.x_rest[mesh.point_cell] + mesh.point_local, body.skin.points(body.x_rest))


def test_its_keys_are_read_as_those_of_other_bodies() -> None:
    said = "softseam: 1\nname: beads\nduration: 1.0\nbody: {kind: beads, count: 4, hight: 0.01}\n"
    with pytest.raises(SceneError, match=r"body\.hight: unknown key; did you mean 'height'"):
        parse_scene(said)
    with pytest.raises(SceneError, match=r"did you mean 'beads'\? \(allowed: cells, sheet, rope, tet_mesh, beads\)"):
        parse_scene(said.replace("beads,", "bead,"))


def test_a_kind_without_its_row_is_missed_at_start() -> None:
    DISCRETISATIONS.remove("beads")
    try:
        with pytest.raises(MissingRow, match="discretisations of bodies: no row 'beads', which the table of kinds of"):
            check_tables()
    finally:
        DISCRETISATIONS.add("beads", beads)


WRONG = [
    ({"mass": np.ones(3)}, r"beads gives mass of shape \(3,\): \(1,\)"),
    ({"mass": np.zeros(1)}, "without mass"),
    ({"x_rest": np.full((1, 3), np.nan)}, "finite"),
    ({"surface": Surface(np.array([1]), np.zeros((1, 3)), np.zeros((0, 3), dtype=int))}, r"owner .* none of 1 points"),
]


@pytest.mark.parametrize(("changes", "said"), WRONG)
def test_arrays_that_do_not_fit_are_refused(changes: dict[str, Any], said: str) -> None:
    own: dict[str, Any] = {"x_rest": np.zeros((1, 3)), "mass": np.ones(1)}
    own |= {"surface": Surface(np.zeros(1, dtype=int), np.zeros((1, 3)), np.zeros((0, 3), dtype=int))}
    with pytest.raises(MeshError, match=said):
        Points(**own | changes).stand(scene(), BeadsBody(count=1, height=0.01))
