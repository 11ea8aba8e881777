"""Tools narrower than what feels them: the points inside faces of cells, or the corners of coarse cells."""

from collections.abc import Iterator

import numpy as np

from softseam_protocol.models import some_read
from softseam_services.body.contact_points import is_embedded
from softseam_services.body.outer_faces import is_covered_by_faces
from softseam_services.pbd.levels import coarse_cells
from softseam_services.to_check import Cells
from softseam_services.tools.edged import PATCHES, edged_tools, face_width

_PARTS = 2.4
"""spacings of the points inside a face: what is narrower parts them, and cuts in"""


def look(seen: Cells) -> Iterator[str]:
    spacing = float(max(seen.body.edges)) / PATCHES
    found = {} if is_embedded(seen.body) else narrower(seen, _PARTS * spacing)
    if found:
        yield (
            f"body.cell: tools are felt at points {1e3 * spacing:.3g} mm apart, between which these pass when pressed "
            f"in by about their width: {listed(found)}. Make cells {PATCHES * min(found.values()) / _PARTS:.2g} m long"
        )
    yield from _between_corners(seen)


def narrower(seen: Cells, least: float) -> dict[str, float]:
    """Tools that press inside faces of cells and are not so wide [m]: the middle one of the three extents of each [m].

    Planes are not narrow, and nodes feel boxes that cover the body; of others the narrower side of the face counts.
    """
    tools, body, widths = seen.tools, seen.body, {}
    for number, edged in enumerate(edged_tools(tools, body)):
        name, half_width = tools.names[number], float(tools.half_width[number])
        if edged:
            widths[name] = face_width(tools, number, body)
        elif np.isfinite(half_width) and not (is_covered_by_faces(body) and seen.scene.tools[name].kind == "box"):
            widths[name] = 2.0 * half_width
    return {name: width for name, width in widths.items() if width < least * (1.0 - 1e-9)}


def listed(lengths: dict[str, float]) -> str:
    """Names, each with its length [m] in millimetres."""
    return ", ".join(f"{name} ({1e3 * length:.3g} mm)" for name, length in lengths.items())


def _between_corners(seen: Cells) -> Iterator[str]:
    """Cells of one block are too firm between their corners; tools beside which cells are FEM's meet none of PBD's."""
    regions, body, tools = seen.scene.regions, seen.body, seen.tools
    asked = seen.scene.models.pbd.coarse
    if asked is None or not some_read(regions.models, "pbd.coarse"):
        return
    coarse = coarse_cells(body, asked, tools)
    if not coarse.any():
        return
    corners = body.x_rest[body.cell_nodes[coarse]].reshape(-1, 3, 3, 3, 3)[:, ::2, ::2, ::2]
    edge = max(float(np.linalg.norm(np.diff(corners, axis=axis), axis=-1).max()) for axis in (1, 2, 3))
    kept_away = regions.within is not None and not some_read(regions.models[1:], "pbd.coarse")
    followed = {name for name, it_is in zip(tools.names, tools.followed, strict=True) if it_is and kept_away}
    found = {name: width for name, width in narrower(seen, edge).items() if name not in followed}
    if found:
        yield (
            f"narrower than the coarse cells' edge of {1e3 * edge:.3g} mm: {listed(found)}. Coarse cells have nodes at "
            "their corners alone, and between these such a tool meets them up to twice too firmly; give a larger "
            "models.pbd.coarse.beyond, or boxes away from it"
        )
