"""How a scene moves its tools: phases, one after another."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag, ValidationInfo, field_validator, model_validator

from softseam_protocol.scene.ramp import Ramp
from softseam_protocol.scene.spec import NonNegative, Positive, Spec, Vector, wrong

LARGEST_TURN = 0.5
"""of a tool in one step [rad]"""


def is_left_out(value: object) -> bool:
    """Whether a key that came later is not said: a scene without it is then hashed as it was before."""
    return value is None


class Until(Spec):
    """When a closing phase ends; the first condition met ends it."""

    compression: float | None = Field(default=None, gt=0.0, lt=1.0, description="of the body between the tools [1]")
    force: Positive | None = Field(default=None, description="mean normal force per tool [N]")
    time: Positive | None = Field(default=None, description="length of the phase [s]")

    @model_validator(mode="after")
    def _some(self) -> Until:
        if self.compression is None and self.force is None and self.time is None:
            raise wrong("say when to stop: compression, force or time")
        return self


class ClosePhase(Spec):
    """Tools approach one another at `close` [m/s] each; with `force`, they hold that force from then on."""

    tools: tuple[str, ...] = Field(min_length=2, description="two tools or more, by name")
    close: Positive = Field(description="speed of each tool [m/s]; with `force`, the highest")
    about: Vector | None = Field(
        default=None,
        exclude_if=is_left_out,
        description="point that all approach [m]; default: the middle of their positions",
    )
    until: Until
    force: Positive | None = Field(
        default=None,
        description="what each presses with, also in later phases, until they close again, open, or move apart [N]",
    )

    @model_validator(mode="after")
    def _closes(self) -> ClosePhase:
        for i, name in enumerate(self.tools):
            if name in self.tools[:i]:
                raise wrong(f"{name!r} is named twice, and cannot close on itself: name each once", "tools", i)
        if self.force is not None and self.until.force is not None and self.until.force > 0.99 * self.force:
            raise wrong(
                f"{self.until.force:g} N is not reached where {self.force:g} N is held: at most 99 % of it",
                "until",
                "force",
            )
        return self


class Opened(Spec):
    """When an opening phase ends."""

    way: Positive = Field(description="of each tool [m]")


class OpenPhase(Spec):
    """Tools that closed go back on their ways at `open` [m/s] each, and let go of a force that they hold."""

    tools: tuple[str, ...] = Field(min_length=2, description="tools that an earlier phase closes, by name")
    open: Positive = Field(description="speed of each tool [m/s]")
    until: Opened | None = Field(default=None, description="default: where they began to close")


class MovePhase(Spec):
    """Tools move together by `move` [m] at `speed` [m/s], or each by a vector of its own."""

    move: Annotated[
        Annotated[Vector, Tag("one way")] | Annotated[dict[str, Vector], Tag("own ways")],
        Discriminator(lambda move: "own ways" if isinstance(move, dict) else "one way"),
    ] = Field(description="displacement [m]; or those of tools by name, which all arrive together")
    tools: tuple[str, ...] = Field(
        default=(), validate_default=True, description="tools, by name; left out where `move` names them"
    )
    speed: Positive = Field(description="of the tool that goes farthest [m/s]")
    acceleration: Positive | None = Field(
        default=None,
        exclude_if=is_left_out,
        description="most with which it speeds up and slows down, smoothly; default: at once [m/s^2]",
    )

    @field_validator("tools")
    @classmethod
    def _named(cls, tools: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        move = info.data.get("move", {})
        if isinstance(move, dict):
            return tools or tuple(move)
        if not tools:
            raise wrong("too few tools: name those that move in `tools`, or with their own vectors in `move`")
        return tools

    @model_validator(mode="after")
    def _somewhere(self) -> MovePhase:
        if isinstance(self.move, dict) and self.tools != tuple(self.move):
            raise wrong("`move` names the tools: leave `tools` out", "tools")
        if self.length < 1e-12:
            raise wrong("a move of zero length: use hold to wait", "move")
        return self

    @property
    def ways(self) -> dict[str, Vector]:
        """What each tool is moved by [m]."""
        return self.move if isinstance(self.move, dict) else dict.fromkeys(self.tools, self.move)

    @property
    def length(self) -> float:
        """Of the longest way [m]."""
        return max((math.hypot(*way) for way in self.ways.values()), default=0.0)

    @property
    def ramp(self) -> Ramp:
        """How far that tool is after which time."""
        return Ramp(self.length, self.speed, self.acceleration)


class TurnPhase(Spec):
    """Tools turn together by `turn` at `speed`, as one rigid body, about a point."""

    tools: tuple[str, ...] = Field(min_length=1, description="tools, by name")
    turn: Vector = Field(description="axis times angle [rad]")
    speed: Positive = Field(description="angular speed [rad/s]")
    acceleration: Positive | None = Field(
        default=None,
        exclude_if=is_left_out,
        description="most with which it speeds up and slows down, smoothly; default: at once [rad/s^2]",
    )
    about: Vector | None = Field(
        default=None, description="centre of the turn [m]; default: the middle of the tools' positions"
    )

    @model_validator(mode="after")
    def _some(self) -> TurnPhase:
        if math.hypot(*self.turn) < 1e-12:
            raise wrong("a turn by no angle: use hold to wait", "turn")
        return self

    @property
    def ramp(self) -> Ramp:
        """By which angle tools have turned after which time."""
        return Ramp(math.hypot(*self.turn), self.speed, self.acceleration)


class GripPhase(Spec):
    """Tools take hold of the particles of a sheet or rope within one spacing, and stand still for `grip` [s]."""

    tools: tuple[str, ...] = Field(min_length=1, description="tools, by name")
    grip: NonNegative = Field(description="[s]")


class ReleasePhase(Spec):
    """Tools let go of what they hold, and stand still for `release` [s]."""

    tools: tuple[str, ...] = Field(min_length=1, description="tools, by name")
    release: NonNegative = Field(description="[s]")


class HoldPhase(Spec):
    """All tools stand still for `hold` [s]."""

    hold: NonNegative = Field(description="[s]")


PHASE_KEYS = ("close", "open", "move", "turn", "grip", "release", "hold")
"""the keys that name a phase"""


def _phase_tag(value: Any) -> str | None:
    keys = value if isinstance(value, dict) else getattr(type(value), "model_fields", ())
    for key in PHASE_KEYS:
        if key in keys:
            return f"{key} phase"
    return None


# the tag follows from the key that names the phase, so that an error speaks of one phase, not of all
Phase = Annotated[
    Annotated[ClosePhase, Tag("close phase")]
    | Annotated[OpenPhase, Tag("open phase")]
    | Annotated[MovePhase, Tag("move phase")]
    | Annotated[TurnPhase, Tag("turn phase")]
    | Annotated[GripPhase, Tag("grip phase")]
    | Annotated[ReleasePhase, Tag("release phase")]
    | Annotated[HoldPhase, Tag("hold phase")],
    Discriminator(
        _phase_tag,
        custom_error_type="phase",
        custom_error_message=(
            "a phase says what happens: close (with tools, until), open (with tools), move or turn (with tools, "
            "speed), grip or release (with tools), or hold"
        ),
    ),
]
