"""MuJoCo's flex on the cantilever and on the grasp: curves and wall times as JSON, for rivals.py to compare.

Runs in an environment of its own (`python -m benchmarks.rival_mujoco OUT.json SCENE ...`), with mujoco and numpy and
nothing of softseam. Gravity, sizes, constants, friction and motion are those of scenes/cantilever.yaml and
scenes/tofu_grasp.yaml; the law is MuJoCo's own (St. Venant-Kirchhoff), and the plates are driven at the scene's speeds.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import mujoco  # type: ignore[import-not-found]
import numpy as np
from benchmarks.rival_clock import Clock, timed

HARD = 'solimp="0.999 0.9999 0.0001"'
"""contacts as stiff as they may be: with MuJoCo's defaults the plates sink 2.6 mm into the cube"""
HEAVY = 1e6
"""mass of a plate, so that the cube does not move it [kg]"""

BEAMS = (((2, 1, 1), 0.01), ((4, 1, 1), 0.01), ((4, 1, 1), 0.005), ((8, 2, 2), 0.005), ((8, 2, 2), 0.002))
CUBES = (("quadratic", 1, 0.005), ("quadratic", 1, 0.002), ("trilinear", 4, 0.002), ("quadratic", 2, 0.002))


def flex(
    name: str, size: tuple[float, float, float], centre: str, mass: float, dof: str, cells: Any, inner: str
) -> str:
    """A block of flex cells; its vertices are the nodes of the cells."""
    counts = [(2 if dof == "quadratic" else 1) * c + 1 for c in cells]
    spacing = " ".join(f"{edge / (count - 1):.17g}" for edge, count in zip(size, counts, strict=True))
    return (
        f'<flexcomp name="{name}" type="grid" dim="3" dof="{dof}" count="{" ".join(map(str, counts))}" '
        f'cellcount="{" ".join(map(str, cells))}" spacing="{spacing}" pos="{centre}" mass="{mass}" radius="0.0001">'
        f"{inner}</flexcomp>"
    )


def beam(cells: tuple[int, int, int], step: float) -> dict[str, Any]:
    """Scene cantilever: tip deflection over time."""
    pins = f'<pin gridrange="0 0 0 0 {2 * cells[1]} {2 * cells[2]}"/>'
    law = '<elasticity young="1e5" poisson="0.4" damping="0"/><contact selfcollide="none"/>'
    body = flex("beam", (0.2, 0.05, 0.05), "0.1 0 0.1", 0.5, "quadratic", cells, law + pins)
    option = f'<option timestep="{step}" gravity="0 0 -9.81" integrator="discrete"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{option}<worldbody>{body}</worldbody></mujoco>")

    def run() -> tuple[dict[str, list[float]], Clock]:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        tip = int(np.argmin(np.linalg.norm(data.flexvert_xpos - [0.2, 0.0, 0.1], axis=1)))
        rest, clock = float(data.flexvert_xpos[tip, 2]), Clock()
        time, deflection = [0.0], [0.0]
        while data.time < 0.6 - 0.5 * step:
            with clock:
                mujoco.mj_step(model, data)
            # positions of the vertices are those of the step's start
            mujoco.mj_kinematics(model, data)
            mujoco.mj_flex(model, data)
            time.append(float(data.time))
            deflection.append(float(data.flexvert_xpos[tip, 2]) - rest)
        return {"time": time, "tip_deflection": deflection}, clock

    label = f"MuJoCo quadratic {cells[0]}x{cells[1]}x{cells[2]}, {1e3 * step:g} ms"
    return {"scene": "cantilever", "label": label, "simulated": 0.6} | timed(run)


def tofu_and_plates(
    dof: str, n: int, step: float, apart: float = 0.0431, half: float = 0.03, height: float = 0.029, hard: bool = True
) -> Any:
    """The model of a cube of tofu of n x n x n flex cells on the ground, between two plates that are driven.

    apart   from the cube's middle to a plate's [m]
    half    of a plate's edge, and height of its middle [m]
    hard    contacts as stiff as they may be at this step, or MuJoCo's defaults
    """
    contact = f'solref="{2 * step} 1" {HARD}' if hard else ""
    law = (
        '<elasticity young="20e3" poisson="0.45" damping="0.001"/>'
        f'<contact selfcollide="none" condim="3" friction="0.6" {contact}/>'
    )
    body = flex("tofu", (0.05, 0.05, 0.05), "0 0 0.0251", 1050 * 0.05**3, dof, (n, n, n), law)
    plates = "".join(
        f'<body name="{name}" pos="{x} 0 {height}" gravcomp="1"><joint type="slide" axis="1 0 0"/>'
        f'<joint type="slide" axis="0 0 1"/><geom name="{name}" type="box" size="0.005 {half} {half}" mass="{HEAVY}" '
        f'friction="0.6" condim="3" {contact}/></body>'
        for name, x in (("left", -apart), ("right", apart))
    )
    xml = (
        f'<mujoco><option timestep="{step}" gravity="0 0 -9.81" integrator="discrete" cone="elliptic"/>'
        f'<size memory="500M"/><worldbody><geom name="ground" type="plane" size="1 1 0.1" friction="0.6" condim="3" '
        f"{contact}/>"
        f'{plates}{body}</worldbody><contact><exclude body1="left" body2="world"/>'
        f'<exclude body1="right" body2="world"/></contact></mujoco>'
    )
    return mujoco.MjModel.from_xml_string(xml)


