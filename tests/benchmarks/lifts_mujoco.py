"""MuJoCo's flex lifts a cube of tofu as lifts.py says: actions a second, and forces, as JSON.

Runs in an environment of its own (`python -m benchmarks.lifts_mujoco OUT.json`), with mujoco and numpy and nothing of
softseam. Each piece is an `MjData` of its own; of several threads each steps one, outside of Python's lock.
"""

from __future__ import annotations

import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import mujoco  # type: ignore[import-not-found]
import numpy as np
from benchmarks.lift_motion import ACT, APART, HALF, HEIGHT, HELD, LIFTED, SPEEDS
from benchmarks.rival_mujoco import grip, places_of, tofu_and_plates

SETTINGS = (
    ("trilinear", 3, 0.001, True, 2),
    ("trilinear", 5, 0.001, True, 2),
    ("trilinear", 5, 0.002, True, 1),
    ("trilinear", 5, 0.004, True, 1),
    ("trilinear", 5, 0.001, False, 1),
    ("full", 5, 0.002, True, 1),
)
"""kind of flex, cells along an edge, step [s], stiff contacts, threads"""


def lift(model: Any, step: float) -> dict[str, float]:
    """One lift. Raises ArithmeticError where it diverges."""
    data = mujoco.MjData(model)
    places, joints = places_of(model)
    mujoco.mj_forward(model, data)
    start, parts = np.array(data.flexvert_xpos), round(ACT / step)
    near = up = 0.0
    forces: dict[int, float] = {}
    for number, (close, rise) in enumerate(SPEEDS, 1):
        for _ in range(parts):
            for sign, place, joint in zip((1.0, -1.0), places, joints, strict=True):
                data.qpos[place : place + 2] = sign * near, up
                data.qvel[joint : joint + 2] = sign * close, rise
            mujoco.mj_step(model, data)
            near, up = near + close * step, up + rise * step
        if number in (HELD, LIFTED):
            forces[number] = grip(model, data)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_flex(model, data)
    if not np.isfinite(data.flexvert_xpos).all():
        raise ArithmeticError("diverged")
    risen = float((data.flexvert_xpos - start)[:, 2].mean())
    return {"held": forces[HELD], "lifted": forces[LIFTED], "risen": risen}


def measured(dof: str, n: int, step: float, hard: bool, threads: int) -> dict[str, Any]:
    """A row: what a lift came to; actions a second of processor time, and of wall time in one thread and in several."""
    model = tofu_and_plates(dof, n, step, APART, HALF, HEIGHT, hard)
    began, spent = perf_counter(), process_time()
    found = lift(model, step)
    rates = {"cpu": len(SPEEDS) / (process_time() - spent), "wall": len(SPEEDS) / (perf_counter() - began)}
    if threads > 1:
        began = perf_counter()
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(lambda _: lift(model, step), range(threads)))
        rates["threads"] = threads * len(SPEEDS) / (perf_counter() - began)
    return {"nodes": (n + 1) ** 3, "rates": rates} | found


def main(out: Path) -> None:
    rows = []
    for dof, n, step, hard, threads in SETTINGS:
        contacts = "" if hard else ", default contacts"
        row: dict[str, Any] = {"label": f"MuJoCo {mujoco.__version__}, {dof}{contacts}, {1e3 * step:g} ms"}
        try:
            row |= measured(dof, n, step, hard, threads)
        except (ValueError, ArithmeticError, mujoco.FatalError) as error:
            row |= {"failed": " ".join(str(error).split()) or type(error).__name__}
        rows.append(row)
        print(row, file=sys.stderr, flush=True)
    out.write_text(json.dumps(rows))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
