"""How each kind of body is divided into what solvers hold: cells, particles, or points without cells.

A row takes a body's specification and the files of its scene, by the paths that it gives them, and returns what can
stand in that scene. `Points` do; so does whatever else has `stand`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from softseam_protocol.scene.bodies import AnyBody as AnyBodySpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.table import Table
from softseam_services.body.build import AnyBody, build_cells
from softseam_services.body.lattices import build_rope, build_sheet
from softseam_services.body.points import Points, Surface
from softseam_services.body.tet_mesh import build_tet_mesh

__all__ = ["DISCRETISATIONS", "AnyBody", "Discretised", "Points", "Surface", "build_any_body"]

Files = Mapping[str, bytes]


class Discretised(Protocol):
    """What a row returns."""

    def stand(self, scene: Scene, spec: Any) -> AnyBody:
        """The body, of this specification, in a scene with that body alone; the same scene gives the same bits in every
        process."""


@dataclass(frozen=True)
class _InScene:
    """A body that more of its scene decides than its own keys: tools that its cells end at, gravity, models."""

    build: Callable[[Scene, Any, Files], AnyBody]
    files: Files

    def stand(self, scene: Scene, spec: Any) -> AnyBody:
        return self.build(scene, spec, self.files)


Row = Callable[[Any, Files], Discretised]


def _in_scene(build: Callable[[Scene, Any, Files], AnyBody]) -> Row:
    return lambda spec, files: _InScene(build, files)


DISCRETISATIONS: Table[Row] = Table(
    "discretisations of bodies",
    {
        "cells": _in_scene(build_cells),
        "sheet": _in_scene(lambda scene, spec, files: build_sheet(scene, spec)),
        "rope": _in_scene(lambda scene, spec, files: build_rope(scene, spec)),
        "tet_mesh": _in_scene(build_tet_mesh),
    },
)
"""what builds each specification in softseam_protocol.scene.bodies.BODIES"""


def build_any_body(scene: Scene, spec: AnyBodySpec, files: Files) -> AnyBody:
    """The body of a scene with that body alone, of whatever kind; the same bits in every process.

    files: contents by the path that the scene gives them. Raises MeshError where a shape cannot be simulated, and
    MissingRow where the kind has no row.
    """
    return DISCRETISATIONS[spec.kind](spec, files).stand(scene, spec)
