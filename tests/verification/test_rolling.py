"""What rolls, tumbles, flies and bounces: ways against closed forms, momenta, and what runs say of what they damp."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray

import softseam
from softseam_protocol.scene.file import load_scene
from softseam_services.body.body import Body
from softseam_services.server import build_setup

Floats = NDArray[np.float64]
RADIUS, LENGTH, SLOPE = 0.025, 0.05, np.radians(10.0)


def cylinder(facets: int) -> str:
    """An OBJ file of a cylinder about y."""
    angle, around = 2.0 * np.pi * np.arange(facets) / facets, range(facets)
    ring = RADIUS * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    ends = [ring + np.array([0.0, y, 0.0]) for y in (-0.5 * LENGTH, 0.5 * LENGTH)]
    points = np.concatenate([*ends, [[0.0, -0.5 * LENGTH, 0.0], [0.0, 0.5 * LENGTH, 0.0]]])
    first, second, low, high = 1, 1 + facets, 1 + 2 * facets, 2 + 2 * facets
    faces = []
    for i in around:
        j = (i + 1) % facets
        faces += [(first + i, second + i, second + j), (first + i, second + j, first + j)]
        faces += [(low, first + i, first + j), (high, second + j, second + i)]
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()] + [f"f {a} {b} {c}" for a, b, c in faces]
    return "\n".join(lines) + "\n"


def scene(folder: Path, model: str, body: dict[str, Any], **keys: Any) -> Path:
    """The file of a scene with a cylinder on or above the ground."""
    (folder / "cylinder.obj").write_text(cylinder(192))
    material = {"kind": "neo_hookean", "young": 2e5, "poisson": 0.3, "density": 1000.0}
    shape = {"kind": "mesh", "path": "cylinder.obj"}
    whole = {
        "softseam": 1,
        "name": "rolls",
        "step": 0.01,
        "body": {"shape": shape, "cell": 0.0125, "material": material, **body},
        "tools": {"ground": {"kind": "plane", "friction": 0.8}},
        "regions": {"default": model},
        **keys,
    }
    file = folder / "scene.yaml"
    file.write_text(json.dumps(whole))
    return file


def body_of(file: Path) -> Body:
    """As a session builds it."""
    body = build_setup(load_scene(file).bundle).body
    assert body.has_cells
    return body


def mass_of(body: Body) -> Floats:
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes, body.cell_mass)
    return mass


@pytest.mark.slow
@pytest.mark.parametrize(("model", "within"), [("fem", 0.02), ("pbd", 0.03)])
def test_a_cylinder_rolls_down_a_slope(tmp_path: Path, model: str, within: float) -> None:
    """g sin(a)/(1 + I/(m r^2)) t^2/2 within 2 %, I of the masses in the cells; by XPBD, whose substeps damp where it is
    pressed, within 3 %. No step is said to add energy."""
    gravity = [9.81 * np.sin(SLOPE), 0.0, -9.81 * np.cos(SLOPE)]
    file = scene(tmp_path, model, {}, gravity=gravity, duration=0.5)
    mass = mass_of(body_of(file))
    with softseam.open(file) as sim:
        start = sim.reset()
        steps: list[softseam.Observation] = []
        last = sim.run(steps.append, fields=True)
    began, ended = (mass @ np.asarray(o.positions) / mass.sum() for o in (start, last))
    arms = np.asarray(start.positions) - began
    share = mass @ (arms[:, ::2] ** 2).sum(axis=1) / mass.sum() / RADIUS**2
    expected = 0.5 * gravity[0] / (1.0 + share) * last.time**2
    assert ended[0] - began[0] == pytest.approx(expected, rel=within)
    assert not [e.message for o in steps for e in o.events if e.kind == "energy"]


def test_a_thrown_mesh_keeps_its_spin(tmp_path: Path) -> None:
    """Gravity has no torque about the centre."""
    body = {"position": [0.0, 0.0, 0.5], "velocity": [0.5, 0.0, 2.0], "spin": [3.0, 8.0, -5.0]}
    file = scene(tmp_path, "fem", body, duration=0.3)
    thrown = body_of(file)
    mass = mass_of(thrown)
    with softseam.open(file) as sim:
        start = sim.reset()
        last = sim.run(fields=True)
    arms = np.asarray(start.positions) - mass @ np.asarray(start.positions) / mass.sum()
    before = mass @ np.cross(arms, thrown.v_initial)
    centre = mass @ np.asarray(last.positions) / mass.sum()
    after = np.asarray(last.angular_momentum) - np.cross(centre, last.momentum)
    np.testing.assert_allclose(after, before, atol=3e-7 * float(np.linalg.norm(before)))


def test_a_bar_tumbles_about_its_middle_axis() -> None:
    """It turns over, keeps its momentum, and its energy to .5 %, at 10 ms."""
    body = {"spin": (0.1, 12.0, 0.1), "position": (0.0, 0.0, 0.5)}
    run = FemRun(block((0.1, 0.05, 0.025), 0.025, 2e5, 0.4, 1e3, gravity=(0.0, 0.0, 0.0), step=0.01, body=body))
    mass, rest = run.parameters.mass, run.x.copy()
    axis, replies, along = rest[:, 1] - rest[:, 1].mean(), [], []
    for _ in range(250):
        replies.append(run.step())
        along.append(float(mass @ (axis * run.x[:, 1])) / float(mass @ axis**2))
    energy = np.array([reply.kinetic + reply.strain for reply in replies])
    assert min(along) < -0.8 and np.ptp(energy) < 5e-3 * energy[0]
    first, last = np.array(replies[0].angular_momentum), np.array(replies[-1].angular_momentum)
    np.testing.assert_allclose(last, first, atol=2.5e-6 * float(np.linalg.norm(first)))


def dropped(step: float, height: float, **material: float) -> list[str]:
    """What a run says of a block's fall."""
    body = {"position": (0.0, 0.0, height)}
    tools = {"ground": {"kind": "plane"}}
    fall = block(
        (0.05, 0.05, 0.05), 0.025, 2e5, 0.3, 1e3, body=body, tools=tools, step=step, regions={"default": "fem"}
    )
    if material:
        assert fall.body.kind == "cells"
        fall = fall.with_body(fall.body.model_copy(update=material))
    with softseam.open(fall.model_copy(update={"duration": 0.25})) as sim:
        said: list[str] = []
        sim.reset()
        while not sim.done:
            said += [event.message for event in sim.step().events]
        said += [estimate.text for estimate in [sim.estimate_errors()] if estimate is not None]
    return said


def test_a_bounce_that_steps_damp_is_told() -> None:
    """In the session's events and its estimate; not of a body that is put down, nor of one that drag slows."""
    told = [text for text in dropped(0.002, 0.1) if "bounces too little" in text]
    assert len(told) == 2 and "shorten the step" in told[0]
    assert not [text for text in dropped(0.002, 0.002) if "bounces" in text]
    assert not [text for text in dropped(0.002, 0.1, damping=5.0) if "bounces" in text]


def test_swings_that_steps_damp_are_told() -> None:
    """Of a bar that is bent and let go, as a run ends."""
    fixed = ({"min": (-1.0, -1.0, -1.0), "max": (-0.099, 1.0, 1.0)},)
    bar = block((0.2, 0.02, 0.02), 0.02, body={"fixed": fixed}, step=0.01, regions={"default": "fem"})
    with softseam.open(bar.model_copy(update={"duration": 0.2})) as sim:
        said: list[str] = []
        sim.reset()
        sim.run(lambda seen: said.extend(event.message for event in seen.events))
    assert [text for text in said if "which no tool touched" in text]
