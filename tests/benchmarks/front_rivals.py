"""Other simulators on the tray of `front`: `python tests/benchmarks/front.py --rivals` measures them.

Each runs in a scratch environment with a program of its own (`front_mujoco`, `front_newton`, `front_pybullet`), one
setting a process, on one thread: the same cubes, walls, friction and damping, and fingers that go the way that ours
went. Beside the force and the time, which are held against ours, there is what a user of several bodies asks of them:
how deep they are in one another, what the floor bears, and what two free cubes that meet keep of their momentum. Shapes
are judged by one program for all.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from itertools import combinations
from pathlib import Path
from time import process_time
from typing import Any

import igl
import numpy as np
from benchmarks.front_runs import CLOSES, GRIPPED, TOFU, Choice, scene_of
from benchmarks.front_tray import Floats, Tray, ended, grid_of
from benchmarks.front_truth import Found, needed, truth_of
from benchmarks.rivals import HERE, RIVALS, environment
from cubes import EDGE, SOFT, cube  # beside the tests
from cubes import scene_of as cubes_of
from rich.console import Console

from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.tools import BoxTool
from softseam_services.body.body import Body
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

SIDE = 2
"""cubes along each side of the tray: with 3 most rivals take an hour"""
KEPT_TRAY = "tray.json"
"""where the tray as others get it is kept"""
LIMIT = 100.0
"""CPU seconds that a rival's run may take"""
MEETING, APART, ASIDE, MEETS = 0.2, 0.0015, 0.004, 0.3
"""two free cubes: speed of one [m/s], gap [m] and offset [m] of the other, for so long [s]"""
OURS = tuple(
    Choice(TOFU, model, cells, beside, side=SIDE)
    for model, cells, beside in (
        ("fem", 2, 1),
        ("fem", 4, 1),
        ("pbd", 4, 1),
        ("pbd", 6, 1),
        ("pbd", 2, 2),
        ("pbd", 4, 4),
    )
)
"""what stands beside them"""
LOOKS = "rest", "held", "air"


@dataclass(frozen=True)
class Setting:
    """How a rival runs the tray: its program, what is said of it, what its program is given."""

    rival: str
    label: str
    given: Mapping[str, Any]


def _mujoco(cells: int, sleep: bool = False, contact: str = "stiff", solver: str = "Newton") -> Setting:
    by = "" if solver == "Newton" else f", {solver}"
    said = f"MuJoCo trilinear {cells}³, {contact} contact{by}, 2 ms{', sleep' if sleep else ''}"
    given = {"cells": cells, "step": 0.002, "sleep": sleep, "contact": contact, "solver": solver}
    return Setting("mujoco", said, given)


def _newton(solver: str, cells: int, step: float, iterations: int) -> Setting:
    said = f"Newton {solver} {cells}³, {1e3 * step:g} ms, {iterations} iterations"
    return Setting("newton", said, {"solver": solver, "cells": cells, "step": step, "iterations": iterations})


def _pybullet(cells: int, step: float, margin: float = 0.0002) -> Setting:
    given = {"cells": cells, "step": step, "margin": margin, "repulsion": 0.5}
    return Setting("pybullet", f"PyBullet {cells}³, {1e3 * step:g} ms, margin {1e3 * margin:g} mm", given)


PACKAGES = RIVALS | {"pybullet": ("pybullet==3.2.7", "numpy==2.4.6")}
"""what is installed for each"""
SETTINGS = (
    *(_mujoco(2, sleep) for sleep in (False, True)),
    _mujoco(2, solver="CG"),
    _mujoco(2, contact="default"),
    _newton("VBD", 2, 0.002, 10),
    _newton("VBD", 4, 0.002, 10),
    *(_newton(f"VBD on XPBD, {by}", 4, 0.0005, 10) for by in ("lagged", "staggered", "ADMM")),
    _mujoco(4),
    _pybullet(2, 0.0005),
    _pybullet(4, 0.0005),
    _pybullet(4, 0.0005, margin=0.0005),
    _pybullet(4, 0.001),
)


# ---- the tray as others get it


def tray_of(choice: Choice) -> Tray:
    """The tray, with the ways on which its fingers went as it was simulated like this, and when."""
    scene = scene_of(choice)
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    bodies = [simulation.bodies[name].body for name in _in_order(simulation)]
    centres = [0.5 * (body.x_rest.min(axis=0) + body.x_rest.max(axis=0)) for body in bodies if isinstance(body, Body)]
    names = list(simulation.tools.names)
    fingers = {name: names.index(name) for name in ("left", "right")}
    tools = {name: tool for name, tool in scene.tools.items() if isinstance(tool, BoxTool)}
    times, ways, phases = [0.0], {name: [list(tools[name].position)] for name in fingers}, [0]
    try:
        while not simulation.done:
            report = simulation.step()
            times.append(len(times) * choice.step)
            phases.append(report.phase)
            for name, at in fingers.items():
                ways[name].append(report.tool_position[at].tolist())
    finally:
        simulation.close()
    last = {phase: max(t for t, of in zip(times, phases, strict=True) if of == phase) for phase in set(phases)}
    tool = tools["left"]
    return Tray(
        edge=EDGE,
        cubes=np.array(centres).tolist(),
        velocities=[[0.0] * 3 for _ in centres],
        material=_material(),
        walls=[
            {"size": list(tools[name].size), "position": list(tools[name].position), "friction": 0.0}
            for name in ("west", "east", "south", "north")
        ],
        floor=scene.tools["floor"].friction,
        gravity=9.81,
        finger={"size": list(tool.size), "friction": tool.friction},
        times=times,
        ways=ways,
        looks={name: last[phase] for name, phase in zip(LOOKS, (0, 3, 5), strict=True)},
        closes=last[CLOSES - 1],
        duration=times[-1],
    )


