"""Named points of the body at which stress and displacement are reported."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from softseam_protocol.messages.session import Frame
from softseam_protocol.models import facts_of
from softseam_protocol.quantities import PROBED
from softseam_protocol.scene.spec import Vector
from softseam_protocol.table import Table
from softseam_services.body import tetrahedron
from softseam_services.body.body import SAME, Body
from softseam_services.body.build import AnyBody
from softseam_services.body.errors import MeshError
from softseam_services.body.interpolate import bounding_points, hex27
from softseam_services.body.own_shapes import local_place
from softseam_services.body.recover import point_recovery, von_mises

Floats = NDArray[np.float64]

PROBE_MEASUREMENTS: Table[Callable[[Floats, Floats], Floats]] = Table(
    "measurements at probes",
    {
        "von_mises": lambda cauchy, moved: von_mises(cauchy),
        "displacement": lambda cauchy, moved: np.asarray(np.linalg.norm(moved, axis=1)),
    },
)
"""from stresses (p, 6) [Pa] and displacements (p, 3) [m] of p probes: one value each (p,)"""


class Probes:
    """Follows named material points. Raises MeshError, naming the probe, where one is not in the body."""

    def __init__(self, body: Body, points: Mapping[str, Vector]) -> None:
        self._body = body
        self._names = list(points)
        self._rest = np.array(list(points.values()), dtype=np.float64).reshape(-1, 3)
        self._cell = np.empty(len(points), dtype=np.int32)
        self._local = np.empty((len(points), 3))
        self._weight = np.empty((len(points), 27))
        self._material = np.zeros(len(points), dtype=np.int32)
        slopes = np.empty((27, 3))
        for i, (name, at) in enumerate(zip(self._names, self._rest, strict=True)):
            self._cell[i], octant, self._local[i] = place_of(body, name, at)
            self._material[i] = body.octant_material[self._cell[i], octant]
            if body.tetrahedra:
                barycentric = tetrahedron.barycentric_of(self._local[i][None])
                self._weight[i], self._weight[i, tetrahedron.NODES] = 0.0, tetrahedron.shape_functions(barycentric)[0]
            else:
                hex27(self._local[i], self._weight[i], slopes)
        self._nodes = body.cell_nodes[self._cell]
        self._recovery: csr_array | None = None
        self._near = np.zeros(0, dtype=np.int8)

    def measure(self, frame: Frame, models: tuple[str, str]) -> dict[str, float]:
        """PROBE.von_mises [Pa] of the recovered stress and PROBE.displacement [m] of every probe.

        models: of cells that are not near, and of those that are
        """
        if not self._names:
            return {}
        if self._recovery is None or not np.array_equal(frame.cell_near, self._near):
            self._near = frame.cell_near.copy()
            sample = np.array([facts_of(model).stress_at for model in models])
            self._recovery = self._recover(sample[(frame.cell_near == 1).astype(np.int64)])
        cauchy = self._recovery @ frame.cauchy.reshape(-1, 6)
        moved = np.einsum("pa,pai->pi", self._weight, frame.x[self._nodes]) - self._rest
        columns = {what: PROBE_MEASUREMENTS[what](cauchy, moved).tolist() for what in PROBED}
        return {f"{name}.{what}": column[i] for i, name in enumerate(self._names) for what, column in columns.items()}

    def at_rest(self) -> dict[str, float]:
        """The same before the first step; what has no value then is left out."""
        return {
            f"{name}.{what}": row.at_rest
            for name in self._names
            for what, row in PROBED.items()
            if row.at_rest is not None
        }

    def _recover(self, sample: Floats) -> csr_array:
        """Matrix that takes the stress of all octants to the probes, each in its own material; sample (C,)."""
        found = csr_array((len(self._names), 8 * self._body.n_cells))
        for material in np.unique(self._material):
            mine = np.flatnonzero(self._material == material)
            cell, local, rest = self._cell[mine], self._local[mine], self._rest[mine]
            fits = point_recovery(self._body, sample, int(material), cell, local, rest)
            found += csr_array((np.ones(len(mine)), (mine, np.arange(len(mine)))), (len(self._names), len(mine))) @ fits
        return found


def share_probes(bodies: Mapping[str, AnyBody], points: Mapping[str, Vector]) -> dict[str, dict[str, Vector]]:
    """The probes of each body by its name: those that are in it; of one body, all. Raises MeshError for one in none."""
    if len(bodies) == 1:
        return {name: dict(points) for name in bodies}
    shares: dict[str, dict[str, Vector]] = {name: {} for name in bodies}
    for probe, at in points.items():
        for name, body in bodies.items():
            if body.has_cells and _holds(body, probe, at):
                shares[name][probe] = at
                break
        else:
            raise MeshError(f"probes.{probe}: {list(at)} is in none of the bodies {', '.join(bodies)} at rest")
    return shares


def _holds(body: Body, probe: str, at: Vector) -> bool:
    try:
        place_of(body, probe, np.asarray(at))
    except MeshError:
        return False
    return True


def place_of(body: Body, name: str, at: Floats) -> tuple[int, int, Floats]:
    """Cell and octant that a point at rest (3,) [m] is in, and where in the cell, in [-1, 1] (3,).

    Raises MeshError, naming the probe, where it is not in the body."""
    if not body.boxes:
        found = local_place(body, at)
        if found is None:
            raise _not_inside(body, name, at)
        return int(found[0]), int((found[1] >= 0.0) @ np.array([1, 2, 4])), found[1]
    local = 2.0 * body.along_axes(at - body.x_rest[body.cell_nodes[:, 13]]) / body.edges
    outside = np.abs(local).max(axis=1)
    octant = (local >= 0.0) @ np.array([1, 2, 4])
    empty = body.fill[np.arange(body.n_cells), octant] == 0.0
    cell = int(np.argmin(np.where(empty, np.inf, outside)))
    if empty.all() or outside[cell] > 1.0 + SAME:
        raise _not_inside(body, name, at)
    return cell, int(octant[cell]), np.clip(local[cell], -1.0, 1.0)


def _not_inside(body: Body, name: str, at: Floats) -> MeshError:
    points = bounding_points(body)
    return MeshError(
        f"probes.{name}: {at.tolist()} is not in the body, which spans {points.min(axis=0).tolist()} "
        f"to {points.max(axis=0).tolist()} at rest: name a point inside"
    )
