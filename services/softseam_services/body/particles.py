"""Bodies of particles, sheets, ropes and meshes of tetrahedra, or of points: what PBD moves and a viewer draws."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.particles import ParticleBodySpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import BoxRegion
from softseam_services.body.body import SAME, Floats, Ints
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.friction_field import FrictionField, draw_field
from softseam_services.body.skin import Skin


@dataclass(frozen=True)
class Springs:
    """m pairs of particles."""

    nodes: Ints
    """(m, 2)"""
    rest: Floats
    """length at rest (m,) [m]"""
    stiffness: Floats
    """(m,) [N/m]"""


@dataclass(frozen=True)
class Bends:
    """m sums of particles that vanish where the body is flat."""

    nodes: Ints
    """(m, 4); three in a row repeat the first with a zero"""
    coefficient: Floats
    """(m, 4)"""
    stiffness: Floats
    """(m,) [N/m]"""


@dataclass(frozen=True)
class Solid:
    """m tetrahedra of one material."""

    nodes: Ints
    """corners, the last above the first three (m, 4)"""
    elastic: ElasticConstants
    wave_time: float
    """a P wave's way over the least height of a tetrahedron [s]"""
    law: str = "st_venant_kirchhoff"
    """as in the scene file; `CLASSIC` in the classic form"""


CLASSIC = "classic"
"""held by classic PBD's edges and volumes, which are no law"""
_CONSTRAINTS = {
    "st_venant_kirchhoff": "seven strains",
    "neo_hookean": "a neo-Hookean pair",
    CLASSIC: "a volume and six edges",
}


@dataclass(frozen=True)
class ParticleBody:
    """N particles; P surface points around them. Has what `Body` has and cells do not matter for."""

    kind: str
    """'sheet', 'rope', 'tet_mesh', or one from outside"""
    x_rest: Floats
    """(N, 3) [m]"""
    mass: Floats
    """(N,) [kg]"""
    fixed: NDArray[np.bool_]
    """clamped particles (N,)"""
    springs: Springs
    bends: Bends
    skin: Skin
    spacing: float
    """least distance of neighbours at rest [m]"""
    reach: float
    """longest way along it [m]"""
    radius: float
    """distance that tools keep from a particle [m]"""
    self_contact: bool
    """whether particles that are no neighbours keep 2 radius apart"""
    self_friction: float
    friction_field: FrictionField
    """factor on friction with every tool"""
    damping: float
    """[1/s]"""
    restitution: float
    gravity: Floats
    """(3,) [m/s^2]"""
    v_initial: Floats
    """(N, 3) [m/s]"""
    solid: Solid | None = None
    """the tetrahedra, where it has any"""
    notes: tuple[str, ...] = ()
    made_of: Literal["particles", "points"] = "particles"
    """particles: what quantities of particles are of; points: what nothing joins"""
    has_cells: ClassVar[Literal[False]] = False
    cut: ClassVar[Literal[False]] = False
    """as of a body in cells"""

    @property
    def n_nodes(self) -> int:
        return len(self.x_rest)

    @property
    def n_cells(self) -> int:
        return 0

    @property
    def n_points(self) -> int:
        return len(self.skin.owner)

    @property
    def total_mass(self) -> float:
        """[kg]"""
        return float(self.mass.sum())

    def facts(self) -> dict[str, str]:
        """What `softseam check` says of it."""
        size, what = np.ptp(self.x_rest, axis=0), self.kind if self.made_of == "points" else f"a {self.kind}"
        return {
            "body": f"{what}, " + " x ".join(f"{1e3 * side:.4g}" for side in size) + " mm",
            "mass": f"{1e3 * self.total_mass:.4g} g",
            "particles": f"{self.n_nodes}, {int(self.fixed.sum())} of them clamped, {1e3 * self.spacing:.3g} mm apart",
            "constraints": f"{len(self.springs.rest)} springs, {len(self.bends.stiffness)} bends"
            if self.solid is None
            else f"{len(self.solid.nodes)} tetrahedra of {_CONSTRAINTS[self.solid.law]}",
            "surface": f"{len(self.skin.triangles)} triangles; tools keep {1e3 * self.radius:.3g} mm from particles",
        }

    @property
    def resolution(self) -> float:
        """[m]"""
        return self.spacing


def assemble(
    scene: Scene,
    spec: ParticleBodySpec,
    *,
    x_rest: Floats,
    mass: Floats,
    springs: Springs,
    bends: Bends,
    skin: Skin,
    spacing: float,
    reach: float,
    radius: float,
    self_contact: bool,
    self_friction: float,
    solid: Solid | None = None,
) -> ParticleBody:
    """Add what all have alike."""
    fixed = clamped(x_rest, spec.fixed, reach)
    v_initial = np.tile(np.array(spec.velocity), (len(x_rest), 1))
    v_initial[fixed] = 0.0
    axes = placed(spec, np.eye(3)) - np.array(spec.position)
    return ParticleBody(
        kind=spec.kind,
        x_rest=x_rest,
        mass=mass,
        fixed=fixed,
        springs=springs,
        bends=bends,
        skin=skin,
        spacing=spacing,
        reach=reach,
        radius=radius,
        self_contact=self_contact,
        self_friction=self_friction,
        friction_field=draw_field(spec.friction_field, np.array(spec.position), axes),
        damping=spec.damping,
        restitution=spec.restitution,
        gravity=np.array(scene.gravity),
        v_initial=v_initial,
        solid=solid,
    )


def springs_of(x_rest: Floats, nodes: Ints, stiffness: Floats) -> Springs:
    rest = np.linalg.norm(x_rest[nodes[:, 1]] - x_rest[nodes[:, 0]], axis=1)
    return Springs(nodes.astype(np.int32), rest, stiffness)


def bends_of(parts: list[tuple[Ints, Floats, Floats]]) -> Bends:
    """Parts of (nodes (m, 4), coefficients (4,), stiffness (m,)) as one; none where nothing resists bending."""
    nodes = np.concatenate([part[0] for part in parts]).astype(np.int32)
    coefficient = np.concatenate([np.tile(part[1], (len(part[0]), 1)) for part in parts])
    stiffness = np.concatenate([part[2] for part in parts])
    kept = stiffness > 0.0
    return Bends(nodes[kept], coefficient[kept], stiffness[kept])


def placed(spec: ParticleBodySpec, x: Floats) -> Floats:
    """Points (N, 3) about the middle, turned and moved to where the scene wants them."""
    rotation = np.array(spec.rotation)
    angle = float(np.linalg.norm(rotation))
    turned = x
    if angle > 0.0:  # Rodrigues' formula
        axis = rotation / angle
        turned = (
            x * np.cos(angle) + np.cross(axis, x) * np.sin(angle) + np.outer(x @ axis, axis) * (1.0 - np.cos(angle))
        )
    return np.ascontiguousarray(turned + np.array(spec.position))


def clamped(x_rest: Floats, boxes: tuple[BoxRegion, ...], size: float) -> NDArray[np.bool_]:
    """Points (N, 3) [m] of a body of this size [m] that are in a box (N,)."""
    slack = SAME * size
    fixed = np.zeros(len(x_rest), dtype=np.bool_)
    for box in boxes:
        fixed |= np.all((x_rest >= np.array(box.min) - slack) & (x_rest <= np.array(box.max) + slack), axis=1)
    return fixed