def _material() -> dict[str, float]:
    own = {name: float(str(SOFT[name])) for name in ("young", "poisson", "density")}
    return {**own, "damping": 0.01, "friction": 0.4}


def meeting_of(tray: Tray) -> Tray:
    """Two free cubes, of which one runs into the other."""
    return replace(
        tray,
        cubes=[[0.0, 0.0, 0.0], [EDGE + APART, ASIDE, ASIDE]],
        velocities=[[MEETING, 0.0, 0.0], [0.0] * 3],
        walls=[],
        gravity=0.0,
        ways={},
        looks={},
        closes=0.0,
        duration=MEETS,
    )


def _in_order(simulation: Simulation) -> list[str]:
    return [*(name for name in simulation.bodies if name != GRIPPED), GRIPPED]


# ---- ours


def ours(choice: Choice, tray: Tray) -> dict[str, Any]:
    """The same of a run of ours: what `front_tray.ended` gives."""
    scene = scene_of(choice)
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    order, names = _in_order(simulation), simulation.tools.names
    rests = [_outline(simulation.bodies[name].body) for name in order]
    looks: dict[str, Any] = {}
    series: list[list[float]] = []
    cpu, time = 0.0, 0.0
    try:
        while not simulation.done:
            began = process_time()
            report = simulation.step()
            time += choice.step
            cpu += (process_time() - began) * (report.phase >= CLOSES)
            floor, left, right = (report.wrench[names.index(name)] for name in ("floor", "left", "right"))
            below = sum(abs(own.force_z) for name, own in report.interfaces.items() if GRIPPED in name.split("+"))
            series.append([time, abs(floor[2]), abs(left[0]), abs(right[0]), below])
            if look := tray.looked(time, choice.step):
                frames = simulation.frames()
                looks[look] = [frames[name].x[on].tolist() for name, (on, _) in zip(order, rests, strict=True)]
    finally:
        simulation.close()
    found = np.array(series)
    names_of = {"floor": 1, "left": 2, "right": 3, "under": 4}
    forces = {name: found[:, at] for name, at in names_of.items()}
    kept = ended(tray, [], looks, found[:, 0], forces, _meeting(choice), cpu)
    return kept | {"grid": [grid_of(rest, 1) for _, rest in rests]}


def _outline(body: object) -> tuple[Any, Floats]:
    """Nodes on the surface of a cube, and their places at rest."""
    assert isinstance(body, Body)
    x = body.x_rest
    on = np.flatnonzero(np.isclose(x, x.min(axis=0)).any(axis=1) | np.isclose(x, x.max(axis=0)).any(axis=1))
    return on, x[on]


def _meeting(choice: Choice) -> tuple[Floats, Floats]:
    """Momentum of two free cubes, one as the gripped one and one as the others, before and after they meet."""
    material = SOFT | {"retardation_time": 0.01}
    one = cube(0, 1, choice.cells, material=material, regions={"default": choice.model}, velocity=[MEETING, 0, 0])
    other = cube(0, 1, choice.beside, material=material, regions={"default": choice.others})
    bodies = {"one": one | {"position": [0, 0, 0]}, "other": other | {"position": [EDGE + APART, ASIDE, ASIDE]}}
    touch = {"touch": {"kind": "contact", "between": ["one", "other"], "friction": 0.4}}
    scene = cubes_of(bodies, interfaces=touch, gravity=[0, 0, 0], duration=MEETS, step=choice.step, tools={})
    simulation = Simulation(bundle_scene(scene), EmbeddedTransport())
    mass = _material()["density"] * EDGE**3
    try:
        while not simulation.done:
            report = simulation.step()
    finally:
        simulation.close()
    return np.array([mass * MEETING, 0.0, 0.0]), np.array(report.momentum)


# ---- what is said of all


