"""Scenes with slip or a drop, see claim_scenes.py."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.claim_case import (
    CUBE,
    DOWN,
    GROUND,
    MIDDLE,
    XPBD,
    Case,
    Document,
    around,
    block,
    closing,
    material,
    mesh,
    scene,
)


def slips() -> Iterator[Case]:
    tofu = material(20e3, 0.45, retardation_time=0.0015)
    table = {"table": GROUND | {"friction": 0.3}}
    yield scene(
        "cube that falls flat",
        block(CUBE, 0.0134, tofu, position=[0, 0, 0.01]),
        table,
        ["sag"],
        duration=0.25,
        step=0.005,
        gravity=DOWN,
        slips=True,
    )
    yield scene(
        "cube that falls flat, XPBD",
        block(CUBE, 0.02, tofu, position=[0, 0, 0.015]),
        table,
        ["sag"],
        duration=0.25,
        step=0.005,
        gravity=DOWN,
        regions=XPBD,
        slips=True,
    )
    yield scene(
        "slab that falls slowly",
        block([0.06, 0.06, 0.03], 0.015, material(10e3), position=[0, 0, 0.005]),
        table,
        ["sag"],
        duration=0.2,
        step=0.005,
        gravity=DOWN,
        slips=True,
    )
    ball = {"ball": {"kind": "sphere", "radius": 0.03, "position": [0.004, 0, -0.03], "friction": 0.5}}
    yield scene(
        "block that falls on a ball",
        block([0.05, 0.04, 0.03], 0.015, tofu, position=[0, 0, 0.008]),
        ball,
        ["sag"],
        duration=0.2,
        step=0.005,
        gravity=DOWN,
        slips=True,
    )
    tilted = [4.0, 0, -9.0]
    yield scene(
        "block that slides down a slope",
        block([0.05, 0.04, 0.03], 0.015, tofu),
        table,
        [],
        probes=MIDDLE,
        duration=0.3,
        gravity=tilted,
        slips=True,
    )
    yield scene(
        "block that a slope holds",
        block([0.05, 0.04, 0.03], 0.015, tofu),
        {"ground": GROUND | {"friction": 0.6}},
        ["sag"],
        duration=0.3,
        gravity=[3.4, 0, -9.2],
        slips=True,
        probes={"top": [0, 0, 0.03]},
    )
    yield scene(
        "block thrown over a table",
        block([0.05, 0.05, 0.03], [0.025, 0.025, 0.015], tofu, velocity=[0.4, 0, 0]),
        table,
        [],
        probes=MIDDLE,
        duration=0.2,
        gravity=DOWN,
        slips=True,
    )
    plate = {"plate": {"kind": "box", "size": [0.01, 0.08, 0.05], "position": [-0.0355, 0, 0.0255], "friction": 0.6}}
    push: list[Document] = [{"hold": 0.1}, {"tools": ["plate"], "move": [0.02, 0, 0], "speed": 0.06}, {"hold": 0.1}]
    yield scene(
        "block pushed over a table",
        block([0.06, 0.06, 0.04], 0.02, tofu),
        table | plate,
        [],
        probes=MIDDLE,
        motion=push,
        gravity=DOWN,
        slips=True,
    )
    yield scene(
        "block pushed over a table, XPBD",
        block([0.06, 0.06, 0.03], 0.015, material(30e3)),
        table | plate,
        [],
        probes=MIDDLE,
        motion=push,
        gravity=DOWN,
        regions=XPBD,
        slips=True,
    )
    for told, friction, lift in (
        ("cube that slips out of a grip", 0.1, 0.015),
        ("cube that creeps in a grip", 0.3, 0.015),
    ):
        yield scene(
            told,
            block(CUBE, 0.02, tofu),
            {
                "ground": GROUND,
                **around(CUBE) | {name: tool | {"friction": friction} for name, tool in around(CUBE).items()},
            },
            ["grip_force", "lift_height", "slip"],
            motion=[
                *closing(hold=0.05, compression=0.06),
                {"tools": ["left", "right"], "move": [0, 0, lift], "speed": 0.05},
            ],
            gravity=DOWN,
            slips=True,
        )
    yield scene(
        "egg that falls",
        mesh("egg", 0.014, tofu, position=[0, 0, 0.008]),
        table,
        ["sag"],
        duration=0.2,
        step=0.005,
        gravity=DOWN,
        slips=True,
    )
    yield scene(
        "bun thrown over a table",
        mesh("bun", 0.018, tofu, velocity=[0.3, 0, 0]),
        table,
        [],
        probes=MIDDLE,
        duration=0.2,
        gravity=DOWN,
        slips=True,
    )
    yield scene(
        "star on a slope",
        mesh("star", 0.018, material(30e3)),
        table,
        [],
        probes=MIDDLE,
        duration=0.2,
        gravity=tilted,
        slips=True,
    )
