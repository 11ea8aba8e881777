"""Branches that relax within a step of FEM, so that their share is not seen, or so slowly that the run sees none."""

from collections.abc import Iterator

from softseam.duration import expected_duration
from softseam.to_check import Written
from softseam_protocol.models import some_read


def look(seen: Written) -> Iterator[str]:
    step, length = seen.scene.step, expected_duration(seen.scene)
    for number, branch in enumerate(seen.body.cell_materials[0].relaxation):
        key = f"body.material.relaxation.{number}.time: {branch.time:g} s"
        if branch.time < step and branch.share > 0.05 and some_read(seen.scene.regions.models, "fem.integrator"):
            yield (
                f"{key}, a share of {branch.share:g} that fades within a step of {step:g} s: what is quicker than the "
                f"step is not seen of it; take step < {branch.time:g} s, or leave the branch out and lessen young"
            )
        if length is not None and branch.time > 1e3 * length:
            yield f"{key}, but the motion lasts {length:.3g} s: nothing of it would fade; is it in s?"
