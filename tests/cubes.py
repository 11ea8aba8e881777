"""Scenes of cubes, apart or piled: what a pile of whole XPBD bodies is measured and checked with."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from softseam.scenes import load_scene
from softseam.variants import with_settings
from softseam_protocol.scene.scene import Scene

EDGE = 0.05
"""of a cube [m]"""
APART = 2e-4
"""of neighbours in a pile at first [m]"""
FIRM = {"young": 1e5, "poisson": 0.3, "density": 1000.0, "retardation_time": 0.02}
SOFT = {"kind": "neo_hookean", "young": 2.0e4, "poisson": 0.45, "density": 1050.0}
GROUND = {"ground": {"kind": "plane", "friction": 0.5}}


def cube(at: int, side: int, cells: int = 2, **keys: Any) -> dict[str, Any]:
    """One cube of cells^3, a little above the ground, in a square of them; keys of the body in place of these."""
    return {
        "shape": {"kind": "block", "size": [EDGE] * 3},
        "cell": EDGE / cells,
        "position": [2.0 * EDGE * (at % side), 2.0 * EDGE * (at // side), 0.003],
        "material": SOFT,
        "regions": {"default": "pbd"},
        **keys,
    }


def scene_of(bodies: dict[str, dict[str, Any]], **keys: Any) -> Scene:
    """A scene of these bodies on the ground."""
    named = {"softseam": 1, "name": "cubes", "step": 0.005, "duration": 0.6, "tools": GROUND}
    return Scene.model_validate({**named, "bodies": bodies, **keys})


def cubes(count: int, cells: int = 2, **keys: Any) -> Scene:
    """So many of them."""
    side = max(1, round(count**0.5))
    return scene_of({f"cube{at}": cube(at, side, cells) for at in range(count)}, **keys)


def piled(side: int, layers: int, cells: int = 2, **keys: Any) -> Scene:
    """side x side towers of cubes, each above, beside and behind another, a little apart; keys as of `scene_of`, but
    `material`, which is theirs."""
    places = {f"cube{x}{y}{z}": (x, y, z) for z in range(layers) for y in range(side) for x in range(side)}
    material, step = keys.pop("material", FIRM), EDGE + APART
    bodies = {
        name: cube(0, 1, cells, position=[step * x, step * y, step * z], material=material)
        for name, (x, y, z) in places.items()
    }
    touch = {
        f"{one}_{other}": {"kind": "contact", "between": [one, other], "friction": 0.4}
        for one, at in places.items()
        for other, beside in places.items()
        if sorted(np.subtract(beside, at)) == [0, 0, 1]
    }
    scene = scene_of(bodies, interfaces=touch, duration=1.0, **keys)
    return Scene.model_validate(json.loads(scene.model_dump_json(exclude_unset=True)))


def tray(side: int, *settings: str) -> Scene:
    """The shipped tray of cubes with side^3 of them, its walls and what is above moved as its header says."""
    wall, higher, tall = 0.0546 + 0.0252 * (side - 2), 0.0504 * (side - 3), 0.12 if side <= 3 else 0.044 * side
    moved = [f"bodies.cube.repeat.grid={[side] * 3}", f"bodies.picked.position={[0, 0, 0.1512 + higher]}"]
    for name, at in {"west": [-1, 0], "east": [1, 0], "south": [0, -1], "north": [0, 1]}.items():
        long, place = 2.0 * wall + 0.008, [wall * at[0], wall * at[1], 0.5 * tall]
        size = [0.008, long, tall] if at[0] else [long - 0.016, 0.008, tall]
        moved += [f"tools.{name}.position={place}", f"tools.{name}.size={size}"]
    moved += [f"tools.{name}.position={[x, 0, 0.1732 + higher]}" for name, x in (("left", -0.037), ("right", 0.037))]
    return with_settings(load_scene("tofu_tray"), [*moved, *settings])


def unlike(**keys: Any) -> Scene:
    """Four bodies of unlike sizes, materials, substeps: one is gripped and lifted, one falls, one spins, one slides."""
    plate = {"kind": "box", "size": [0.01, 0.05, 0.04], "friction": 0.6}
    hard = {"kind": "neo_hookean", "young": 2.0e5, "poisson": 0.3, "density": 500.0}
    soft = {"kind": "linear", "young": 1.0e4, "poisson": 0.4, "density": 1000.0}
    bodies = {
        "held": cube(0, 4, position=[0.0, 0.0, 0.0]),
        "hard": cube(1, 4, 3, material=hard, position=[0.2, 0.0, 0.004]),
        "turns": cube(2, 4, cell=0.02, shape={"kind": "block", "size": [0.02, 0.04, 0.02]}, position=[0.4, 0.0, 0.3]),
        "slides": cube(3, 4, material=soft, position=[0.6, 0.0, 0.0], velocity=[0.3, 0.0, 0.0]),
    }
    bodies["turns"]["spin"] = [0.0, 20.0, 5.0]
    tools = {
        **GROUND,
        "left": {**plate, "position": [-0.035, 0, 0.025]},
        "right": {**plate, "position": [0.035, 0, 0.025]},
    }
    motion = [
        {"tools": ["left", "right"], "close": 0.05, "until": {"compression": 0.1}},
        {"tools": ["left", "right"], "move": [0, 0, 0.01], "speed": 0.1},
    ]
    return scene_of(bodies, tools=tools, motion=motion, duration=None, **keys)
