"""Constraints that a scene adds to a body of particles: a row of the table each, and the arrays that kernels take.

A constraint is a function of a few particles, value(x, parameters, gradient) -> C, which fills the gradient (k, 3) of C
by the places x (k, 3); its energy is 1/2 C^2/compliance. It is compiled alone, and one kernel for all of them
(`kernels.constraint`) calls it by its address (`jit`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.particles import ConstraintSpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.table import Table
from softseam_services.body.body import Floats
from softseam_services.body.errors import ConstraintError, SettingError
from softseam_services.body.particles import ParticleBody

from .batches import batches
from .constraint import Constraint, Joins
from .hinge import HINGE
from .kernels.constraint import N_COLUMNS
from .volume import VOLUME

__all__ = ["CONSTRAINTS", "Constraint", "Joined", "Joins", "build_constraints", "constraints_of"]


CONSTRAINTS: Table[Constraint] = Table("particle constraints", {"volume": VOLUME, "hinge": HINGE})
"""the constraint of each specification in softseam_protocol.scene.particles.CONSTRAINTS"""


@dataclass(frozen=True)
class Joined:
    """All constraints of a body, as `kernels.constraint` takes them: m of them in f families."""

    families: NDArray[np.int64]
    """(f, N_COLUMNS)"""
    particle: NDArray[np.int64]
    parameter: Floats
    compliance: Floats
    """(m,)"""
    most: tuple[int, int]
    """most particles and parameters of any"""


def build_constraints(body: ParticleBody, specs: Sequence[ConstraintSpec]) -> Joined:
    """The constraints that a scene's specifications ask for, each kind in the order of `batches`.

    Raises MissingRow where a kind has no constraint, ConstraintError where its row does not fit, SettingError where one
    joins nothing.
    """
    families: list[list[int]] = []
    particle, parameter, compliance = [np.zeros(0, dtype=np.int64)], [np.zeros(0)], [np.zeros(0)]
    first = at_particle = at_parameter = k = n = 0
    for i, spec in enumerate(specs):
        row = CONSTRAINTS[spec.kind]
        joins = row.joins(spec, body)
        _check(spec.kind, joins, body.n_nodes)
        m, own_k = joins.particles.shape
        if m == 0:
            raise SettingError(f"body.constraints.{i}: {spec.kind} joins nothing of this {body.kind}: leave it out")
        lanes = batches(body.n_nodes, joins.particles).row
        order = lanes[lanes >= 0]
        own_n = joins.parameters.shape[1]
        families.append([row.address, own_k, own_n, int(row.one_sided), first, first + m, at_particle, at_parameter])
        particle.append(joins.particles[order].astype(np.int64).ravel())
        parameter.append(np.asarray(joins.parameters, dtype=np.float64)[order].ravel())
        compliance.append(np.asarray(joins.compliance, dtype=np.float64)[order])
        first, at_particle, at_parameter = first + m, at_particle + m * own_k, at_parameter + m * own_n
        k, n = max(k, own_k), max(n, own_n)
    return Joined(
        families=np.array(families, dtype=np.int64).reshape(-1, N_COLUMNS),
        particle=np.concatenate(particle),
        parameter=np.concatenate(parameter),
        compliance=np.concatenate(compliance),
        most=(k, n),
    )


def constraints_of(scene: Scene) -> tuple[ConstraintSpec, ...]:
    """What the scene adds to its body of particles."""
    none: tuple[ConstraintSpec, ...] = ()
    return scene.body.said("constraints", none)


def _check(kind: str, joins: Joins, n_nodes: int) -> None:
    """Raise ConstraintError where particles, parameters and compliances do not go together."""
    particles, parameters, compliance = joins
    m = len(particles)
    if particles.ndim != 2 or parameters.ndim != 2 or parameters.shape[0] != m or compliance.shape != (m,):
        raise ConstraintError(
            f"{kind} joins particles {particles.shape} with parameters {parameters.shape} and compliance "
            f"{compliance.shape}: (m, k), (m, n) and (m,) are taken"
        )
    if m and not (particles.min() >= 0 and particles.max() < n_nodes):
        raise ConstraintError(f"{kind} joins particles up to {particles.max()}: there are {n_nodes}")
    repeated = np.sort(particles, axis=1)
    if (repeated[:, 1:] == repeated[:, :-1]).any():
        raise ConstraintError(f"{kind} joins a particle with itself")
    if not (np.isfinite(parameters).all() and np.isfinite(compliance).all() and (compliance >= 0.0).all()):
        raise ConstraintError(f"{kind} has a parameter that is not finite, or a compliance below 0")
