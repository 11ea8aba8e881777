"""The structure of a body of particles: which of them each constraint joins, in batches. Never changed, so it is
shared."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from softseam_protocol.scene.models import PbdSpec
from softseam_services.body.body import Ints
from softseam_services.body.particles import CLASSIC, ParticleBody
from softseam_services.structures import Structures, key_of

from .batches import Batches, batches
from .records import ModelArrays

_NONE = np.zeros((0, 4), dtype=np.int32)


class Layout(NamedTuple):
    """All that a structure follows from."""

    n_nodes: int
    springs: Ints
    """(m, 2)"""
    bends: Ints
    """none where nothing keeps them (m, 4)"""
    tetrahedra: Ints
    """held by strains (m, 4)"""
    paired: Ints
    """held by neo-Hookean pairs (m, 4)"""
    volumes: Ints
    """whose volume classic PBD holds (m, 4)"""

    @property
    def key(self) -> bytes:
        """What distinguishes it from others."""
        return key_of(*self)


@dataclass(frozen=True)
class ParticleModel:
    """Constraints between n particles."""

    n_nodes: int
    springs: Batches
    bends: Batches
    tetrahedra: Batches
    """held by strains"""
    paired: Batches
    """held by neo-Hookean pairs"""
    volumes: Batches
    """whose volume classic PBD holds"""

    @cached_property
    def arrays(self) -> ModelArrays:
        """The same for kernels."""
        springs, bends, tetrahedra = self.springs, self.bends, self.tetrahedra
        return ModelArrays(
            springs=springs.nodes,
            spring_row=springs.row,
            bends=bends.nodes,
            bend_row=bends.row,
            tetrahedra=tetrahedra.nodes,
            tetrahedron_row=tetrahedra.row,
            paired=self.paired.nodes,
            volumes=self.volumes.nodes,
            volume_row=self.volumes.row,
        )


def lay_out(body: ParticleBody, spec: PbdSpec) -> Layout:
    """What the structure of a body follows from."""
    keep = spec.method == "xpbd" or spec.classic.bending > 0.0
    held = {} if body.solid is None else {body.solid.law: body.solid.nodes}
    return Layout(
        n_nodes=body.n_nodes,
        springs=body.springs.nodes,
        bends=body.bends.nodes if keep else _NONE,
        tetrahedra=held.get("st_venant_kirchhoff", _NONE),
        paired=held.get("neo_hookean", _NONE),
        volumes=held.get(CLASSIC, _NONE),
    )


def model_of(layout: Layout) -> ParticleModel:
    """The structure of a layout, and of nothing else."""
    n, *nodes = layout
    return ParticleModel(n, *(batches(n, each) for each in nodes))


STRUCTURES: Structures[Layout, ParticleModel] = Structures(model_of)
"""those that are known"""


def build_model(body: ParticleBody, spec: PbdSpec) -> ParticleModel:
    """The structure of a body, from nothing."""
    return model_of(lay_out(body, spec))
