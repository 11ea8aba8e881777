"""Which bodies of a simulation are in a pile: those that are whole, and that nothing may cut, climb or join to others.

A model takes bodies into a pile where MODELS says that it `piles`, and solves contact between them; a pile of one is a
body by itself.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from softseam_protocol.models import facts_of
from softseam_protocol.scene.interfaces import InterfaceSpec, contacts_among
from softseam_services.server import Setup


def piles_of(
    setups: Mapping[str, Setup], interfaces: Mapping[str, InterfaceSpec], climbing: Collection[str]
) -> dict[str, tuple[str, ...]]:
    """Names of the bodies of each pile, by its model, in the scene's order.

    setups      of all bodies, by name
    interfaces  of the scene, by name
    climbing    bodies that may go to another rung
    """
    found: dict[str, list[str]] = {}
    for name, setup in setups.items():
        regions = setup.scene.regions
        model, whole = regions.default, not regions.cut and regions.goal is None
        if model and setup.body.has_cells and whole and name not in climbing and facts_of(model).piles:
            found.setdefault(model, []).append(name)
    alone = {model: tuple(_without_joined(names, interfaces)) for model, names in found.items()}
    return {model: names for model, names in alone.items() if len(names) > 1}


def _without_joined(names: list[str], interfaces: Mapping[str, InterfaceSpec]) -> list[str]:
    """Bodies that nothing joins to others than these, and nothing to these but contact."""
    while True:
        within = contacts_among(names, interfaces)
        joined = {name for key, each in interfaces.items() if key not in within for name in each.between}
        if joined.isdisjoint(names):
            return names
        names = [name for name in names if name not in joined]
