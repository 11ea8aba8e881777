"""Implicit Euler that damps more than the material's viscosity, where fem has cells of it."""

from collections.abc import Iterator

from softseam.to_check import Written
from softseam_protocol.models import some_read


def look(seen: Written) -> Iterator[str]:
    scene = seen.scene
    time = seen.body.cell_materials[0].retardation_time
    solved = some_read(scene.regions.models, "fem.integrator")
    if solved and 0.0 < time <= scene.step and scene.models.fem.integrator == "implicit_euler":
        yield (
            "in fem the step itself damps more than the material: take step < "
            f"{1e3 * time:.3g} ms, its retardation_time"
        )
