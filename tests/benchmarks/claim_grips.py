"""Grips drawn at random, which turn, lift or move what they hold: where a body creeps, and slip is hard to have."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.claim_case import DOWN, GROUND, Case, Document, held, scene
from benchmarks.claim_others import Draw

EACH = 4
"""scenes of a kind"""
ROUGH, SLICK = (0.3, 0.9), (0.05, 0.25)
"""least and most friction of tools that hold a body, and of those that hardly do [1]"""


def grips(seed: int) -> Iterator[Case]:
    """`EACH` of each kind, 40 in all."""
    for number, (told, (tool, motion)) in enumerate(EACH * list(KINDS.items())):
        yield _gripped(Draw(told, seed, number), tool, motion)


def _gripped(draw: Draw, tool: str, motion: str) -> Case:
    """A body between two tools, in the air but for a lift: squeezed, then moved with them, and held."""
    lifts = motion in ("lift", "force")
    tools = _fingers(draw, tool) | ({"ground": GROUND} if lifts else {})
    both, share = ["left", "right"], draw.between(0.06, 0.16)
    speed = draw.between(0.02, 0.06)
    axis = draw.random.choice(([1, 0, 0], [0, 1, 0], [0, 0, 1]))
    angle = draw.between(0.15, 0.5)
    way = [0.0, draw.between(0.005, 0.015), draw.between(-0.01, 0.01)]
    moves: dict[str, Document] = {
        "turn": {"turn": [angle * part for part in axis], "speed": draw.between(1.0, 4.0)},
        "lift": {"move": [0, 0, draw.between(0.008, 0.02)], "speed": speed},
        "move": {"move": way, "speed": speed},
    }
    body = draw.body(late=draw.random.choice((0.0, 0.003, 0.003)))
    if motion == "force":
        size = draw.high - draw.low
        force = draw.between(0.03, 0.1) * body["material"]["young"] * float(size[1] * size[2])
        phases = held(force, 0.3, 0.012)
    else:
        close = {"tools": both, "close": draw.between(0.02, 0.04), "until": {"compression": share}}
        phases = [close, {"tools": both, **moves.get(motion, {})}, {"hold": draw.between(0.03, 0.1)}]
    gravity = DOWN if lifts else [0.0, 0.0, 0.0]
    asked = ["grip_force", "slip", *(["lift_height"] if lifts else []), "von_mises_p99"]
    return scene(draw.told, body, tools, asked, motion=phases, gravity=gravity, slips=True, **draw.more)


def _fingers(draw: Draw, kind: str) -> Document:
    """Two alike at both ends along x: boxes that cover a part of the face or more, or what is round."""
    size, middle = draw.high - draw.low, 0.5 * (draw.low + draw.high)
    radius = draw.between(0.3, 0.7) * float(min(size[1:]))
    name = draw.random.choice(("sphere", "cylinder", "capsule")) if kind == "round" else "box"
    shapes: dict[str, Document] = {
        "sphere": {"radius": radius},
        "cylinder": {"radius": radius, "length": 1.5 * float(size[1]), "axis": [0, 1, 0]},
        "capsule": {"radius": radius, "length": 0.6 * float(size[1]), "axis": [0, 1, 0]},
        "box": {"size": [0.01, draw.between(0.5, 1.3) * float(size[1]), draw.between(0.5, 1.3) * float(size[2])]},
    }
    reach, friction = (0.005 if name == "box" else radius) + 5e-4, draw.between(*draw.random.choice((ROUGH, SLICK)))
    y, z = (float(at + draw.between(-0.1, 0.1) * edge) for at, edge in zip(middle[1:], size[1:], strict=True))
    places = {"left": float(draw.low[0]) - reach, "right": float(draw.high[0]) + reach}
    return {n: {"kind": name, **shapes[name], "position": [x, y, z], "friction": friction} for n, x in places.items()}


KINDS: dict[str, tuple[str, str]] = {
    "block that boxes turn": ("box", "turn"),
    "block that boxes lift": ("box", "lift"),
    "block that boxes move": ("box", "move"),
    "block that boxes hold by force": ("box", "force"),
    "block that rounds turn": ("round", "turn"),
    "block that rounds lift": ("round", "lift"),
    "block that rounds move": ("round", "move"),
    "lump that boxes turn": ("box", "turn"),
    "lump that boxes lift": ("box", "lift"),
    "lump that rounds move": ("round", "move"),
}
"""Of what is gripped by which tools, and what follows."""
