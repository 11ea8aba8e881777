"""What a scene file may say: frozen specs, SI units, unknown keys are errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from pydantic import ConfigDict, Field, model_validator

from softseam_protocol.messages.names import ONLY_BODY, prefix
from softseam_protocol.quantities import QUANTITIES, QuantityName, probed
from softseam_protocol.scene.bodies import AnyBody, BodyName
from softseam_protocol.scene.consistency import check_body, check_tools
from softseam_protocol.scene.interfaces import AnyInterface, InterfaceName, check_interface
from softseam_protocol.scene.models import ModelsSpec
from softseam_protocol.scene.motion import LARGEST_TURN, ClosePhase, HoldPhase, MovePhase, OpenPhase, Phase, TurnPhase
from softseam_protocol.scene.regions import RegionsSpec, SeamSpec
from softseam_protocol.scene.spec import Positive, Spec, Vector, wrong
from softseam_protocol.scene.tools import PlaneTool, ToolName, ToolSpec

ProbeName = ToolName
MOST_STEPS = 10_000_000


class BudgetSpec(Spec):
    """What simulating may cost."""

    rtf: Positive = Field(description="least real-time factor: simulated over wall seconds, in one process [1]")


class SeveralBodies(ValueError):
    """Something that only scenes with one body have was asked of a scene with several."""


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
    gravity: Vector = Field(default=(0.0, 0.0, -9.81), description="along x, y and z [m/s^2]")
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
        "are not for it; they meet at `interfaces` alone",
    )
    interfaces: dict[InterfaceName, AnyInterface] = Field(
        default={},
        exclude_if=lambda interfaces: not interfaces,
        description="where bodies meet, and what holds there, by name",
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
        "`calm`, once no node of theirs was faster than 2 mm/s for 8 steps; default: none sleep",
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
        """All bodies by name, in the scene's order; one that is given as `body` is called `body`."""
        return self.many if self.one is None else {ONLY_BODY: self.one}

    def of(self, name: str) -> Scene:
        """The scene with one of its bodies alone: its own regions, and of the quantities and probes what it can have.

        Raises KeyError for a name that no body has.
        """
        if self.one is not None:
            if name != ONLY_BODY:
                raise KeyError(f"no body is called {name!r}; the scene has: {ONLY_BODY}")
            return self._with_models_of(self.one)
        if name not in self.many:
            raise KeyError(f"no body is called {name!r}; the scene has: {', '.join(self.many)}")
        body = self.many[name]
        regions = body.regions or (self.regions if body.has_cells else RegionsSpec(default=body.usual_model))
        kinds = ("any", body.made_of)
        return self._with_models_of(body).model_copy(
            update={
                "one": body,
                "many": {},
                "interfaces": {},
                "regions": regions,
                "quantities": tuple(name for name in self.quantities if QUANTITIES[name].of in kinds),
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
        return self.model_copy(update={"many": {**self.many, name: body}})

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
        for name in self.bodies:
            near = self.of(name).regions.near
            if near is not None:
                own = self.one is None and self.many[name].regions is not None
                at = ("bodies", name, "regions") if own else ("regions",)
                check_tools(self, near.tools or (), *at, "near", "tools")
            check_body(self.of(name), "" if self.one is not None else name, self.kinds)
        for name, interface in self.interfaces.items():
            check_interface(name, interface, self.bodies, self.regions)
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
            return
        if not self.many:
            raise wrong("the key 'body' is missing: give one body, or several by name in `bodies`")
        if self.symmetry:
            raise wrong("planes through the middle of one body: leave it out, there are several bodies", "symmetry")
        if self.tolerance is not None:
            raise wrong("cells and steps are chosen for scenes with one body: leave it out", "tolerance")
        for i, quantity in enumerate(self.quantities):
            if QUANTITIES[quantity].of not in ("any", *self.kinds):
                raise wrong(f"none of the bodies has {quantity}", "quantities", i)
