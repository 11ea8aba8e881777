"""What a body is made of, and what solvers make of that: materials, friction, substeps, the size of a factor."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.models import some_read
from softseam_protocol.scene.friction_field import FrictionFieldSpec
from softseam_services.body.contact_points import is_embedded
from softseam_services.body.interpolate import rest_points
from softseam_services.body.region import build_region
from softseam_services.checks.seen import Cells, Particles
from softseam_services.pbd.model import build_model
from softseam_services.pbd.parameters import build_parameters

_SOFTEST = 100.0
"""the softest gels that stand [Pa]; 20 or 50 are likely kPa"""
_MANY = 100_000
"""unknowns whose factor takes 1.5 GB, and seconds"""
_SWIFT = 4.0
"""waves so many times as fast are worth a warning"""


def materials(seen: Cells) -> Iterator[str]:
    """Materials that are unlike any soft solid, and bodies that sink by half under their own weight."""
    body, first = seen.body, seen.body.material
    for number, each in enumerate(body.materials):
        key = f"body.inclusions.{number - 1}.material" if number else "body.material"
        poisson = each.elastic.poisson
        if poisson > 0.495:
            yield f"{key}.poisson: {poisson:.4g} is nearly 0.5: the wave speed is {each.wave_speed:.0f} m/s"
        if not 10.0 <= each.density <= 25_000.0:
            yield f"{key}.density: {each.density:g} kg/m^3 is unlike any solid; is the unit kg/m^3?"
        if not _SOFTEST <= each.young <= 1e9:
            yield f"{key}.young: {each.young:g} Pa is unlike any soft solid; is the unit Pa?"
    sinks = first.density * float(np.ptp(rest_points(body) @ body.gravity)) / first.young
    if sinks > 0.5 and first.young >= _SOFTEST:
        yield (
            f"body.material.young: {first.young:g} Pa; the body would sink by some {100.0 * sinks:.0f} % of its height "
            "under its own weight; are the units Pa, m and kg/m^3?"
        )


def friction(seen: Cells) -> Iterator[str]:
    """Friction that varies between points that touch."""
    apart = float(seen.body.edges.max()) * (0.25 if is_embedded(seen.body) else 0.5)
    return _between(seen.spec.uneven_friction, apart, "shorter cells")


def friction_of_particles(seen: Particles) -> Iterator[str]:
    """The same of a body of particles."""
    return _between(seen.spec.uneven_friction, seen.body.spacing, "more divisions")


def _between(field: FrictionFieldSpec | None, apart: float, finer: str) -> Iterator[str]:
    """Points are so far apart [m]; finer: what brings them nearer."""
    if field is not None and field.length < apart:
        yield (
            f"body.friction_field.length: friction varies over {1e3 * field.length:.3g} mm, and points that touch "
            f"tools are {1e3 * apart:.3g} mm apart, each of which stands for what is around it: give a longer length, "
            f"or {finer}"
        )


def factor(seen: Cells) -> Iterator[str]:
    """FEM's factor, whose memory grows with the power 1.35 of the unknowns."""
    scene, body = seen.scene, seen.body
    n = 3 * int((~body.fixed).sum()) / 2 ** len(scene.symmetry)
    if some_read([scene.regions.default], "fem.element") and n > _MANY:
        yield (
            f"body.cell: fem factors a matrix of {n:,.0f} unknowns, which takes about {1.5 * (n / _MANY) ** 1.35:.2g} "
            "GB, and a step many seconds: give a longer edge, or `symmetry` where the scene has one"
        )


def substeps(seen: Cells) -> Iterator[str]:
    """PBD's substeps: too few where their number is given, many where an inclusion is stiff.

    Raises SettingError where leapfrog, which has all cells or none, would be unstable: the run would be refused."""
    scene, body, spec, left = seen.scene, seen.body, seen.scene.models.pbd, _left_to_pbd(seen)
    fast = np.array([material.wave_speed for material in body.materials]) / body.material.wave_speed
    if ((fast > _SWIFT)[body.octant_material].any(axis=1) & left).any():
        yield (
            f"waves in an inclusion are {fast.max():.0f} times as fast as around it: where PBD has it, a step takes "
            "about as many times more substeps; give it to fem by regions.near.boxes, or all cells by regions.default"
        )
    if spec.substeps == "auto" or not left.any():
        return
    region = build_region(body, np.flatnonzero(left).astype(np.int32), np.zeros(0, dtype=np.int32))
    parameters = build_parameters(build_model(body, region, seen.tools, spec), body, region, seen.tools, spec)
    given, stable = parameters.substeps(scene.step), parameters.stable_substeps(scene.step)
    if given < stable:
        yield (
            f"models.pbd.substeps: {given} in a step of {1e3 * scene.step:g} ms are fewer than the {stable} that are "
            f"stable: blocks may gain energy, and points chatter on tools; leave it out, and {stable} are taken, or "
            "shorten `step`"
        )


def _left_to_pbd(seen: Cells) -> NDArray[np.bool_]:
    """Cells that PBD has, or may have (C,)."""
    body, regions = seen.body, seen.scene.regions
    default, close = regions.models
    left = np.full(body.n_cells, some_read((default, close), "pbd.substeps"))
    if some_read([default], "pbd.substeps") and not some_read([close], "pbd.substeps"):
        middle = body.x_rest[body.cell_nodes[:, 13]]
        for box in regions.boxes:
            left &= ~((middle >= box.min) & (middle <= box.max)).all(axis=1)
    return left
