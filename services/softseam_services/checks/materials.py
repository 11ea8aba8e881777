"""Materials that are unlike any soft solid, and bodies that sink by half under their own weight."""

from collections.abc import Iterator

import numpy as np

from softseam_services.body.interpolate import rest_points
from softseam_services.to_check import Cells

_SOFTEST = 100.0
"""the softest gels that stand [Pa]; 20 or 50 are likely kPa"""


def look(seen: Cells) -> Iterator[str]:
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
