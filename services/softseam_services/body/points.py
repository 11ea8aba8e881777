"""Points without cells: what a kind of body from outside is made of, and how it stands in a scene."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.bodies import AnyBody
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.friction_field import draw_field
from softseam_services.body.particles import Bends, ParticleBody, Springs
from softseam_services.body.skin import Skin


@dataclass(frozen=True)
class Surface:
    """P points, each of which follows one point of a body, T triangles between them: what is drawn, and how far tools
    keep from the body's points."""

    owner: NDArray[np.integer[Any]]
    """point that each follows (P,)"""
    offset: Floats
    """from there, along x, y and z whatever happens (P, 3) [m]"""
    triangles: NDArray[np.integer[Any]]
    """counter-clockwise from outside (T, 3)"""


@dataclass(frozen=True)
class Points:
    """N points that nothing joins, unless the model that moves them does."""

    x_rest: Floats
    """(N, 3) [m]"""
    mass: Floats
    """(N,) [kg]"""
    surface: Surface
    fixed: NDArray[np.bool_] | None = None
    """clamped points (N,); None: none"""
    v_initial: Floats | None = None
    """(N, 3) [m/s]; None: at rest"""
    damping: float = 0.0
    """drag of still air: force over mass and velocity, in xpbd [1/s]"""

    def stand(self, scene: Scene, spec: AnyBody) -> ParticleBody:
        """The body in a scene with that body alone, by its specification. Raises MeshError where arrays do not fit."""
        n, x = len(self.x_rest), np.ascontiguousarray(self.x_rest, dtype=np.float64)
        self._check(spec.kind)
        owner, offset = np.asarray(self.surface.owner, dtype=np.int32), np.asarray(self.surface.offset, dtype=float)
        radius = float(np.linalg.norm(offset, axis=1).max(initial=0.0))
        spacing, reach = _least_distance(x, 2.0 * radius), float(np.ptp(x, axis=0).max())
        none = np.zeros((0, 4), dtype=np.int32)
        return ParticleBody(
            kind=spec.kind,
            x_rest=x,
            mass=np.asarray(self.mass, dtype=np.float64),
            fixed=np.zeros(n, dtype=np.bool_) if self.fixed is None else np.asarray(self.fixed, dtype=np.bool_),
            springs=Springs(none[:, :2], np.zeros(0), np.zeros(0)),
            bends=Bends(none, np.zeros((0, 4)), np.zeros(0)),
            skin=Skin(
                owner=owner,
                share=1.0 / np.bincount(owner, minlength=n)[owner],
                triangles=np.asarray(self.surface.triangles, dtype=np.int32),
                counts=(0, 0),
                radius=radius,
                offset=offset,
            ),
            spacing=spacing,
            reach=max(reach, spacing),
            radius=radius,
            self_contact=False,
            self_friction=0.0,
            friction_field=draw_field(spec.uneven_friction, x.mean(axis=0)),
            damping=self.damping,
            restitution=0.0,
            gravity=np.array(scene.gravity),
            v_initial=np.zeros((n, 3)) if self.v_initial is None else np.asarray(self.v_initial, dtype=np.float64),
            made_of="points",
        )

    def _check(self, kind: str) -> None:
        """Raise MeshError where the arrays do not go together."""
        n, p, surface = len(self.x_rest), len(self.surface.owner), self.surface
        wanted = {
            "x_rest": (self.x_rest, (n, 3)),
            "mass": (self.mass, (n,)),
            "fixed": (self.fixed, (n,)),
            "v_initial": (self.v_initial, (n, 3)),
            "surface.offset": (surface.offset, (p, 3)),
            "surface.triangles": (surface.triangles, (len(surface.triangles), 3)),
        }
        for name, (given, shape) in wanted.items():
            if given is not None and (given.shape != shape or not np.isfinite(given).all()):
                raise MeshError(f"body: {kind} gives {name} of shape {given.shape}: {shape} finite numbers are meant")
        if n == 0 or not (self.mass > 0.0).all():
            raise MeshError(f"body: {kind} gives no points, or points without mass")
        for name, ids, count in (("owner", surface.owner, n), ("triangles", surface.triangles, p)):
            if len(ids) and not (0 <= ids.min() and ids.max() < count):
                raise MeshError(f"body: {kind} gives surface.{name} that are none of {count} points")


def _least_distance(x: Floats, single: float) -> float:
    """Of neighbours among points (n, 3) [m]; of one point, or where all are in one place, that or a metre."""
    from scipy.spatial import cKDTree

    apart = cKDTree(x).query(x, k=2)[0][:, 1] if len(x) > 1 else np.zeros(0)
    return float(apart[apart > 0.0].min(initial=np.inf)) if (apart > 0.0).any() else single or 1.0
