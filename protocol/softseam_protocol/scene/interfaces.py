"""Interfaces between bodies: what a scene says of where two bodies meet, and of what holds there."""

from collections.abc import Collection, Mapping
from functools import lru_cache
from itertools import combinations
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from softseam_protocol.scene.bodies import AnyBody, BodyName, MeshShape
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.spec import NonNegative, OfKind, Spec, not_among, wrong
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


class PairSpec(Spec):
    """What is otherwise between two bodies, or all copies of them, than between the others."""

    between: tuple[BodyName, BodyName] = Field(description="bodies that touch, or names of which there are copies")
    friction: NonNegative = Field(description="Coulomb's coefficient between them")


class ContactsSpec(Spec):
    """Every two bodies press on each other where they touch, and rub: those that can."""

    friction: NonNegative = Field(default=0.5, description="Coulomb's coefficient of any two")
    pairs: tuple[PairSpec, ...] = Field(default=(), description="those that have another; the last of a pair counts")


def _contacts_tag(value: Any) -> str:
    return "no contacts" if isinstance(value, str) else "contacts"


AnyContacts = Annotated[
    Annotated[ContactsSpec, Tag("contacts")] | Annotated[Literal["none"], Tag("no contacts")],
    Discriminator(_contacts_tag),
]
"""between all bodies of a scene; none: they are to pass through one another"""


def pair_name(one: str, other: str) -> str:
    """Of the contact that `contacts` makes between two bodies; no name in a scene is like it."""
    return f"{one}+{other}"


def written_key(name: str) -> str:
    """What of a scene an interface of this name comes from: how a refusal begins."""
    return f"contacts: {name}" if "+" in name else f"interfaces.{name}"


@lru_cache(maxsize=8)
def contacts_of(spec: ContactsSpec, names: tuple[str, ...], apart: frozenset[frozenset[str]]) -> dict[str, ContactSpec]:
    """The contacts that a scene's `contacts` make between bodies of these names, but for pairs that are in `apart`: of
    each the name that comes first in the alphabet is first, however the scene is written."""
    groups = {name: {name, repeated(name)} for name in names}
    of_all = ContactSpec.model_construct(friction=spec.friction)
    found: dict[str, ContactSpec] = {}
    for one, other in combinations(sorted(names), 2):
        if frozenset((one, other)) in apart:
            continue
        friction = spec.friction
        for pair in spec.pairs:
            a, b = pair.between
            if (a in groups[one] and b in groups[other]) or (b in groups[one] and a in groups[other]):
                friction = pair.friction
        found[pair_name(one, other)] = of_all.model_copy(update={"between": (one, other), "friction": friction})
    return found


def contacts_among(names: Collection[str], interfaces: Mapping[str, InterfaceSpec]) -> dict[str, ContactSpec]:
    """The contacts of a scene that are between two of these bodies, by name."""
    of = {*names}
    return {
        name: spec
        for name, spec in interfaces.items()
        if isinstance(spec, ContactSpec) and spec.between[0] in of and spec.between[1] in of
    }


def no_surface(body: AnyBody, regions: RegionsSpec) -> str:
    """Why nothing touches a body yet; '' where something does. regions: the scene's."""
    cells = body.in_cells
    if cells is None:
        return f"a {body.kind} has no faces"
    if isinstance(cells.shape, MeshShape) and cells.shape.cells not in ("own", "boxes"):
        return "its cells are tetrahedra"
    return "it is cut in two models" if (body.regions or regions).cut else ""


def check_contacts(spec: ContactsSpec, bodies: Mapping[str, AnyBody], regions: RegionsSpec) -> None:
    """Raise pydantic's error where a pair names no bodies of these, or some that nothing touches yet."""
    for number, pair in enumerate(spec.pairs):
        for place, name in enumerate(pair.between):
            at = ("contacts", "pairs", number, "between", place)
            meant = [body for body in bodies if name in (body, repeated(body))]
            if not meant:
                raise not_among(f"no body is called {name!r}", list(_names(bodies)), *at)
            if why := no_surface(bodies[meant[0]], regions):
                raise wrong(f"nothing touches {name!r} yet, {why}: name another, or leave the pair out", *at)
        if pair.between[0] == pair.between[1] in bodies:
            text = "a body meets another one here: name two, or one of which there are copies"
            raise wrong(text, "contacts", "pairs", number, "between")


def _names(bodies: Collection[str]) -> dict[str, None]:
    """Of bodies, those of which there are copies once."""
    return dict.fromkeys(repeated(name) or name for name in bodies)


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
