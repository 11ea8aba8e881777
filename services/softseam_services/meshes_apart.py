"""Bodies that begin inside each other, where one of them is no block: blocks are seen to as a scene is read
(`softseam_protocol.scene.apart`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from softseam_protocol.scene.bodies import block_of
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import ALIKE, Body, Floats, Ints
from softseam_services.body.build import AnyBody
from softseam_services.body.errors import SettingError
from softseam_services.body.interpolate import rest_points


class _Surface(NamedTuple):
    x: Floats
    triangles: Ints
    corners: Ints


class Overlap(NamedTuple):
    """Two bodies of which one begins inside the other."""

    one: str
    other: str
    """the later of the two"""
    depth: float
    """how deep a point of one is inside the other at most [m]"""
    way: Floats
    """by which the other is to be moved for that point to be outside (3,) [m]"""


def check_meshes_apart(scene: Scene, bodies: Mapping[str, AnyBody]) -> None:
    """Raise SettingError where bodies that touch begin inside each other, blocks apart: which two, how deep, and what
    to move by how much."""
    found = list(_overlaps(scene, bodies))
    if not found:
        return
    worst = max(found, key=lambda each: each.depth)
    deep, others = f"{1e3 * worst.depth:.3g} mm", f"; {len(found) - 1} more do so" if len(found) > 1 else ""
    of = repeated(worst.other)
    if of and of == repeated(worst.one):
        raise SettingError(
            f"bodies.{of}.repeat: {worst.one} and {worst.other} begin {deep} inside each other: give copies so much "
            f"more room, or less shake and size{others}"
        )
    way = [float(f"{part:.3g}") for part in worst.way]
    raise SettingError(
        f"bodies.{of or worst.other}.position: {worst.other} begins {deep} inside {worst.one}: move it by {way} m or "
        f"more{others}"
    )


def _overlaps(scene: Scene, bodies: Mapping[str, AnyBody]) -> Iterator[Overlap]:
    place = {name: number for number, name in enumerate(scene.bodies)}
    surfaces: dict[str, _Surface] = {}
    for each in scene.interfaces.values():
        one, other = sorted(each.between, key=place.__getitem__)
        blocks = all(block_of(scene.bodies[name]) is not None for name in (one, other))
        if each.kind != "contact" or blocks:
            continue
        for name in (one, other):
            body = bodies[name]
            if name not in surfaces and body.has_cells:
                surfaces[name] = _surface_of(body)
        if one in surfaces and other in surfaces:
            found = _overlap(surfaces[one], surfaces[other])
            if found is not None:
                yield Overlap(one, other, *found)


def _surface_of(body: Body) -> _Surface:
    return _Surface(rest_points(body), body.surface.triangles, np.unique(body.surface.triangles))


def _overlap(one: _Surface, other: _Surface) -> tuple[float, Floats] | None:
    """How deep a corner of either is inside the other at most [m], and by what the other is to be moved (3,) [m]."""
    x = one.x[one.corners], other.x[other.corners]
    low, high = np.maximum(x[0].min(axis=0), x[1].min(axis=0)), np.minimum(x[0].max(axis=0), x[1].max(axis=0))
    slack = ALIKE * min(float(np.ptp(each, axis=0).max()) for each in x)
    if (high - low < slack).any():
        return None
    import igl  # a third of a second, where bodies are close by

    deepest, way = slack, None
    for points, into, sign in ((x[0], other, -1.0), (x[1], one, 1.0)):
        near = points[((points >= low) & (points <= high)).all(axis=1)]
        triangles = into.triangles.astype(np.int64)
        inside = near[igl.winding_number(into.x, triangles, near) > 0.5] if len(near) else near
        if not len(inside):
            continue
        squares, _, nearest = igl.point_mesh_squared_distance(inside, into.x, triangles)
        worst = int(np.argmax(squares))
        if squares[worst] > deepest**2:
            deepest, way = float(np.sqrt(squares[worst])), sign * (nearest[worst] - inside[worst])
    return None if way is None else (deepest, way)
