"""A yield stress that no load of soft matter reaches, or that any does."""

from collections.abc import Iterator

from softseam.to_check import Written

NEVER, AT_ONCE = 1.0, 1e-3
"""yield stress over young beyond which a piece is out of shape before it yields, and below which it flows"""


def look(seen: Written) -> Iterator[str]:
    material = seen.body.cell_materials[0]
    slider = material.plasticity
    if slider is None:
        return
    strain = slider.yield_stress / material.young
    key = f"body.material.plasticity.yield_stress: {slider.yield_stress:g} Pa, {strain:.2g} of young"
    if strain > NEVER:
        yield f"{key}: it would be elastic to strains of that order; is it in Pa?"
    elif strain < AT_ONCE:
        yield f"{key}: any touch leaves a dent; is it in Pa?"
