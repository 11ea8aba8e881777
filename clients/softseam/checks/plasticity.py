"""A yield stress that no load of soft matter reaches, of the order of young, or that any does, a thousandth of it."""

from collections.abc import Iterator

from softseam.to_check import Written


def look(seen: Written) -> Iterator[str]:
    material = seen.body.cell_materials[0]
    slider = material.plasticity
    if slider is None:
        return
    strain = slider.yield_stress / material.young
    key = f"body.material.plasticity.yield_stress: {slider.yield_stress:g} Pa, {strain:.2g} of young"
    if strain > 1.0:
        yield f"{key}: it would be elastic to strains of that order; is it in Pa?"
    elif strain < 1e-3:
        yield f"{key}: any touch leaves a dent; is it in Pa?"