def surface_of(grid: Floats) -> Any:
    """Triangles, outward, on the six sides of a cube's points in rows (t, 3)."""
    found = []
    for axis in range(3):
        for side in (grid[:, axis].min(), grid[:, axis].max()):
            on = np.flatnonzero(np.abs(grid[:, axis] - side) < 1e-6)
            u, v = grid[on, (axis + 1) % 3], grid[on, (axis + 2) % 3]
            count = round(len(on) ** 0.5)
            at = on[np.lexsort((np.round(v, 7), np.round(u, 7)))].reshape(count, count)
            a, b, c, d = (each.ravel() for each in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
            two = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
            found.append(two if side > 0.0 else two[:, ::-1])
    return np.ascontiguousarray(np.concatenate(found))


def deepest(found: Mapping[str, Any]) -> float:
    """How deep a point of a cube's surface is in another, at any look [m]."""
    worst = 0.0
    for look in found["looks"].values():
        x = [np.array(each) for each in look]
        grids = found["grid"] if len(found["grid"]) == len(x) else [found["grid"]] * len(x)
        faces = [surface_of(np.array(grid)) for grid in grids]
        for one, other in combinations(range(len(x)), 2):
            for a, b in ((one, other), (other, one)):
                points = x[a][np.unique(faces[a])]
                near = ((points > x[b].min(axis=0)) & (points < x[b].max(axis=0))).all(axis=1)
                if near.any():
                    worst = max(worst, -float(np.min(igl.signed_distance(points[near], x[b], faces[b])[0])))
    return worst


def measured(
    tray: Tray, settings: Iterable[Setting], out: Path, console: Console
) -> Iterable[tuple[str, dict[str, Any]]]:
    """Each rival's label, and what its runs of the tray and of two free cubes came to; kept in `out`."""
    scenes = {"tray": tray, "meeting": meeting_of(tray)}
    for setting in settings:
        program = HERE / f"front_{setting.rival}.py"
        about = [dict(setting.given), asdict(tray), LIMIT, program.read_text(), (HERE / "front_tray.py").read_text()]
        kept = out / f"rival-{sha256(json.dumps(about).encode()).hexdigest()[:16]}.json"
        if not kept.exists():
            python = environment(out.parent / f"rival-{setting.rival}", PACKAGES[setting.rival])
            both = {}
            for name, scene in scenes.items():
                given, left = out / f"{name}.json", out / "left.json"
                given.write_text(json.dumps(asdict(scene)))
                command = [str(python), "-m", program.stem, str(given), str(left)]
                alone = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(HERE.parent)}
                command[2] = f"benchmarks.{program.stem}"
                try:
                    left.unlink(missing_ok=True)
                    subprocess.run(
                        [*command, json.dumps({**setting.given, "limit": LIMIT})],
                        check=True,
                        timeout=20 * LIMIT,
                        env=alone,
                        capture_output=True,
                    )
                    both[name] = json.loads(left.read_text())
                except subprocess.SubprocessError as error:
                    both[name] = {"stopped": f"its process ended: {error.__class__.__name__}"}
            kept.write_text(json.dumps(both))
        both = json.loads(kept.read_text())
        console.print(f"{setting.label}: {both['tray'].get('stopped') or both['tray']['force']}", highlight=False)
        yield setting.label, both["tray"] | {"momentum": both["meeting"].get("momentum")}


def compared(out: Path, runs: Callable[[Choice], Found], console: Console) -> dict[str, Any]:
    """All rows, ours first, and what they are held against, as JSON: this tray's own reference, made as the larger
    one's."""
    truth = truth_of({choice: runs(replace(choice, side=SIDE)) for choice in needed(TOFU)}, TOFU)
    tray = tray_of(replace(OURS[1], sleep=False))
    (out / KEPT_TRAY).write_text(json.dumps(asdict(tray)))
    rows = [_row(choice.label, ours(choice, tray), truth.force, own=True) for choice in OURS]
    rows += [_row(label, found, truth.force, own=False) for label, found in measured(tray, SETTINGS, out, console)]
    return {"force": truth.force.tolist(), "known": truth.force_known, "cubes": SIDE**3 + 1, "rows": rows}


def added(kept: Mapping[str, Any], out: Path, names: Sequence[str], console: Console) -> dict[str, Any]:
    """What is `kept` of `compared`, with the rows of these programs made again on the tray that is kept beside it. All
    other rows stay, ours among them. Raises ValueError of a name that is none."""
    if unknown := set(names) - set(PACKAGES):
        raise ValueError(f"{', '.join(sorted(unknown))}: no such rival, there are {', '.join(PACKAGES)}")
    again = [setting for setting in SETTINGS if setting.rival in names]
    made = measured(Tray.read(out / KEPT_TRAY), again, out, console)
    rows = {label: _row(label, found, np.array(kept["force"]), own=False) for label, found in made}
    rows = {row["label"]: row for row in kept["rows"]} | rows
    order = [*(label for label, row in rows.items() if row["own"]), *(setting.label for setting in SETTINGS)]
    return {**kept, "rows": [rows[label] for label in order if label in rows]}


def _row(label: str, found: Mapping[str, Any], truth: Floats, own: bool) -> dict[str, Any]:
    about = {"momentum": found.get("momentum"), "stopped": found.get("stopped"), "version": found.get("version")}
    row = {"label": label, "own": own, **about}
    if row["stopped"] is None:
        force = np.array(found["force"], dtype=float)
        row |= {name: found[name] for name in ("force", "seconds", "floor", "under")}
        row |= {"error": float(np.abs(force / truth - 1.0).max()), "deepest": deepest(found)}
    return row
