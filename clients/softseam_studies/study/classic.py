"""Classic PBD beside what may be chosen: a control of charts, whose stiffness follows from step and iterations.

A block of cells becomes a block of particles on a lattice, in cubes of five tetrahedra each: edges keep their lengths
and tetrahedra their volumes, one substep a step (Mueller, Heidelberger, Hennix and Ratcliff, Position based dynamics,
2007). It has no Young's modulus, so that no plan may choose it.

Two k are tried, of lengths and volumes alike: 1, and the one that is chosen for E. At rest n iterations push a particle
of the mass m = rho s^3 as springs of n k m/(2 h^2) along its edges would, where k is small; E s is the stiffness of a
cube, so

    k = 2 (E/rho) (h/s)^2/n,                                                                                      (1)

and k = 1 is all that there is where that is more. On tofu_grasp k was best within a factor of 1.8 of it, by the worst
of the quantities, of 2 to 6 cubes and 20 to 80 iterations (of 1, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2 and 0.1).
"""

import json
from collections.abc import Iterator
from itertools import product

import numpy as np

from softseam_protocol.quantities import QUANTITIES
from softseam_protocol.scene.bodies import BlockShape, BodySpec, block_of
from softseam_studies.study.configurations import Configuration, cells_named, ms
from softseam_studies.study.frame import Counts, Frame

ACROSS = (2, 4, 6)
"""cubes along the shortest edge"""
ITERATIONS = (5, 20, 80)
OTHER_STEPS = (2.0, 0.5)
"""multiples of the scene's step at which one of them shows that stiffness goes by it"""


def classic_configurations(frame: Frame) -> list[Configuration]:
    """What a chart tries of classic PBD: nothing where the body is no block of one material, or something counts that
    only cells have."""
    block, asked = block_of(frame.body), frame.scene.quantities
    if block is None or block.body.inclusions or any(block.body.spin):
        return []
    if frame.scene.probes or any(QUANTITIES[name].of == "cells" and QUANTITIES[name].settles for name in asked):
        return []
    found = {one.key: one for one in _tried(frame, *block)}
    return list(found.values())


def _tried(frame: Frame, body: BodySpec, shape: BlockShape) -> Iterator[Configuration]:
    step = frame.scene.step
    for across, iterations in product(ACROSS, ITERATIONS):
        counts = frame.across(across)
        edge = float(np.prod(np.array(shape.size) / counts) ** (1.0 / 3.0))
        chosen = 2.0 * body.material.young / body.material.density * (step / edge) ** 2 / iterations  # eq. (1)
        for share in (1.0, min(1.0, chosen)):
            yield _one(frame, body, shape, counts, step, iterations, share)
    for factor in OTHER_STEPS:
        yield _one(frame, body, shape, frame.across(ACROSS[1]), factor * step, ITERATIONS[1], 1.0)


def _one(
    frame: Frame, body: BodySpec, shape: BlockShape, counts: Counts, step: float, iterations: int, share: float
) -> Configuration:
    """A block of particles in so many cubes along x, y and z, held by a share k of its violations in each iteration."""
    x, y, z = body.position
    solid = {
        "kind": "tet_mesh",
        "size": shape.size,
        "divisions": counts,
        "position": (x, y, z + 0.5 * shape.size[2]),
        "density": body.material.density,
        "young": body.material.young,
        "poisson": min(max(body.material.poisson, 0.01), 0.49),
        "fixed": [box.model_dump() for box in body.fixed],
        "velocity": body.velocity,
        "damping": body.damping,
    }
    kept = [name for name in frame.scene.quantities if QUANTITIES[name].of != "cells"]
    settings = (
        f"body={json.dumps(solid)}",
        "regions={default: pbd}",
        f"quantities={json.dumps(kept)}",
        f"step={step:.9g}",
        f"models.pbd={{method: pbd, substeps: 1, sweeps: {iterations}, "
        f"classic: {{stretch: {share:.6g}, volume: {share:.6g}}}}}",
        *frame.symmetry(()),
    )
    softer = "" if share == 1.0 else f", k {share:.2g}"
    label = f"PBD {cells_named(frame, counts)}, {ms(step)}, iterations {iterations}{softer}"
    key = f"pbd-{cells_named(frame, counts)}-{ms(step, '')}-{iterations}{softer.replace(', k ', '-k')}"
    n_cubes = counts[0] * counts[1] * counts[2]
    return Configuration(key, "PBD", label, settings, frame.length / step * (3e-4 + 1.2e-7 * n_cubes * iterations))
