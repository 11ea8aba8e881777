"""How each kind of body is divided into what solvers hold: cells, particles, or points without cells.

A row takes a body's specification and the files of its scene, by the paths that it gives them, and returns what can
stand in that scene. `Points` do; so does whatever else has `stand`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.particles import RopeBody, SheetBody, TetMeshBody
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

    def stand(self, scene: Scene) -> AnyBody:
        """The body in a scene with that body alone; the same scene gives the same bits in every process."""


@dataclass(frozen=True)
class _InScene:
    """A body that more of its scene decides than its own keys: tools that its cells end at, gravity, models."""

    build: Callable[[Scene], AnyBody]

    def stand(self, scene: Scene) -> AnyBody:
        return self.build(scene)


def _cells(spec: BodySpec, files: Files) -> Discretised:
    return _InScene(lambda scene: build_cells(scene, spec, files))


def _sheet(spec: SheetBody, files: Files) -> Discretised:
    return _InScene(lambda scene: build_sheet(scene, spec))


def _rope(spec: RopeBody, files: Files) -> Discretised:
    return _InScene(lambda scene: build_rope(scene, spec))


def _tet_mesh(spec: TetMeshBody, files: Files) -> Discretised:
    return _InScene(lambda scene: build_tet_mesh(scene, spec, files))


DISCRETISATIONS: Table[Callable[[Any, Files], Discretised]] = Table(
    "discretisations of bodies", {"cells": _cells, "sheet": _sheet, "rope": _rope, "tet_mesh": _tet_mesh}
)
"""what builds each specification in softseam_protocol.scene.bodies.BODIES"""


def build_any_body(scene: Scene, files: Files) -> AnyBody:
    """The only body of a scene, of whatever kind; the same scene and files give the same bits in every process.

    files: contents by the path that the scene gives them. Raises MeshError where a shape cannot be simulated, and
    MissingRow where the kind has no row.
    """
    return DISCRETISATIONS[scene.body.kind](scene.body, files).stand(scene)
