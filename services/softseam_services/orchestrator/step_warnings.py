"""What is told of a step beside its numbers: an element that locks, alarms, crushed cells, tools that go too far."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from softseam_coupling.ledger import Alarm
from softseam_protocol.messages.outcomes import Detail, Figure
from softseam_protocol.messages.participant import Advanced
from softseam_protocol.messages.session import ErrorEstimate
from softseam_protocol.models import some_read
from softseam_protocol.scene.consistency import locking
from softseam_protocol.scene.scene import Scene

_TOO_FAR = (
    "moves half its thickness in a step: the body may come out behind it; shorten the step, or move it more slowly"
)
_NO_TOUCH = "tools do not stop one another, and no body has room between them: stop them before"


class Tell(Protocol):
    """Receives an event: its kind, its text, and for programs what else it says and the number of what it counts."""

    def __call__(self, kind: str, message: str, *details: Detail, count: int = 0) -> None: ...


def naming(body: str, tell: Tell) -> Tell:
    """Tells with the name of the body that an event is of."""

    def told(kind: str, message: str, *details: Detail, count: int = 0) -> None:
        tell(kind, f"{body}: {message}", *details, count=count)

    return told


class StepWarnings:
    """What is told of a body: each once, when it comes, not in every step that it lasts.

    tell  receives every event
    """

    def __init__(self, scene: Scene, tell: Tell) -> None:
        self._locks, self._tell = locking(scene), tell
        self._takes_substeps = not scene.regions.cut and some_read([scene.regions.default], "pbd.substeps")
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._crushed = 0
        self._alarmed: set[str] = set()

    def follow(
        self,
        step: int,
        replies: Mapping[str, Advanced],
        alarms: Iterable[Alarm],
        estimate: ErrorEstimate | None,
    ) -> None:
        """A step was taken: replies of the parts, new alarms of the energy, how far the run may be off at its end."""
        at = f"step {step}"
        if step == 0 and self._locks:
            self._tell("element", self._locks)
        for alarm in alarms:
            self._tell("energy", f"{at}: {alarm.said(self._takes_substeps)}", Detail[alarm.name])
        crushed = sum(int(reply.figure(Figure.BLENDED)) for reply in replies.values())
        if crushed and not self._crushed:
            self._tell("cells", f"{at}: {crushed} cells are squeezed beyond half: full quadrature")
        self._crushed = crushed
        for name, reply in replies.items():
            if reply.alarms and name not in self._alarmed:
                details, texts = zip(*sorted(reply.alarms.items()), strict=True)
                self._tell("monitor", f"{at}, {name}: {'; '.join(texts)}", *details)
        self._alarmed = {name for name, reply in replies.items() if reply.alarms}
        if estimate is not None and estimate.too_large:
            self._tell("accuracy", f"{at}: estimated error of {estimate.text}")


class ToolWarnings:
    """The same of tools.

    tell  receives every event
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self.forget()

    def forget(self) -> None:
        """The last step is another's."""
        self._too_far: set[str] = set()
        self._met = ""

    def follow(self, step: int, too_far: Iterable[str], met: str) -> None:
        """A step was taken: tools that moved half their thickness, and those that have met, in words."""
        at = f"step {step}"
        for name in too_far:
            if name not in self._too_far:
                self._tell("tools", f"{at}: {name} {_TOO_FAR}", Detail.TOO_FAR)
        self._too_far.update(too_far)
        if met and not self._met:
            self._tell("tools", f"{at}: {met}: {_NO_TOUCH}", Detail.MET)
        self._met = met
