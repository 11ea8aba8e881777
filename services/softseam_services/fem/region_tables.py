"""What FEM computes a region with, the whole of it or one side of its mirrors, and measures its mesh by.

Each is built when first asked for.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from softseam_protocol.scene_models import FemSpec
from softseam_services.body.body import Body, Region
from softseam_services.fem.fold import Fold, PointImages, find_fold
from softseam_services.fem.mesh_error import MeshError
from softseam_services.fem.model import Tables, build_model
from softseam_services.tools.tool_set import ToolSet


class RegionTables:
    """Of one region; no step writes to any, so that solvers of one region may share them."""

    def __init__(self, body: Body, region: Region, tools: ToolSet, spec: FemSpec) -> None:
        self._of = body, region, tools, spec

    @cached_property
    def whole(self) -> Tables:
        return build_model(*self._of)

    @cached_property
    def fold(self) -> Fold | None:
        """How it can be folded; None where it mirrors itself nowhere."""
        return find_fold(*self._of)

    @cached_property
    def images(self) -> PointImages:
        """Of the points of what is folded. Raises ValueError where nothing is."""
        if self.fold is None:
            raise ValueError("this region has no mirrors")
        return PointImages(self.fold, self.whole[0], len(self._of[2].names))

    @cached_property
    def mesh_error(self) -> MeshError:
        body, region, _, spec = self._of
        return MeshError(body, region, spec.element)

    def __iter__(self) -> Iterator[object]:
        """The records of arrays that were built."""
        built = vars(self)
        yield from built.get("whole", ())
        if built.get("fold") is not None:
            yield from built["fold"].tables
        if "mesh_error" in built:
            yield built["mesh_error"]
