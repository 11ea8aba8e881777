"""What a scene file may say: frozen specs, SI units, unknown keys are errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    FieldSerializationInfo,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    field_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

from softseam_protocol.messages.names import ONLY_BODY, prefix
from softseam_protocol.quantities import QUANTITIES, QuantityName, probed
from softseam_protocol.scene.apart import check_apart
from softseam_protocol.scene.bodies import AnyBody, BodyName
from softseam_protocol.scene.consistency import check_body, check_tools
from softseam_protocol.scene.copies import each_body
from softseam_protocol.scene.interfaces import (
    AnyContacts,
    AnyInterface,
    ContactsSpec,
    InterfaceName,
    InterfaceSpec,
    check_contacts,
    check_interface,
    contacts_of,
    no_surface,
)
from softseam_protocol.scene.models import ModelsSpec
from softseam_protocol.scene.motion import LARGEST_TURN, ClosePhase, HoldPhase, MovePhase, OpenPhase, Phase, TurnPhase
from softseam_protocol.scene.regions import RegionsSpec, SeamSpec
from softseam_protocol.scene.spec import Positive, Spec, Vector, wrong
from softseam_protocol.scene.tools import PlaneTool, ToolName, ToolSpec

ProbeName = ToolName
MOST_STEPS = 10_000_000
AS_WRITTEN = "as written"
"""context of a dump in which bodies that repeat are once, with what is said of their copies"""

EARTH = 9.81
"""gravity there [m/s^2]"""


class BudgetSpec(Spec):
    """What simulating may cost."""

    rtf: Positive = Field(description="least real-time factor: simulated over wall seconds, in one process [1]")


class SeveralBodies(ValueError):
    """Something that only scenes with one body have was asked of a scene with several."""


def _some_gravity(gravity: Vector) -> Vector:
    size = math.hypot(*gravity)
    if size > 100.0 * EARTH:  # nothing soft stands it
        raise wrong(f"{size:.4g} m/s^2 is {size / EARTH:.3g} times the earth's: it is in m/s^2, not in mm/s^2")
    return gravity


class Scene(Spec):
    """One scene: bodies, tools, their motion, and how to simulate them."""

    model_config = ConfigDict(serialize_by_alias=True)

    softseam: Literal[1] = Field(description="version of the scene format")
    name: str = Field(
        min_length=1,
        max_length=64,
        pattern=r"^[A-Za-z0-9_\-]+$",
        description="names recordings: letters, digits, _ and -",
    )
    gravity: Annotated[Vector, AfterValidator(_some_gravity)] = Field(
        default=(0.0, 0.0, -EARTH), description="along x, y and z [m/s^2]"
    )
    step: Positive = Field(default=0.01, le=1.0, description="macro step [s]")
    duration: Positive | None = Field(default=None, description="simulated time [s]; default: the end of the motion")
    seed: int = Field(default=0, ge=0)
    one: AnyBody | None = Field(
        default=None, alias="body", exclude_if=lambda body: body is None, description="the body, where there is one"
    )
    many: dict[BodyName, AnyBody] = Field(
        default={},
        alias="bodies",
        exclude_if=lambda bodies: not bodies,
        description="bodies by name, in the place of `body`, each with `regions` of its own where those of the scene "
        "are not for it; they meet at `interfaces` and `contacts` alone",
    )
    joints: dict[InterfaceName, AnyInterface] = Field(
        default={},
        alias="interfaces",
        exclude_if=lambda interfaces: not interfaces,
        description="where bodies meet, and what holds there, by name",
    )
    contacts: AnyContacts | None = Field(
        default=None,
        exclude_if=lambda contacts: contacts is None,
        description="what is between any two bodies that touch; none: they are to pass through one another; default: "
        "they do, and that is said",
    )
    tools: dict[ToolName, ToolSpec] = Field(default={}, description="rigid tools by name")
    motion: tuple[Phase, ...] = Field(default=(), description="phases, one after another")
    regions: RegionsSpec = RegionsSpec()
    models: ModelsSpec = ModelsSpec()
    seam: SeamSpec = SeamSpec()
    sleep: str | None = Field(
        default=None,
        exclude_if=lambda rule: rule is None,
        description="rule by which bodies at rest are not simulated until a tool or neighbour comes or presses: "
        "`calm`, once no node of theirs was faster than 2 mm/s for 8 steps, and what presses on them stays within 1 % "
        "of their weight; `by_load`, for soft piles, 4 mm/s, 4 steps and 5 % of what presses on them in all; "
        "default: none sleep",
    )
    symmetry: tuple[Literal["x", "y", "z"], ...] = Field(
        default=(),
        description="axes across which the scene is symmetric, about planes through the middle of the body: where fem "
        "has all cells it solves for a half, a quarter or an eighth; refused where the scene is not symmetric",
    )
    quantities: tuple[QuantityName, ...] = Field(default=(), description="reported for every step")
    probes: dict[ProbeName, Vector] = Field(
        default={}, description="points of a body at rest [m]; von Mises stress and displacement are reported there"
    )

    tolerance: Positive | None = Field(
        default=None,
        lt=1.0,
        description="largest error of any quantity, L2 over time: cells, step and models are then chosen for it [1]",
    )
    budget: BudgetSpec | None = Field(default=None, description="what they may cost; goes with a tolerance")

    _copies: tuple[Mapping[str, AnyBody], Mapping[str, AnyBody]] | None = PrivateAttr(default=None)
    """bodies as they are written, and with each copy"""

    @property
    def body(self) -> AnyBody:
        """The only body. Raises SeveralBodies where there are more: see `bodies` and `of`."""
        if self.one is None:
            raise SeveralBodies(
                f"the scene {self.name!r} has several bodies ({', '.join(self.many)}), and this is for scenes with one"
            )
        return self.one

    @property
    def bodies(self) -> Mapping[str, AnyBody]:
        """All bodies by name, in the scene's order, with each copy of one that repeats; one that is given as `body` is
        called `body`."""
        if self.one is not None:
            return {ONLY_BODY: self.one}
        if self._copies is None or self._copies[0] is not self.many:
            repeats = any(body.repeat is not None for body in self.many.values())
            self._copies = self.many, each_body(self.many) if repeats else self.many
        return self._copies[1]

    @property
    def interfaces(self) -> Mapping[str, InterfaceSpec]:
        """All interfaces by name: those that are written, then what `contacts` makes of other pairs."""
        if not isinstance(self.contacts, ContactsSpec):
            return self.joints
        able = tuple(name for name, body in self.bodies.items() if not no_surface(body, self.regions))
        joined = frozenset(frozenset(each.between) for each in self.joints.values())
        return {**self.joints, **contacts_of(self.contacts, able, joined)}

    def is_joined(self, name: str) -> bool:
        """Whether an interface may be between a body and another."""
        if isinstance(self.contacts, ContactsSpec) and not no_surface(self.bodies[name], self.regions):
            return len(self.bodies) > 1
        return any(name in each.between for each in self.joints.values())

    def of(self, name: str) -> Scene:
        """The scene with one of its bodies alone: its own regions, and of the quantities and probes what it can have.

        Raises KeyError for a name that no body has.
        """
        if self.one is not None:
            if name != ONLY_BODY:
                raise KeyError(f"no body is called {name!r}; the scene has: {ONLY_BODY}")
            return self._with_models_of(self.one)
        if name not in self.bodies:
            raise KeyError(f"no body is called {name!r}; the scene has: {', '.join(self.bodies)}")
        return self._alone(self.bodies[name])

    def _alone(self, body: AnyBody) -> Scene:
        """The scene with one of several bodies alone."""
        regions = body.regions or (self.regions if body.has_cells else RegionsSpec(default=body.usual_model))
        return self._with_models_of(body).model_copy(
            update={
                "one": body,
                "many": {},
                "joints": {},
                "contacts": None,
                "regions": regions,
                "quantities": tuple(name for name in self.quantities if _has(body, name)),
                "probes": self.probes if body.has_cells else {},
            }
        )

    def _with_models_of(self, body: AnyBody) -> Scene:
        """The scene as it is for one of its bodies: FEM has the body's own element where none is named."""
        fem = self.models.fem if body.in_cells is None else self.models.fem.of(body.in_cells)
        if fem.element == self.models.fem.element:
            return self
        return self.model_copy(update={"models": self.models.having(fem)})

    @property
    def asked(self) -> tuple[str, ...]:
        """Names under which steps report what the scene asks for: NAME of one body, BODY.NAME of each of several that
        has it, and PROBE.von_mises and the like."""
        own = (
            prefix(name, self.bodies) + quantity for quantity in self.quantities for name in self.bodies
            if quantity in self.of(name).quantities
        )  # fmt: skip
        return (*own, *probed(self.probes))

    def with_regions(self, regions: RegionsSpec) -> Scene:
        """The scene with other regions in the place of its own, not of its bodies'; not validated."""
        return self.model_copy(update={"regions": regions})

    def with_body(self, body: AnyBody, name: str = ONLY_BODY) -> Scene:
        """The scene with another body of that name in the place of the one that has it; not validated."""
        if self.one is not None:
            return self.model_copy(update={"one": body})
        return self.model_copy(update={"many": {**self.bodies, name: body}})

    @field_serializer("many", mode="wrap")
    def _each_copy(
        self, many: dict[str, AnyBody], handler: SerializerFunctionWrapHandler, info: FieldSerializationInfo
    ) -> Any:
        """Copies are bodies like others for whoever reads a scene, but where it is asked for as it was written."""
        return handler(many if self.one is not None or info.context is AS_WRITTEN else self.bodies)

    @model_validator(mode="after")
    def _consistent(self) -> Scene:
        if self.budget is not None and self.tolerance is None:
            raise wrong("a budget goes with a tolerance: add one, e.g. tolerance: 0.05", "budget")
        for i, phase in enumerate(self.motion):
            if isinstance(phase, TurnPhase) and phase.speed * self.step > LARGEST_TURN:
                angle = phase.speed * self.step
                raise wrong(f"{angle:.3g} rad a step, more than {LARGEST_TURN:g}", "motion", i, "speed")
            if not isinstance(phase, HoldPhase):
                named = isinstance(phase, MovePhase) and isinstance(phase.move, dict)
                check_tools(self, phase.tools, "motion", i, "move" if named else "tools", by_name=named)
            if isinstance(phase, ClosePhase):
                self._closes_somewhere(i, phase)
            if isinstance(phase, OpenPhase):
                self._closed_before(i, phase)
        self._bodies_are_told()
        alone = {name: self._alone(body) for name, body in self.many.items()} or {"": self.of(ONLY_BODY)}
        for name, scene in alone.items():  # of copies once
            near = scene.regions.near
            if near is not None:
                own = self.one is None and self.many[name].regions is not None
                at = ("bodies", name, "regions") if own else ("regions",)
                check_tools(self, near.tools or (), *at, "near", "tools")
            check_body(scene, name, self.kinds)
        for name, interface in self.joints.items():
            check_interface(name, interface, self.bodies, self.regions)
        if isinstance(self.contacts, ContactsSpec):
            check_contacts(self.contacts, self.bodies, self.regions)
        check_apart(
            self.bodies, {frozenset(each.between) for each in self.interfaces.values() if each.kind == "contact"}
        )
        if self.duration is None and not self.motion:
            raise wrong("give a duration, or a motion whose end is the end of the run")
        if self.duration is not None and self.duration / self.step > MOST_STEPS:
            raise wrong(f"{self.duration / self.step:.3g} steps, more than {MOST_STEPS:,}", "duration")
        return self

    def _closes_somewhere(self, number: int, phase: ClosePhase) -> None:
        """Raise where a tool stands at the point about which it closes, as the scene places both."""
        for tool, spec in ((name, self.tools[name]) for name in phase.tools):
            if phase.about is None or isinstance(spec, PlaneTool):
                continue
            if math.dist(spec.position, phase.about) < 1e-9:
                raise wrong(f"the point is where {tool!r} is: name another, or leave it out", "motion", number, "about")

    def _closed_before(self, number: int, phase: OpenPhase) -> None:
        """Raise unless the tools of an opening phase were closed together by an earlier one."""
        if any(isinstance(each, ClosePhase) and {*each.tools} == {*phase.tools} for each in self.motion[:number]):
            return
        text = f"no phase before this one closes {' and '.join(phase.tools)} together: close them, or move each"
        raise wrong(text, "motion", number, "tools")

    @property
    def kinds(self) -> set[str]:
        """What its bodies are made of: "cells", "particles", "points", or several of these."""
        return {body.made_of for body in self.bodies.values()}

    def _bodies_are_told(self) -> None:
        """Raise unless there is `body`, or `bodies`, and what is asked of them goes with as many."""
        if self.one is not None:
            if self.many:
                raise wrong("a scene has one `body` or several `bodies`, not both: move it into them", "body")
            if self.one.regions is not None:
                raise wrong("of one body, `regions` stands beside `body`, not in it: move it there", "body", "regions")
            if self.one.repeat is not None:
                text = "copies are several bodies: put it into `bodies`, under a name"
                raise wrong(text, "body", "repeat")
            return
        if not self.many:
            raise wrong("the key 'body' is missing: give one body, or several by name in `bodies`")
        try:
            each_body(self.many)
        except PydanticCustomError as error:
            context = error.context or {}
            raise wrong(context["message"], "bodies", *context["at"]) from None
        if self.symmetry:
            raise wrong("planes through the middle of one body: leave it out, there are several bodies", "symmetry")
        if self.tolerance is not None:
            raise wrong("cells and steps are chosen for scenes with one body: leave it out", "tolerance")
        for i, quantity in enumerate(self.quantities):
            if not any(_has(body, quantity) for body in self.many.values()):
                raise wrong(f"none of the bodies has {quantity}", "quantities", i)


def _has(body: AnyBody, name: str) -> bool:
    """Whether a body has the quantity of this name."""
    row = QUANTITIES[name]
    return row.of in ("any", body.made_of) and (
        not row.of_strength or (body.in_cells is not None and body.in_cells.says_strength)
    )
