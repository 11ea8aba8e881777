"""What rolls, tumbles, flies and bounces: ways against closed forms, momenta, and what runs say of what they damp."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray

import softseam
from softseam_protocol.scene.file import load_scene
from softseam_protocol.scene.models import ModelsSpec
from softseam_services.body.body import Body
from softseam_services.server import build_setup

Floats = NDArray[np.float64]
RADIUS, LENGTH, SLOPE = 0.025, 0.05, np.radians(10.0)


def cylinder(facets: int, radius: float = RADIUS) -> str:
    """An OBJ file of a cylinder about y."""
    angle, around = 2.0 * np.pi * np.arange(facets) / facets, range(facets)
    ring = radius * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
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


def ball(radius: float) -> str:
    """An OBJ file of a ball of 48 rings about z."""
    rings, around = 48, 96
    polar, turn = np.pi * np.arange(1, rings) / rings, 2.0 * np.pi * np.arange(around) / around
    unit = [
        np.stack([np.sin(p) * np.cos(turn), np.sin(p) * np.sin(turn), np.cos(p) + 0.0 * turn], axis=1) for p in polar
    ]
    points = radius * np.concatenate([[[0.0, 0.0, 1.0]], *unit, [[0.0, 0.0, -1.0]]])
    faces = []
    for i in range(around):
        j = (i + 1) % around
        faces += [(1, 2 + i, 2 + j), (len(points), len(points) - around + j, len(points) - around + i)]
        for begin in range(2, len(points) - around, around):
            faces += [(begin + i, begin + around + i, begin + around + j), (begin + i, begin + around + j, begin + j)]
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()] + [f"f {a} {b} {c}" for a, b, c in faces]
    return "\n".join(lines) + "\n"


def scene(folder: Path, model: str, body: dict[str, Any], mesh: str | None = None, **keys: Any) -> Path:
    """The file of a scene with a cylinder, or another mesh, on or above the ground."""
    (folder / "cylinder.obj").write_text(cylinder(192) if mesh is None else mesh)
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


def rolled(file: Path, radius: float, down: Floats, away: Floats) -> tuple[float, float, list[str]]:
    """Way along `down` over that of a rigid body of this radius, less 1; by how much that is to be for what the body
    sinks in; kinds of what the run says.

    With its middle z above the plane, gravity's torque is m g sin(a) z; it turns by its way over r less a third of what
    it sinks in (a smooth ball or cylinder on a rigid plane, small strains). So its way is shorter by
    k/(1 + k) 4/3 (r - z)/r, k = I/(m r^2).
    """
    mass, gravity = mass_of(body_of(file)), np.array(json.loads(file.read_text())["gravity"])
    with softseam.open(file) as sim:
        first = sim.reset()
        steps: list[softseam.Observation] = []
        sim.run(steps.append, fields=True)
    ways = [mass @ np.asarray(o.positions) / mass.sum() for o in (first, *steps)]
    arms = np.asarray(first.positions) - ways[0]
    share = mass @ (arms[:, ::2] ** 2).sum(axis=1) / mass.sum() / radius**2
    expected = 0.5 * float(gravity @ down) / (1.0 + share) * steps[-1].time ** 2
    sank = float(np.mean([(ways[0] - way) @ away for way in ways[1:]])) / radius
    off = float((ways[-1] - ways[0]) @ down) / expected - 1.0
    return off, -4.0 / 3.0 * share / (1.0 + share) * sank, [str(e.kind) for o in steps for e in o.events]


@pytest.mark.slow
@pytest.mark.parametrize("model", ["fem", "pbd"])
def test_a_cylinder_rolls_down_a_slope(tmp_path: Path, model: str) -> None:
    """g sin(a)/(1 + I/(m r^2)) t^2/2 within 2 %, I of the masses in the cells. No step is said to add energy."""
    gravity = [9.81 * np.sin(SLOPE), 0.0, -9.81 * np.cos(SLOPE)]
    file = scene(tmp_path, model, {}, gravity=gravity, duration=0.5)
    off, _, said = rolled(file, RADIUS, np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    assert abs(off) < 0.02
    assert "energy" not in said


SLOW: dict[str, tuple[Callable[[], str], float, float, float, tuple[float, ...]]] = {
    "cylinder": (lambda: cylinder(160, 0.017), 0.017, 0.0085, 5.5, (0.0, 0.25, 0.5, 0.75)),
    "cylinder, hardly": (lambda: cylinder(160, 0.017), 0.017, 0.0085, 3.0, (0.0,)),
    "facets": (lambda: cylinder(48, 0.017), 0.017, 0.0085, 5.5, (0.0,)),
    "ball": (lambda: ball(0.023), 0.023, 0.009, 9.5, (0.0, 0.25, 0.5, 0.75)),
    "ball, hardly": (lambda: ball(0.023), 0.023, 0.009, 7.0, (0.0,)),
}
"""meshes, radius [m], cell [m], slope [degrees], and where they first touch, from a corner of an octant to the next;
what has facets begins on one of them elsewhere, and is no cylinder"""


@pytest.mark.slow
@pytest.mark.parametrize("shape", SLOW)
def test_what_rolls_slowly_by_xpbd_starts_in_time(tmp_path: Path, shape: str) -> None:
    """Within 2 % of the way of a rigid body that sinks in as much, wherever on an octant's face it touches first.

    Octants are softest at their corners: there a body starts in a well, and late, by 2.5 to 4.3 % of the way before
    points yielded by how far they are from corners.
    """
    make, radius, cell, degrees, places = SLOW[shape]
    slope, h = np.radians(degrees), 0.5 * cell
    for place in places:
        turn = place * h / radius
        away = np.array([np.sin(turn), 0.0, np.cos(turn)])
        down = np.array([np.cos(turn), 0.0, -np.sin(turn)])
        point = np.array([0.0, 0.0, radius]) - radius * (1.0 + 1e-7) * away
        gravity = 9.81 * (np.sin(slope) * down - np.cos(slope) * away)
        ground = {"kind": "plane", "friction": 0.9, "normal": away.tolist(), "point": point.tolist()}
        body = {"cell": cell, "material": {"kind": "neo_hookean", "young": 3e5, "poisson": 0.3, "density": 1000.0}}
        file = scene(
            *(tmp_path, "pbd", body),
            **{"mesh": make(), "gravity": gravity.tolist(), "duration": 0.5, "tools": {"ground": ground}},
        )
        off, due, said = rolled(file, radius, down, away)
        assert off == pytest.approx(due, abs=0.02), place
        assert "energy" not in said


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


def fallen(model: str, step: float, height: float = 1.0, **models: Any) -> tuple[float, list[str]]:
    """How far beyond g t^2/2 a block fell in .2 s [m], and what its run said of accuracy, with its estimate."""
    tools = {"ground": {"kind": "plane", "point": (0.0, 0.0, -height)}}
    keys: dict[str, Any] = {"tools": tools, "step": step, "regions": {"default": model}, "duration": 0.2}
    fall = block((0.05, 0.05, 0.05), 0.025, 2e5, 0.3, 1e3, **keys)
    with softseam.open(fall.model_copy(update={"models": ModelsSpec(**models)})) as sim:
        said: list[str] = []
        start = sim.reset()
        last = sim.run(lambda o: said.extend(e.message for e in o.events if e.kind == "accuracy"), fields=True)
        estimate = sim.estimate_errors()
    way = np.asarray(start.positions)[:, 2].mean() - np.asarray(last.positions)[:, 2].mean()
    return float(way) - 0.5 * 9.81 * last.time**2, [*said, *([estimate.text] if estimate is not None else [])]


def test_a_way_that_steps_lengthen_is_said() -> None:
    """Implicit Euler goes g h t/2 too far from rest. Not said in 2.5 ms, of bdf2, XPBD, or of what lies."""
    beyond, said = fallen("fem", 0.01)
    assert beyond == pytest.approx(0.5 * 9.81 * 0.01 * 0.2, rel=1e-6)
    ahead = [text for text in said if "ahead" in text]
    assert len(ahead) == 2 and "9.8 mm" in ahead[0] and "4.8 %" in ahead[0]
    quiet = [fallen("fem", 0.0025), fallen("fem", 0.01, fem={"integrator": "bdf2"}), fallen("pbd", 0.01)]
    assert all(abs(off) < 0.02 * 0.196 for off, _ in quiet)
    assert not [text for _, texts in [*quiet, fallen("fem", 0.01, height=0.0)] for text in texts if "ahead" in text]


@pytest.mark.slow
@pytest.mark.parametrize(("place", "step"), [(0.0, 0.01), (0.5, 0.01), (0.5, 0.0025)])
def test_a_ball_of_fem_rolls_as_far_as_its_steps_and_cells_say(tmp_path: Path, place: float, step: float) -> None:
    """From rest t/h steps of implicit Euler add h/t of the way, which is said; less that, the lattice's share stays."""
    radius, cell = 0.023, 0.009
    slope, turn = np.radians(7.0), place * 0.5 * cell / radius
    away, down = np.array([np.sin(turn), 0.0, np.cos(turn)]), np.array([np.cos(turn), 0.0, -np.sin(turn)])
    point = np.array([0.0, 0.0, radius]) - radius * (1.0 + 1e-7) * away
    gravity = 9.81 * (np.sin(slope) * down - np.cos(slope) * away)
    ground = {"kind": "plane", "friction": 0.9, "normal": away.tolist(), "point": point.tolist()}
    body = {"cell": cell, "material": {"kind": "neo_hookean", "young": 3e5, "poisson": 0.3, "density": 1000.0}}
    keys = {"gravity": gravity.tolist(), "duration": 0.3, "step": step, "tools": {"ground": ground}}
    off, due, said = rolled(scene(tmp_path, "fem", body, **{"mesh": ball(radius), **keys}), radius, down, away)
    assert off - step / 0.3 == pytest.approx(due, abs=0.03)
    assert ("accuracy" in said) == (step > 0.005)
