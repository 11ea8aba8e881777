"""What tests of real services share: the services, what their supervisor says, and a scene with everything in it."""

from __future__ import annotations

import socket
import threading
from pathlib import Path

from softseam_protocol.scene.scene import Scene
from softseam_services.bus_options import BusOptions
from softseam_services.supervisor import Limits, Supervisor

READY = 300.0
"""until all services are ready, the compilation of every kernel included [s]"""
LIMITS = Limits(patience=2.0, pause=0.05, longest_pause=0.5)


class Lines:
    """What a supervisor reports, to wait for."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._changed = threading.Condition()

    def __call__(self, line: str) -> None:
        with self._changed:
            self.lines.append(line)
            self._changed.notify_all()

    def wait_for(self, *words: str, timeout: float = 30.0, after: int = 0) -> str:
        """The first line (after so many) that has all the words."""

        def found() -> str:
            return next((line for line in self.lines[after:] if all(word in line for word in words)), "")

        with self._changed:
            assert self._changed.wait_for(found, timeout), f"no line with {words} in {self.lines}"
            return found()


class Services:
    """All services of this machine, and what a test needs of them."""

    def __init__(self, options: BusOptions, children: Supervisor, lines: Lines, recordings: Path) -> None:
        self.options, self.children, self.lines, self.recordings = options, children, lines, recordings

    @property
    def endpoint(self) -> str:
        return self.options.connect

    def wait_well(self) -> None:
        assert self.children.wait_ready(READY), self.lines.lines


def free_port() -> int:
    """A port of the loopback that nobody listens at."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def squeezed_bar(near: str = "fem", far: str = "pbd") -> Scene:
    """A bar of 4 x 2 x 2 cells on the ground, squeezed at one end by two plates: contact, seam and both models."""
    plate = {"kind": "box", "size": [0.02, 0.01, 0.04], "friction": 0.6}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "squeezed_bar",
            "duration": 0.6,
            "step": 0.01,
            "body": {
                "shape": {"kind": "block", "size": [0.06, 0.03, 0.03]},
                "cell": 0.015,
                "material": {"kind": "neo_hookean", "young": 2.0e4, "poisson": 0.4, "density": 1050.0},
            },
            "tools": {
                "ground": {"kind": "plane", "friction": 0.5},
                "front": plate | {"position": [0.02, -0.0205, 0.021]},
                "back": plate | {"position": [0.02, 0.0205, 0.021]},
            },
            "motion": [
                {"tools": ["front", "back"], "close": 0.02, "until": {"compression": 0.1}},
                {"tools": ["front", "back"], "move": [0.0, 0.0, 0.01], "speed": 0.05},
                {"hold": 1.0},
            ],
            "regions": {
                "default": far,
                "near": {"model": near, "boxes": [{"min": [0.0, -0.02, -0.01], "max": [0.04, 0.02, 0.04]}]},
            },
            "quantities": ["grip_force", "slip"],
        }
    )
