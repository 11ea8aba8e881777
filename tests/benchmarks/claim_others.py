"""Scenes of other bodies, tools and motions, drawn at random: what the rule of claims was not chosen on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random
from typing import Any

import numpy as np
from benchmarks.claim_case import (
    DOWN,
    FEM,
    GROUND,
    XPBD,
    Case,
    Document,
    around,
    block,
    closing,
    held,
    material,
    mesh,
    plates,
    scene,
)
from benchmarks.claim_shapes import extent

OF_XPBD = 0.2
"""share of scenes by XPBD [1]"""


class Draw:
    """A body and numbers for one scene.

    told       what the scene is called, for people
    low, high  least and largest x, y, z of the body (3,) [m]
    body       its part of the scene
    more       step, model and kind
    """

    def __init__(self, told: str, seed: int, number: int) -> None:
        self.random = Random(f"{seed} {number} {told}")
        xpbd = self.random.random() < OF_XPBD
        self.told = f"{told} {number}{', XPBD' if xpbd else ''}"
        self.more: Document = {"regions": XPBD if xpbd else FEM, "step": self.between(0.006, 0.014)}
        self.lump = f"lump {seed} {number}" if "lump" in told else ""
        if self.lump:
            self.low, self.high = extent(self.lump)
        else:
            counts = np.array([self.random.choice((2, 2, 3, 3, 4)) for _ in range(3)])
            size = counts * self.between(0.008, 0.016) * [self.between(0.9, 1.1) for _ in range(3)]
            self.low, self.high = size * [-0.5, -0.5, 0.0], size * [0.5, 0.5, 1.0]
            self.cell = (size / counts).tolist()

    def between(self, low: float, high: float) -> float:
        return self.random.uniform(low, high)

    def body(self, young: tuple[float, float] = (6e3, 60e3), late: float = 0.0, **more: Any) -> Document:
        """Of this body, with a modulus in this range [Pa] and this retardation time [s]; more: place, velocity."""
        of = material(self.between(*young), self.between(0.3, 0.47), retardation_time=late)
        size = self.high - self.low
        if self.lump:
            return mesh(self.lump, float(np.prod(size) / self.between(10, 40)) ** (1.0 / 3.0), of, **more)
        return block(size.tolist(), self.cell, of, **more)


def others(seed: int) -> Iterator[Case]:
    """Three of each kind."""
    for number, (told, make) in enumerate(3 * list(KINDS.items())):
        yield make(Draw(told, seed, number))


def _squeezed(draw: Draw) -> Case:
    axis, hold, share = draw.random.randrange(3), draw.between(0.03, 0.15), draw.between(0.06, 0.17)
    tools = plates(draw.low.tolist(), draw.high.tolist(), axis)
    motion = closing(draw.between(0.01, 0.03), hold, compression=share)
    return scene(draw.told, draw.body(), tools, ["grip_force"], motion=motion, **draw.more)


def _pressed(draw: Draw) -> Case:
    """Between two balls, rods, capsules or boxes, smaller than the body and beside its middle."""
    size, middle = draw.high - draw.low, 0.5 * (draw.low + draw.high)
    radius, kind = (
        draw.between(0.15, 0.5) * size[1:].min(),
        draw.random.choice(("sphere", "cylinder", "capsule", "box")),
    )
    shape: Document = {
        "sphere": {"radius": radius},
        "cylinder": {"radius": radius, "length": 1.5 * size[1], "axis": [0, 1, 0]},
        "capsule": {"radius": radius, "length": 0.5 * size[1], "axis": [0, 1, 0]},
        "box": {"size": [0.01, draw.between(0.35, 0.8) * size[1], draw.between(0.35, 0.8) * size[2]]},
    }[kind]
    reach = 0.005 if kind == "box" else radius
    y, z = middle[1:] + [draw.between(-0.1, 0.1) * edge for edge in size[1:]]
    places = {"left": draw.low[0] - reach - 5e-4, "right": draw.high[0] + reach + 5e-4}
    friction = draw.between(0.2, 0.7)
    tools = {n: {"kind": kind, **shape, "position": [x, y, z], "friction": friction} for n, x in places.items()}
    motion = closing(0.02, 0.05, time=(5e-4 + draw.between(0.035, 0.07) * size[0]) / 0.02)
    return scene(draw.told, draw.body(), tools, ["grip_force"], motion=motion, **draw.more)


def _held(draw: Draw) -> Case:
    body, size = draw.body(), draw.high - draw.low
    force = draw.between(0.02, 0.1) * body["material"]["young"] * size[1] * size[2]
    tools = {"ground": GROUND, **plates(draw.low.tolist(), draw.high.tolist())}
    asked = ["grip_force", "lift_height", *([] if draw.lump else ["compression"])]
    return scene(draw.told, body, tools, asked, motion=held(force, 0.3, 0.012), gravity=DOWN, **draw.more)


def _gripped_weakly(draw: Draw) -> Case:
    friction = draw.random.choice((0.15, 0.25, 0.4))
    tools = {"ground": GROUND, **around((draw.high - draw.low).tolist(), friction=friction)}
    lift = {"tools": ["left", "right"], "move": [0, 0, 0.015], "speed": 0.05}
    motion = [*closing(hold=0.05, compression=draw.between(0.04, 0.08)), lift]
    asked = ["grip_force", "lift_height", "slip"]
    return scene(draw.told, draw.body(), tools, asked, motion=motion, gravity=DOWN, slips=True, **draw.more)


def _bent(draw: Draw) -> Case:
    size = np.array([draw.between(0.1, 0.2), draw.between(0.02, 0.04), draw.between(0.02, 0.04)])
    counts = [draw.random.choice(numbers) for numbers in ((5, 6, 7, 8), (1, 2), (1, 2, 3))]
    of = material(draw.between(40e3, 200e3), draw.between(0.3, 0.45), retardation_time=draw.random.choice((0.0, 0.01)))
    fixed = [{"min": [-1, -1, -1], "max": [-0.5 * size[0], 1, 1]}]
    body = block(size.tolist(), (size / counts).tolist(), of, fixed=fixed)
    return scene(draw.told, body, {}, ["tip_deflection"], duration=0.4, gravity=DOWN, **draw.more)


def _dropped(draw: Draw) -> Case:
    place, way = [0, 0, draw.between(0.003, 0.03)], [draw.between(0.0, 0.4) if draw.lump else 0.0, 0, 0]
    body = draw.body(late=draw.between(0.0005, 0.003), position=place, velocity=way)
    table = {"table": GROUND | {"friction": 0.3}}
    more = draw.more | {"step": 0.005}
    return scene(draw.told, body, table, ["sag"], duration=0.2, gravity=DOWN, slips=True, **more)


def _on_a_slope(draw: Draw) -> Case:
    down, table = [draw.between(2, 5), 0, -9], {"table": GROUND | {"friction": draw.random.choice((0.2, 0.3, 0.8))}}
    probe = {"middle": [0, 0, 0.5 * draw.high[2]]}
    return scene(draw.told, draw.body(), table, [], probes=probe, duration=0.3, gravity=down, slips=True, **draw.more)


def _pushed(draw: Draw) -> Case:
    size = draw.high - draw.low
    place = [draw.low[0] - 0.0055, 0, 0.5 * size[2] + 0.001]
    plate = {"kind": "box", "size": [0.01, 2.0 * size[1], size[2]], "position": place, "friction": 0.5}
    motion: list[Document] = [{"hold": 0.1}, {"tools": ["plate"], "move": [0.02, 0, 0], "speed": 0.06}, {"hold": 0.1}]
    tools = {"table": GROUND | {"friction": draw.between(0.2, 0.5)}, "plate": plate}
    probe = {"middle": [0, 0, 0.5 * size[2]]}
    return scene(draw.told, draw.body(), tools, [], probes=probe, motion=motion, gravity=DOWN, slips=True, **draw.more)


def _sagging(draw: Draw) -> Case:
    ground = {"ground": GROUND}
    return scene(draw.told, draw.body((2e3, 8e3)), ground, ["sag"], duration=0.3, gravity=DOWN, **draw.more)


KINDS: dict[str, Callable[[Draw], Case]] = {
    "block that plates squeeze": _squeezed,
    "block that small tools press": _pressed,
    "block that is held": _held,
    "block in a weak grip": _gripped_weakly,
    "beam": _bent,
    "block that falls": _dropped,
    "block on a slope": _on_a_slope,
    "block that is pushed": _pushed,
    "block that sags": _sagging,
    "lump that plates squeeze": _squeezed,
    "lump that small tools press": _pressed,
    "lump that is held": _held,
    "lump that falls": _dropped,
}
"""What happens to what. A third of them are of lumps, a third slip or fall."""
