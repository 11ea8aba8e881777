"""What FEM computes a region with, the whole of it or what its symmetry leaves, and measures its mesh by.

Each is built when first asked for.
"""

from collections.abc import Iterator
from functools import cached_property

from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Region
from softseam_services.body.errors import SettingError
from softseam_services.tools.symmetry import symmetry_axes
from softseam_services.tools.tool_set import ToolSet

from .mesh_error import MeshError
from .structures import FemStructures, Tables, build_tables
from .symmetry import PointImages, Reduction, reduce


class RegionTables:
    """Of one region; no step writes to any, so that solvers of one region may share them."""

    def __init__(
        self, body: Body, region: Region, tools: ToolSet, scene: Scene, structures: FemStructures | None = None
    ) -> None:
        """structures: those that are known, which gain this region's."""
        self._structures = structures
        self._body, self._region, self._tools, self._spec = body, region, tools, scene.models.fem
        is_all = len(region.cells) == body.n_cells and not len(region.seam)
        self._axes = symmetry_axes(scene) if is_all else ()

    @cached_property
    def whole(self) -> Tables:
        return build_tables(self._body, self._region, self._tools, self._spec, structures=self._structures)

    @cached_property
    def reduction(self) -> Reduction | None:
        """What is solved for in place of all of the body; None where the scene says no symmetry, and of a part.

        Raises SettingError where the material has state, which images do not carry.
        """
        if self._axes and self._body.material.n_state:
            raise SettingError(f"symmetry: images do not carry the state of {self._body.material.kind}: leave it out")
        if not self._axes:
            return None
        return reduce(self._body, self._tools, self._spec, self._axes, self._structures)

    @cached_property
    def images(self) -> PointImages:
        """Of the points of what is solved for. Raises ValueError where that is the whole."""
        if self.reduction is None:
            raise ValueError("this region has no plane of symmetry")
        return PointImages(self.reduction, self.whole, len(self._tools.names))

    @cached_property
    def mesh_error(self) -> MeshError:
        return MeshError(self._body, self._region, self._spec.element)

    def __iter__(self) -> Iterator[object]:
        """The records of arrays that were built."""
        built = vars(self)
        yield from built.get("whole", ())
        if built.get("reduction") is not None:
            yield from built["reduction"].tables
        if "mesh_error" in built:
            yield built["mesh_error"]
