"""A tray of cubes by MuJoCo's flex: forces, CPU time and shapes as JSON, for front_rivals.py to compare.

Runs in an environment of its own (`python -m benchmarks.front_mujoco TRAY.json OUT.json SETTING`), with mujoco and
numpy and nothing of softseam. Sizes, constants, friction, damping and the fingers' way are in TRAY.json; the law is
MuJoCo's own (St. Venant-Kirchhoff). All forces of contact are MuJoCo's.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import mujoco  # type: ignore[import-not-found]
import numpy as np
from benchmarks.front_tray import MEAN, Tray, ended, grid_of
from benchmarks.rival_clock import Clock
from benchmarks.rival_mujoco import HARD, HEAVY, flex

SOFT = 'solref="{time} 1" solimp="0.95 0.99 0.0005"'
"""between bodies: the stiffest that keeps a pile of cubes at rest"""


def model_of(tray: Tray, cells: int, step: float, sleep: bool, contact: str, solver: str) -> Any:
    """The tray in MuJoCo. What tools and floor are is decided by them (`priority`), of bodies by both."""
    hard = f'solref="{2 * step} 1" {HARD}'
    between = {"default": "", "stiff": SOFT.format(time=2 * step), "hard": hard}[contact]
    law = (
        '<elasticity young="{young}" poisson="{poisson}" damping="{damping}"/>'
        '<contact selfcollide="none" condim="3" friction="{friction}" conaffinity="3" {between}/>'
    ).format(between=between, **tray.material)
    edge = tray.edge
    cubes = "".join(
        flex(
            f"cube{i}",
            (edge, edge, edge),
            " ".join(map(str, at)),
            tray.mass,
            "trilinear",
            (cells,) * 3,
            law,
        )
        for i, at in enumerate(tray.cubes)
    )

    def box(size: list[float], friction: float, more: str = "") -> str:
        half = " ".join(str(0.5 * each) for each in size)
        return (
            f'<geom type="box" size="{half}" contype="2" conaffinity="0" friction="{friction}" condim="3" '
            f'priority="1" {hard} {more}/>'
        )

    walls = "".join(
        f'<body pos="{" ".join(map(str, each["position"]))}">{box(each["size"], each["friction"])}</body>'
        for each in tray.walls
    )
    fingers = "".join(
        f'<body name="{name}" pos="{" ".join(map(str, way[0]))}" gravcomp="1" sleep="never">'
        f'<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
        + box(tray.finger["size"], tray.finger["friction"], f'name="{name}" mass="{HEAVY}"')
        + "</body>"
        for name, way in tray.ways.items()
    )
    floor = (
        f'<geom name="floor" type="plane" size="1 1 0.1" contype="2" conaffinity="0" friction="{tray.floor}" '
        f'condim="3" priority="1" {hard}/>'
        if tray.gravity
        else ""
    )
    flag = '<flag sleep="enable"/>' if sleep else ""
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step}" gravity="0 0 {-tray.gravity}" integrator="discrete" cone="elliptic" '
        f'solver="{solver}" sleep_tolerance="0.005">{flag}</option><size memory="4G"/>'
        f"<worldbody>{floor}{walls}{fingers}{cubes}</worldbody></mujoco>"
    )


class Forces:
    """Contact forces of the step that was just taken [N]."""

    def __init__(self, model: Any, data: Any) -> None:
        names = ("floor", "left", "right")
        self.of = dict.fromkeys(names, 0.0)
        self.under_last = 0.0
        ids = {mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name): name for name in names}
        push, last = np.zeros(6), model.nflex - 1
        for i, contact in enumerate(data.contact[: data.ncon]):
            mujoco.mj_contactForce(model, data, i, push)
            world = contact.frame.reshape(3, 3).T @ push[:3]
            name = ids.get(int(max(contact.geom)))
            if name is not None:
                self.of[name] += abs(float(world[2 if name == "floor" else 0]))
            elif last in contact.flex and min(contact.flex) >= 0:
                self.under_last += abs(float(world[2]))


def run(tray: Tray, cells: int, step: float, sleep: bool, contact: str, solver: str, limit: float) -> dict[str, Any]:
    """What came of it."""
    model = model_of(tray, cells, step, sleep, contact, solver)
    data = mujoco.MjData(model)
    places = {
        name: (int(model.jnt_qposadr[model.body(name).jntadr[0]]), int(model.body(name).dofadr[0]))
        for name in tray.ways
    }
    nodes = (cells + 1) ** 3
    first = 2 * len(tray.ways)
    for i, velocity in enumerate(tray.velocities):
        data.qvel[first + 3 * nodes * i : first + 3 * nodes * (i + 1)] = np.tile(velocity, nodes)
    mujoco.mj_forward(model, data)
    masses = np.repeat(tray.mass / nodes, nodes * len(tray.cubes))
    owned = [i for i in range(model.nbody) if model.body_dofnum[i] == 3]
    if len(owned) == len(masses):
        masses = model.body_mass[owned]

    def momentum() -> Any:
        return masses @ data.qvel[first:].reshape(-1, 3)

    began, rest = momentum(), np.array(data.flexvert_xpos)
    clock, late, forces = Clock(), Clock(), []
    looks: dict[str, Any] = {}
    steps = round(tray.duration / step)
    for i in range(steps):
        now, then = i * step, (i + 1) * step
        for name, (place, joint) in places.items():
            at, to = tray.place(name, now), tray.place(name, then)
            data.qpos[place : place + 2] = (at - tray.ways[name][0])[[0, 2]]
            data.qvel[joint : joint + 2] = ((to - at) / step)[[0, 2]]
        spent = late if then > tray.closes else clock
        with spent:
            mujoco.mj_step(model, data)
        wanted = tray.looked(then, step)
        if wanted or tray.near_look(then):
            found = Forces(model, data)
            forces.append((then, *found.of.values(), found.under_last, int((data.tree_asleep < 0).sum())))
        if wanted:
            mujoco.mj_kinematics(model, data)
            mujoco.mj_flex(model, data)
            looks[wanted] = np.array(data.flexvert_xpos).reshape(len(tray.cubes), -1, 3).tolist()
            if not np.isfinite(data.flexvert_xpos).all():
                return {"stopped": f"diverged before {then:.2f} s"}
        if clock.cpu + late.cpu > limit:
            return {"stopped": f"{i + 1} of {steps} steps took {clock.cpu + late.cpu:.0f} CPU s"}
        if not np.isfinite(data.qpos).all() or data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return {"stopped": f"diverged at {then:.2f} s"}
    series = np.array(forces).reshape(-1, 6)
    return ended(
        tray,
        grid_of(rest, len(tray.cubes)),
        looks,
        series[:, 0],
        {name: series[:, 1 + at] for at, name in enumerate(("floor", "left", "right", "under"))},
        (began, momentum()),
        late.cpu,
    )


def main(scene: Path, out: Path, setting: dict[str, Any]) -> None:
    tray = Tray.read(scene)
    try:
        found = run(tray, **setting)
    except (ValueError, ArithmeticError, mujoco.FatalError) as error:
        found = {"stopped": " ".join(str(error).split())[:200]}
    out.write_text(json.dumps({"version": f"MuJoCo {mujoco.__version__}", "mean_of_last": MEAN} | found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), json.loads(sys.argv[3]))
