"""The condition number of XPBD's system for the multipliers of a body, as it stands, and what it means for sweeps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Floats
from softseam_services.body.build import AnyBody
from softseam_services.body.region import build_region
from softseam_services.pbd import model as blocks_model
from softseam_services.pbd import parameters as blocks_parameters
from softseam_services.pbd.block_condition import block_spectrum
from softseam_services.pbd.particles import model as particles_model
from softseam_services.pbd.particles import parameters as particles_parameters
from softseam_services.pbd.particles.condition import particle_spectrum
from softseam_services.pbd.particles.constraints import constraints_of
from softseam_services.pbd.spectrum import LARGEST, Spectrum
from softseam_services.tools.tool_set import ToolSet


@dataclass(frozen=True)
class Condition:
    """Of one body as it stands."""

    spectrum: Spectrum
    """of the system, each constraint or block scaled by its own"""
    substeps: int
    """of a step"""
    sweeps: int
    """of a substep"""


def condition_of(
    scene: Scene, body: AnyBody, tools: ToolSet, x: Floats, near: NDArray[np.bool_] | None = None
) -> Condition | None:
    """Of the body of a scene with that body alone, with nodes at x (N, 3) [m]; None where no XPBD moves it, or it has
    more than `LARGEST` unknowns, which would take longer than most runs.

    near  which cells are, of a body in cells that is cut (C,); None: as where it is not
    """
    spec = scene.models.pbd
    if spec.method != "xpbd" or 3 * len(x) > LARGEST:
        return None
    if not body.has_cells:
        numbers = particles_parameters.build_parameters(
            particles_model.build_model(body, spec), body, tools, spec, constraints_of(scene)
        )
        substeps = numbers.substeps(scene.step)
        found = particle_spectrum(body, numbers.joined, x, scene.step / substeps)
        return None if found is None else Condition(found, substeps, spec.sweeps)
    cells = _cells(scene, body, near)
    if not len(cells):
        return None
    region = build_region(body, cells, np.zeros(0, dtype=np.int32))
    model = blocks_model.build_model(body, region, tools, spec)
    parameters = blocks_parameters.build_parameters(model, body, region, tools, spec)
    spectrum = block_spectrum(model, parameters, x[region.nodes], scene.step)
    return Condition(spectrum, parameters.substeps(scene.step), spec.sweeps)


def _cells(scene: Scene, body: Body, near: NDArray[np.bool_] | None) -> NDArray[np.int32]:
    """Those that XPBD moves."""
    cut = np.zeros(body.n_cells, dtype=np.bool_) if near is None else near
    default, of_near = scene.regions.models
    models = np.where(cut, of_near == "pbd", default == "pbd")
    return np.flatnonzero(models).astype(np.int32)
