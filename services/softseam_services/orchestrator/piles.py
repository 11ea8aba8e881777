"""Which bodies of a simulation are in a pile: those that are whole, and that nothing may cut, join or climb.

A model takes bodies into a pile where MODELS says that it `piles`; a pile of one is a body by itself.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from softseam_protocol.models import facts_of
from softseam_services.server import Setup


def piles_of(setups: Mapping[str, Setup], apart: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Names of the bodies of each pile, by its model, in the scene's order.

    setups  of all bodies, by name
    apart   bodies that interfaces join, and those that may go to another rung
    """
    found: dict[str, list[str]] = {}
    for name, setup in setups.items():
        regions = setup.scene.regions
        model, whole = regions.default, not regions.cut and regions.goal is None
        if model and setup.body.has_cells and whole and name not in apart and facts_of(model).piles:
            found.setdefault(model, []).append(name)
    return {model: tuple(names) for model, names in found.items() if len(names) > 1}
