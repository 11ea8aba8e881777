"""The unit of a mesh file, guessed from how large a body is that a hand grips; said, never applied."""

import numpy as np

from softseam_protocol.scene.spec import LARGEST_BODY, SMALLEST_BODY
from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError

LOOKS_LIKE = "this looks like"
"""in each guess"""
LIKELY = (1e-3, 5.0)
"""extents of what tools press [m]"""
_USUAL = (5e-3, 1.0)
_UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "metres": 1.0, "inches": 0.0254}


def check_extent(path: str, vertices: Floats, scale: float) -> None:
    """Raises MeshError where the unit must be wrong; vertices (n, 3) [m], made by a scale in metres per unit."""
    extent = float(np.ptp(vertices, axis=0).max())
    if SMALLEST_BODY <= extent <= LARGEST_BODY:
        return
    what = f"more than {LARGEST_BODY:g} m" if extent > LARGEST_BODY else f"less than {SMALLEST_BODY:g} m"
    remedy = _guess(extent, scale) or "set `scale` to metres per unit of the file, 0.001 for millimetres"
    raise MeshError(f"{path}: the solid is {extent:.3g} m long, {what}; {remedy}")


def unit_guess(vertices: Floats, scale: float) -> tuple[str, ...]:
    """A note on the unit that a file looks like, where the body is larger or smaller than what tools press."""
    extent = float(np.ptp(vertices, axis=0).max())
    guess = "" if LIKELY[0] <= extent <= LIKELY[1] else _guess(extent, scale)
    return (guess,) if guess else ()


def _guess(extent: float, scale: float) -> str:
    """Which unit makes a body of an extent [m], made by a scale, as large as usual ones; "" where none does."""
    for unit, metres in _UNITS.items():
        size = extent / scale * metres
        if _USUAL[0] <= size <= _USUAL[1] and metres != scale:
            return f"{LOOKS_LIKE} {unit}: set scale: {metres:g}, which makes it {1e3 * size:.3g} mm long"
    return ""
