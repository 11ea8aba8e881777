"""What checks of the client look at: a scene as it is written, and a run that has ended."""

from collections.abc import Sequence
from typing import NamedTuple

from softseam.columns import Columns
from softseam_protocol.messages.session import Event
from softseam_protocol.scene.bodies import AnyBody
from softseam_protocol.scene.scene import Scene


class Written(NamedTuple):
    """A scene with one body."""

    scene: Scene
    size: float
    """largest extent of the body [m]; infinite where only who reads its file knows: nothing is too large then"""

    @property
    def body(self) -> AnyBody:
        return self.scene.body


class Ended(NamedTuple):
    """A run."""

    scene: Scene
    columns: Columns
    events: Sequence[Event]
    done: bool
    """whether it came to its end: before, tools may still get where they are to"""
