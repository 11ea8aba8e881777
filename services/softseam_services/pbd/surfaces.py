"""The surfaces of a pile's bodies and of its guests, as these touch one another, and which of the two presses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from softseam_protocol.scene.interfaces import written_key
from softseam_services.body.body import Floats, Ints
from softseam_services.body.bulges import Lattice, lattice_of
from softseam_services.body.contact_faces import Faces, faces_of
from softseam_services.body.contact_points import PENALTY
from softseam_services.body.errors import SettingError
from softseam_services.body.sampled_faces import SampledFaces, sampled_faces
from softseam_services.tools.kernels import DENSE, LIGHT

from .pile_pieces import Piece

_ALIKE = 1.1
"""by which nodes of one surface may be farther apart than those of another, and both press by their nodes [1]"""
_PANELS = 4
"""along a cell's edge, of faces that press on squares which need not begin where theirs do"""
_NO_NODES = np.zeros(0, dtype=np.int32)
NO_FACES = Faces(_NO_NODES, np.zeros((0, 3), dtype=np.int32), np.zeros(0), 0.0, 0.0)


@dataclass(frozen=True)
class Contact:
    """Between two bodies of a pile, or with a guest of it."""

    bodies: tuple[int, int]
    """their numbers, those of guests after those of the pile's bodies"""
    friction: float
    """Coulomb's coefficient [1]"""


@dataclass(frozen=True)
class Meets:
    """How two bodies do."""

    sides: tuple[int, int]
    """which of the surfaces of each"""
    presses: tuple[float, float]
    """how much of its area each presses with [1]"""
    around: int
    """around nodes of which of the two there are patches, 0 or 1; -1 where both press by their nodes"""


class Surfaces:
    """Of b bodies: those of nodes, none of bodies that have no such, or do not press by them; those of guests; and of
    the pile's bodies those by points that follow their nodes.

    Raises SettingError for a body that cannot touch others.
    """

    def __init__(
        self, contacts: Mapping[str, Contact], pieces: Sequence[Piece], guests: Sequence[SampledFaces]
    ) -> None:
        own = len(pieces)
        self.n_own, self.n_bodies = own, own + len(guests)
        nodes: dict[int, Faces | None] = {}
        for name, contact in contacts.items():
            for body in contact.bodies:
                if body < own and body not in nodes:
                    _check(name, pieces[body])
                    nodes[body] = faces_of(pieces[body].body)
        self.all: list[Faces | SampledFaces] = [*(nodes.get(body) or NO_FACES for body in range(own)), *guests]
        """in their order"""
        self.body = list(range(self.n_bodies))
        """of each"""
        self._nodes, self._sampled, self._pieces = nodes, dict[int, int](), pieces
        self.meets = [self._meet(*contact.bodies) for contact in contacts.values()]
        """in the order of the contacts"""

    def of_nodes(self, surface: int) -> bool:
        """Whether the points of a surface are nodes of a body of the pile."""
        return surface < self.n_own

    def followed(self, surface: int) -> SampledFaces | None:
        """A surface of a body of the pile whose points follow its nodes; None of others."""
        found = self.all[surface]
        return found if surface >= self.n_bodies and isinstance(found, SampledFaces) else None

    def lattice(self, surface: int) -> Lattice:
        """Of its points; of a guest's, whose functions are not trilinear, with how round it is alone."""
        found, p, flat = self.all[surface], len(self.all[surface].area), np.zeros((len(self.all[surface].area), 3))
        if not self.of_nodes(surface) and self.followed(surface) is None:
            assert isinstance(found, SampledFaces)
            return Lattice(flat, flat, flat, 0.5 * np.trace(found.bends, axis1=1, axis2=2))
        body = self._pieces[self.body[surface]].body
        if isinstance(found, Faces):
            return lattice_of(body, found.places.reshape(p, 3), flat, np.zeros((p, 3, 3)))
        normal = body.surface.normal if found.through_cells else flat
        return lattice_of(body, found.places(body.x_rest[found.nodes]), normal, found.bends)

    def light(self, surface: int) -> float:
        """LIGHT of tools/kernels/patch.py over what a surface is pressed with [1]."""
        found = self.all[surface]
        return LIGHT / (PENALTY if isinstance(found, SampledFaces) and found.through_cells else DENSE)

    def n_forces(self, surface: int) -> int:
        """How many patches there may be around its nodes, or points that press."""
        found = self.all[surface]
        if isinstance(found, Faces):
            return len(found.area)
        return len(found.nodes) if surface >= self.n_bodies else found.n_patches

    def _spacing(self, body: int) -> float:
        """How far the nodes of a body's surface are apart [m]."""
        if body >= self.n_own:
            return self.all[body].spacing
        return 0.5 * self._pieces[body].body.resolution

    def _meet(self, one: int, other: int) -> Meets:
        guests = one >= self.n_own, other >= self.n_own
        if all(guests):  # patches are gathered around places on the one that presses
            return Meets((one, other), (0.0, 1.0), 1)
        if any(guests):
            around = 0 if guests[1] else 1
        else:
            blocks = self._nodes[one] is not None, self._nodes[other] is not None
            ratio = self._spacing(one) / self._spacing(other)
            if all(blocks) and 1.0 / _ALIKE < ratio < _ALIKE:
                return Meets((one, other), (0.5, 0.5), -1)
            around = 0 if ratio >= _ALIKE or (ratio > 1.0 / _ALIKE and blocks[0]) else 1
        bodies = one, other
        sides = tuple(self._pressed(body) if k == around else self._pressing(body) for k, body in enumerate(bodies))
        return Meets((sides[0], sides[1]), (float(around == 1), float(around == 0)), around)

    def _pressed(self, body: int) -> int:
        return body if self._nodes[body] is not None else self._pressing(body)

    def _pressing(self, body: int) -> int:
        if body >= self.n_own:
            return body
        if body not in self._sampled:
            solid = self._pieces[body].body
            free = replace(solid, fixed=np.zeros(solid.n_nodes, dtype=np.bool_))  # clamped ones are in the pile, too
            self.all.append(sampled_faces(free, "hex8", solid.resolution / _PANELS))
            self.body.append(body)
            self._sampled[body] = len(self.all) - 1
        return self._sampled[body]


def uponed(faces: Faces | SampledFaces) -> tuple[Ints, Floats]:
    """Between which corners each point is, and its shares, see `SampledFaces`; of nodes each itself."""
    if isinstance(faces, SampledFaces):
        return faces.upon, faces.upon_share
    p = len(faces.area)
    return np.repeat(np.arange(p, dtype=np.int32)[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (p, 1))


def _check(name: str, piece: Piece) -> None:
    """Raises SettingError where an interface of this name cannot touch a body."""
    if piece.body.tetrahedra:
        raise SettingError(
            f"{written_key(name)}: contact meets no cells that are tetrahedra yet: take a closed surface"
        )
    if piece.apart or piece.parameters.arrays.tolerance > 0.0:
        raise SettingError(
            f"{written_key(name)}: bodies that touch are advanced by sweeps that are as many in all of them: leave out "
            "models.pbd.residual, method: leapfrog, and materials with a state of their own"
        )
    if len(piece.model.arrays.hanging.node):
        raise SettingError(f"{written_key(name)}: contact meets no cells of two sizes yet: leave out models.pbd.coarse")
