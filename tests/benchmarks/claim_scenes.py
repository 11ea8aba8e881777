"""Scenes that claims are held against the truth on: a third meshes, a third with slip or a drop.

Each is short and small, for its truth takes some hundred times as long.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from benchmarks.claim_case import (
    CUBE,
    DOWN,
    FEM,
    GROUND,
    XPBD,
    Case,
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
from benchmarks.claim_slips import slips


def cases() -> Iterator[Case]:
    yield from _blocks()
    yield from slips()
    yield from _meshes()


def _blocks() -> Iterator[Case]:
    tofu, soft, stiff = material(20e3), material(8e3, 0.4), material(60e3, 0.3)
    squeeze = closing(compression=0.15)
    yield scene("cube between plates", block(CUBE, 0.02, tofu), around(CUBE), ["grip_force"], motion=squeeze)
    yield scene(
        "stiff cube between rough plates",
        block(CUBE, 0.0134, stiff),
        around(CUBE),
        ["grip_force"],
        motion=closing(compression=0.1),
    )
    yield scene(
        "cube between plates, XPBD",
        block(CUBE, 0.0134, tofu),
        around(CUBE),
        ["grip_force"],
        motion=squeeze,
        regions=XPBD,
    )
    yield scene(
        "slab between plates, XPBD",
        block([0.06, 0.04, 0.03], 0.015, soft),
        around([0.06, 0.04, 0.03], 2),
        ["grip_force"],
        motion=closing(compression=0.12),
        regions=XPBD,
    )
    both = {"default": "pbd", "near": {"model": "fem", "within": 0.008, "tools": ["left", "right"], "split": "always"}}
    yield scene(
        "bar between plates, both models",
        block([0.06, 0.03, 0.03], 0.015, tofu),
        around([0.06, 0.03, 0.03]),
        ["grip_force"],
        motion=closing(compression=0.1),
        regions=both,
    )
    beam = [0.16, 0.04, 0.04]
    fixed = [{"min": [-1, -1, -1], "max": [-0.08, 1, 1]}]
    half = {"default": "pbd", "near": {"model": "fem", "boxes": [{"min": [-1, -1, -1], "max": [0, 1, 1]}]}}
    of = material(80e3, 0.4)
    yield scene(
        "cantilever, both models",
        block(beam, 0.02, of, fixed=fixed),
        {},
        ["tip_deflection"],
        duration=0.3,
        step=0.005,
        gravity=DOWN,
        regions=half,
    )
    yield scene(
        "cantilever", block(beam, 0.02, of, fixed=fixed), {}, ["tip_deflection"], duration=0.4, step=0.01, gravity=DOWN
    )
    yield scene(
        "cantilever of one cell's height",
        block(
            [0.2, 0.03, 0.03],
            [0.025, 0.03, 0.03],
            material(100e3, 0.35),
            fixed=[{"min": [-1, -1, -1], "max": [-0.1, 1, 1]}],
        ),
        {},
        ["tip_deflection"],
        duration=0.4,
        step=0.01,
        gravity=DOWN,
    )
    yield scene(
        "cantilever, XPBD",
        block(beam, 0.02, of, fixed=fixed),
        {},
        ["tip_deflection"],
        duration=0.3,
        step=0.005,
        gravity=DOWN,
        regions=XPBD,
    )
    yield scene(
        "viscous cantilever",
        block(
            [0.12, 0.03, 0.04],
            0.015,
            material(30e3, 0.45, retardation_time=0.02),
            fixed=[{"min": [-1, -1, -1], "max": [-0.06, 1, 1]}],
        ),
        {},
        ["tip_deflection"],
        duration=0.4,
        step=0.01,
        gravity=DOWN,
    )
    balls = {
        name: {"kind": "sphere", "radius": 0.014, "position": [sign * 0.0345, 0, 0.018], "friction": 0.5}
        for name, sign in (("left", -1), ("right", 1))
    }
    yield scene(
        "block between balls",
        block([0.04, 0.04, 0.036], 0.0134, tofu),
        balls,
        ["grip_force"],
        motion=closing(time=0.25),
    )
    rods = {
        name: {
            "kind": "cylinder",
            "radius": 0.01,
            "length": 0.08,
            "axis": [0, 1, 0],
            "position": [0, 0, z],
            "friction": 0.3,
        }
        for name, z in (("left", -0.0105), ("right", 0.0405))
    }
    yield scene(
        "block between rods", block([0.06, 0.03, 0.03], 0.01, tofu), rods, ["grip_force"], motion=closing(time=0.2)
    )
    rods = {
        name: {
            "kind": "capsule",
            "radius": 0.008,
            "length": 0.02,
            "axis": [0, 1, 0],
            "position": [x, 0, 0.02],
            "friction": 0.5,
        }
        for name, x in (("left", -0.0285), ("right", 0.0285))
    }
    yield scene("cube between capsules", block(CUBE, 0.0134, soft), rods, ["grip_force"], motion=closing(time=0.25))
    pads = {
        name: {"kind": "box", "size": [0.01, 0.017, 0.019], "position": [x, 0.002, 0.021], "friction": 0.6}
        for name, x in (("left", -0.0255), ("right", 0.0255))
    }
    yield scene("cube between pads", block(CUBE, 0.0134, tofu), pads, ["grip_force"], motion=closing(compression=0.15))
    yield scene(
        "cube held with 2 N",
        block(CUBE, 0.02, material(15e3, 0.4)),
        {"ground": GROUND, **around(CUBE)},
        ["grip_force", "compression", "lift_height"],
        motion=held(2.0, 0.3, 0.01),
        gravity=DOWN,
    )
    yield scene(
        "cube held with 3 N, XPBD",
        block(CUBE, 0.0134, material(15e3, 0.4)),
        {"ground": GROUND, **around(CUBE)},
        ["grip_force", "compression"],
        motion=held(3.0, 0.3),
        gravity=DOWN,
        regions=XPBD,
    )
    yield scene(
        "block that sags on a table",
        block([0.06, 0.05, 0.04], [0.02, 0.025, 0.02], material(4e3, 0.45)),
        {"ground": GROUND},
        ["sag"],
        duration=0.3,
        gravity=DOWN,
        probes={"edge": [0.03, 0.0, 0.02]},
    )
    yield scene(
        "plate of one cell's thickness",
        block([0.06, 0.06, 0.01], [0.015, 0.015, 0.01], tofu),
        around([0.06, 0.06, 0.01], 2),
        ["grip_force"],
        motion=closing(0.01, compression=0.15),
    )
    yield scene("cube of one cell", block(CUBE, 0.04, tofu), around(CUBE), ["grip_force"], motion=squeeze, truth=4)
    yield scene(
        "bar of one cell between balls",
        block([0.04, 0.03, 0.036], 0.04, soft),
        balls,
        ["grip_force"],
        motion=closing(time=0.25),
        truth=4,
    )


def _meshes() -> Iterator[Case]:
    tofu, soft = material(20e3), material(10e3, 0.4)
    for name, axis, cell, of, regions in (
        ("bent", 2, 0.016, tofu, FEM),
        ("ring", 1, 0.02, tofu, FEM),
        ("star", 0, 0.018, material(30e3), FEM),
        ("knee", 1, 0.018, tofu, FEM),
        ("cup", 0, 0.02, material(20e3, 0.4), FEM),
        ("pillow", 2, 0.012, soft, FEM),
        ("pear", 0, 0.016, material(20e3, 0.45, "mooney_rivlin", ratio=0.3), FEM),
        ("egg", 1, 0.014, soft, XPBD),
        ("clover", 0, 0.015, tofu, XPBD),
    ):
        low, high = extent(name)
        tools = plates(low.tolist(), high.tolist(), axis)
        model = "" if regions is FEM else ", XPBD"
        yield scene(
            f"{name} between plates{model}",
            mesh(name, cell, of),
            tools,
            ["grip_force"],
            motion=closing(hold=0.05, compression=0.12),
            regions=regions,
        )
    for name, axis, cell, force in (("dumpling", 1, 0.014, 0.8), ("log", 1, 0.014, 1.0)):
        low, high = (np.asarray(end).tolist() for end in extent(name))
        yield scene(
            f"{name} held with {force:g} N",
            mesh(name, cell, soft),
            {"ground": GROUND, **plates(low, high, axis)},
            ["grip_force", "lift_height"],
            motion=held(force, 0.2, 0.01),
            gravity=DOWN,
        )
