"""PBD's substeps: too few where their number is given, many where an inclusion is stiff."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.models import some_read
from softseam_services.body.region import build_region
from softseam_services.pbd.model import build_model
from softseam_services.pbd.parameters import build_parameters
from softseam_services.to_check import Cells

_SWIFT = 4.0
"""waves so many times as fast are worth a warning"""


def look(seen: Cells) -> Iterator[str]:
    """Raises SettingError where leapfrog, which has all cells or none, would be unstable: the run would be refused."""
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
