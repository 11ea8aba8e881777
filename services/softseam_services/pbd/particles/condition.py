"""XPBD's matrix for the multipliers of all constraints of a body of particles, as they stand; see `pbd.spectrum`."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, dia_array

from softseam_services.body.body import Floats, Ints
from softseam_services.body.particles import ParticleBody
from softseam_services.pbd.spectrum import Spectrum, spectrum

from .constraints import Joined
from .kernels.constraint import constraint_gradients
from .kernels.tetrahedron import rest_shapes

Integers = NDArray[np.integer]
_SHEARS = ((0, 1), (0, 2), (1, 2))


class Family(NamedTuple):
    """m constraints of k particles each."""

    particles: Ints
    """(m, k)"""
    gradient: Floats
    """of C by places (m, k, 3)"""
    compliance: Floats
    """alpha (m,)"""


def spring_spectrum(body: ParticleBody, substep: float) -> Spectrum:
    """Of springs alone, at rest.

    Springs that are more than what particles can do, and those between clamped ones, make J W J^T singular: alpha/h^2
    alone then keeps the condition number finite, so it grows with stiffness and with the substep h [s].
    """
    return _spectrum(body, [springs(body, body.x_rest)], substep)


def particle_spectrum(body: ParticleBody, joined: Joined, x: Floats, substep: float) -> Spectrum | None:
    """Of all constraints of a body by XPBD, of particles at x (n, 3) [m]; None where it has none.

    Of each constraint its gradient as it stands counts; what its force adds as that turns is left out, as in a sweep.
    What tools hold counts as free.
    substep  h [s]
    """
    found = [*families(body, joined, x)]
    return _spectrum(body, found, substep) if found else None


def families(body: ParticleBody, joined: Joined, x: Floats) -> Iterator[Family]:
    """All constraints, of particles at x (n, 3) [m]."""
    if len(body.springs.rest):
        yield springs(body, x)
    if len(body.bends.stiffness):
        yield from _bends(body)
    if body.solid is not None:
        yield from _tetrahedra(body, x)
    yield from _joined(joined, x)


def springs(body: ParticleBody, x: Floats) -> Family:
    """Of particles at x (n, 3) [m]."""
    nodes = body.springs.nodes
    along = x[nodes[:, 1]] - x[nodes[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    return Family(nodes, np.stack([-along, along], axis=1), 1.0 / body.springs.stiffness)


def _bends(body: ParticleBody) -> Iterator[Family]:
    """The three components of a sum of particles, each with its coefficients for a gradient."""
    bends = body.bends
    for axis in range(3):
        gradient = bends.coefficient[:, :, None] * np.eye(3)[axis]
        yield Family(bends.nodes, gradient, 1.0 / bends.stiffness)


def _tetrahedra(body: ParticleBody, x: Floats) -> Iterator[Family]:
    """Strains or a neo-Hookean pair of each; gradients by x_k are dC/dF d_k, d_k being the rows of D_m^-1."""
    solid = body.solid
    assert solid is not None
    inverse, volume = np.empty((len(solid.nodes), 3, 3)), np.empty(len(solid.nodes))
    rest_shapes(body.x_rest, solid.nodes, inverse, volume)
    corners = x[solid.nodes]
    F = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1) @ inverse
    mu, lam = solid.elastic.mu, solid.elastic.lambda_
    if solid.law == "neo_hookean":
        size = np.sqrt((F * F).sum(axis=(1, 2)))
        cofactor = np.linalg.det(F)[:, None, None] * np.linalg.inv(F).transpose(0, 2, 1)
        slopes = [(F / size[:, None, None], mu * np.minimum(1.0, size**2)), (cofactor, lam + mu)]
    else:
        slopes = [(_slope(F, a, a), 2.0 * mu) for a in range(3)]
        slopes += [(2.0 * _slope(F, a, b), mu) for a, b in _SHEARS]
        slopes += [(F, lam)]
    for slope, modulus in slopes:
        of_three = np.einsum("mij,mkj->mki", slope, inverse)
        gradient = np.concatenate([-of_three.sum(axis=1, keepdims=True), of_three], axis=1)
        yield Family(solid.nodes, gradient, 1.0 / (modulus * volume))


def _slope(F: Floats, a: int, b: int) -> Floats:
    """dE_ab/dF = (f_a e_b^T + f_b e_a^T)/2 (m, 3, 3), f_a being the columns of F."""
    found = np.zeros_like(F)
    found[:, :, b] += 0.5 * F[:, :, a]
    found[:, :, a] += 0.5 * F[:, :, b]
    return found


def _joined(joined: Joined, x: Floats) -> Iterator[Family]:
    """What the scene adds; a constraint on one side counts as if it held."""
    for family in joined.families:
        particles, gradient = constraint_gradients(x, family, joined.particle, joined.parameter)
        first, last = family[4:6]
        yield Family(particles, gradient, joined.compliance[first:last])


def _spectrum(body: ParticleBody, found: list[Family], substep: float) -> Spectrum:
    """Of A = J W J^T + alpha/h^2 (m, m)."""
    weight = np.sqrt(np.where(body.fixed, 0.0, 1.0 / body.mass))
    halves = [_half(each, weight) for each in found]
    counts = np.cumsum([0, *(len(each.particles) for each in found)])
    rows = np.concatenate([at + first for (at, _, _), first in zip(halves, counts, strict=False)])
    columns, entries = (np.concatenate([half[i] for half in halves]) for i in (1, 2))
    m = int(counts[-1])
    half = csc_array(coo_array((entries, (rows, columns)), shape=(m, 3 * body.n_nodes)))
    soft = np.concatenate([each.compliance for each in found]) / substep**2
    return spectrum(csc_array(half @ half.T + dia_array((soft[None], [0]), shape=(m, m))))


def _half(family: Family, weight: Floats) -> tuple[Integers, Integers, Floats]:
    """J W^1/2 of a family: rows, columns and entries."""
    entries = family.gradient * weight[family.particles][:, :, None]
    columns = 3 * family.particles[:, :, None] + np.arange(3)
    rows = np.broadcast_to(np.arange(len(entries))[:, None, None], entries.shape)
    return rows.ravel(), columns.ravel(), entries.ravel()
