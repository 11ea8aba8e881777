"""Interfaces between bodies: what a scene says of where two bodies meet, and of what holds there."""

from collections.abc import Collection, Mapping
from typing import Annotated, Literal

from pydantic import Field

from softseam_protocol.scene.bodies import AnyBody, BodyName
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.spec import NonNegative, OfKind, Spec, wrong
from softseam_protocol.scene.tools import ToolName
from softseam_protocol.table import Table

InterfaceName = ToolName


class InterfaceSpec(Spec):
    """What every kind has: two bodies. Each kind is a subclass with the parameters of its own, a row of INTERFACES."""

    kind: str
    between: tuple[BodyName, BodyName] = Field(description="the bodies that meet; a force on the first is positive")


class ContactSpec(InterfaceSpec):
    """The bodies press on each other where they touch, and rub."""

    kind: Literal["contact"] = "contact"
    friction: NonNegative = Field(default=0.5, description="Coulomb's coefficient between them")


INTERFACES: Table[type[InterfaceSpec]] = Table("kinds of interface", {"contact": ContactSpec})
"""the specification of each kind; `softseam_coupling.interfaces.KINDS` has what makes its rows"""
AnyInterface = Annotated[InterfaceSpec, OfKind(INTERFACES)]


def contacts_among(names: Collection[str], interfaces: Mapping[str, InterfaceSpec]) -> dict[str, ContactSpec]:
    """The contacts of a scene that are between two of these bodies, by name."""
    return {
        name: spec
        for name, spec in interfaces.items()
        if isinstance(spec, ContactSpec) and set(spec.between) <= set(names)
    }


def check_interface(name: str, spec: InterfaceSpec, bodies: Mapping[str, AnyBody], regions: RegionsSpec) -> None:
    """Raise pydantic's error where an interface cannot be between these bodies; regions: the scene's."""
    for place, body in enumerate(spec.between):
        at = ("interfaces", name, "between", place)
        if body not in bodies:
            raise wrong(f"no body is called {body!r}; the scene has: {', '.join(bodies)}", *at)
        found = bodies[body]
        if not found.has_cells:
            what = f"{body!r} is made of {found.made_of}, which have no faces: name a body in cells"
            raise wrong(what, *at)
        own = found.regions or regions
        if own.cut:
            text = f"{body!r} is cut in two models, which interfaces do not join yet: leave out its regions.near"
            raise wrong(text, *at)
    if spec.between[0] == spec.between[1]:
        raise wrong("a body meets another one here: name two", "interfaces", name, "between")