def grip(model: Any, data: Any) -> float:
    """Mean normal force on the plates [N]."""
    geoms, plane = [model.geom(name).id for name in ("left", "right")], model.geom("ground").id
    total, force = 0.0, np.zeros(6)
    for i, contact in enumerate(data.contact[: data.ncon]):
        touched = [geom for geom in contact.geom if geom in geoms]
        if touched and plane not in contact.geom:
            mujoco.mj_contactForce(model, data, i, force)
            total += abs(float((contact.frame.reshape(3, 3).T @ force[:3])[0]))
    return 0.5 * total


def places_of(model: Any) -> tuple[list[int], list[int]]:
    """Where the positions and where the velocities of the two plates begin."""
    joints = [int(model.body_dofadr[model.body(name).id]) for name in ("left", "right")]
    places = [int(model.jnt_qposadr[model.body_jntadr[model.body(name).id]]) for name in ("left", "right")]
    return places, joints


def cube(dof: str, n: int, step: float) -> dict[str, Any]:
    """Scene tofu_grasp: grip force, lift and sag over time."""
    model = tofu_and_plates(dof, n, step)
    places, joints = places_of(model)
    closing = (0.0431 - 0.005 - 0.5 * 0.85 * 0.05) / 0.02
    ends = np.cumsum([0.3, closing, 0.3, 1.0, 0.3])

    def wanted(time: float) -> tuple[float, float, float, float]:
        """Way and speed of a plate, inwards and up."""
        near = float(np.clip(time - ends[0], 0.0, closing))
        up = float(np.clip(time - ends[2], 0.0, 1.0))
        return 0.02 * near, 0.02 * (0.0 < near < closing), 0.05 * up, 0.05 * (0.0 < up < 1.0)

    def run() -> tuple[dict[str, list[float]], Clock]:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        rest = np.array(data.flexvert_xpos)
        height, clock = float(np.ptp(rest[:, 2])), Clock()
        curves: dict[str, list[float]] = {"time": [0.0], "grip_force": [0.0], "lift_height": [0.0], "sag": [0.0]}
        while data.time < ends[-1] - 0.5 * step:
            near, closing_speed, up, rising = wanted(data.time)
            for sign, place, joint in zip((1.0, -1.0), places, joints, strict=True):
                data.qpos[place : place + 2] = sign * near, up
                data.qvel[joint : joint + 2] = sign * closing_speed, rising
            with clock:
                mujoco.mj_step(model, data)
            force = grip(model, data)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_flex(model, data)
            x = data.flexvert_xpos
            if not np.isfinite(x).all():
                raise ArithmeticError(f"diverged at {data.time:.3f} s")
            curves["time"].append(float(data.time))
            curves["grip_force"].append(force)
            curves["lift_height"].append(float((x - rest)[:, 2].mean()))
            curves["sag"].append(height - float(np.ptp(x[:, 2])))
        # as softseam does: the rise since the lift began
        lifted = int(np.searchsorted(curves["time"], ends[2]))
        start = curves["lift_height"][lifted]
        curves["lift_height"] = [h - start if i >= lifted else 0.0 for i, h in enumerate(curves["lift_height"])]
        return curves, clock

    label = f"MuJoCo {dof} {n}x{n}x{n}, {1e3 * step:g} ms"
    return {"scene": "tofu_grasp", "label": label, "simulated": float(ends[-1])} | timed(run)


def main(out: Path, scenes: list[str]) -> None:
    found: list[dict[str, Any]] = []
    for scene, make, settings in (("cantilever", beam, BEAMS), ("tofu_grasp", cube, CUBES)):
        for given in settings if scene in scenes else ():
            try:
                row = make(*given)
            except (ValueError, ArithmeticError, mujoco.FatalError) as error:
                row = {"scene": scene, "label": f"{make.__name__} {given}", "failed": str(error)}
            row["version"] = f"MuJoCo {mujoco.__version__}"
            found.append(row)
            sys.stderr.write(f"{row['label']}: {row.get('failed') or row['simulated'] / np.median(row['walls'])}\n")
    out.write_text(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
