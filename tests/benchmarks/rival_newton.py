"""Newton's soft bodies on the cantilever and on the grasp: curves and times as JSON, for rivals.py to compare.

Runs in an environment of its own (`python -m benchmarks.rival_newton OUT.json SCENE ...`) on the processor, with
newton, warp and numpy and nothing of softseam. Gravity, sizes, constants, friction and motion are those of
scenes/cantilever.yaml and scenes/tofu_grasp.yaml. VBD's law is W = mu/2 (tr C - 3) - mu (J - 1) + (lambda + mu)/2
(J - 1)^2 (Smith et al. 2018) on linear tetrahedra, five a cell, which has the scene's Young's modulus at rest; XPBD's
constraints are tr C - 3 and J - 1, which leave a body at rest without stiffness in shear. VBD tells its contact forces;
of XPBD they are what the tetrahedra at a plate would bear by VBD's law.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import newton  # type: ignore[import-not-found]
import numpy as np
import warp as wp  # type: ignore[import-not-found]
from benchmarks.rival_clock import Clock, timed

STIFF = 1e4
"""of a contact [N/m]: plates sink 0.02 mm into the cube of 8 x 8 x 8 cells"""
RADIUS = 1e-4
"""of a particle, its distance from what it touches [m]"""

# solver, cells along the beam, step [s], iterations
BEAMS = (("VBD", 8, 0.002, 10), ("VBD", 16, 0.002, 40), ("XPBD", 8, 0.001, 2), ("XPBD", 8, 0.0005, 2))
# solver, cells along an edge, step [s], iterations
CUBES = (("VBD", 4, 0.002, 10), ("VBD", 8, 0.002, 10), ("XPBD", 4, 0.001, 4), ("XPBD", 4, 0.0005, 2))


def lame(young: float, poisson: float) -> tuple[float, float]:
    """mu and lambda [Pa]."""
    return young / (2.0 * (1.0 + poisson)), young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))


def grid(
    size: tuple[float, float, float], cells: tuple[int, int, int], corner: Any, density: float, law: Any, fixed: bool
) -> Any:
    """A builder with a block of tetrahedra in it."""
    builder = newton.ModelBuilder()
    edges = [edge / count for edge, count in zip(size, cells, strict=True)]
    builder.add_soft_grid(
        pos=wp.vec3(*corner),
        rot=wp.quat_identity(),
        vel=wp.vec3(0.0, 0.0, 0.0),
        dim_x=cells[0],
        dim_y=cells[1],
        dim_z=cells[2],
        cell_x=edges[0],
        cell_y=edges[1],
        cell_z=edges[2],
        density=density,
        k_mu=law[0],
        k_lambda=law[1],
        k_damp=0.0,
        fix_left=fixed,
        particle_radius=RADIUS,
    )
    # Newton gives every particle the mass of a whole cell, too much at the surface: a tetrahedron's, shared by its four
    x, tets = np.array(builder.particle_q), np.array(builder.tet_indices).reshape(-1, 4)
    volume = np.linalg.det(x[tets[:, 1:]] - x[tets[:, :1]]) / 6.0
    mass = np.bincount(tets.ravel(), np.repeat(0.25 * density * volume, 4), minlength=len(x))
    held = np.array(builder.particle_mass) == 0.0
    builder.particle_mass = np.where(held, 0.0, mass).tolist()
    return builder


def solver_of(name: str, model: Any, iterations: int) -> Any:
    if name == "VBD":
        return newton.solvers.SolverVBD(
            model, iterations=iterations, particle_enable_tile_solve=False, friction_epsilon=1e-3
        )
    return newton.solvers.SolverXPBD(model, iterations=iterations)


def titled(name: str, cells: tuple[int, int, int], step: float, iterations: int) -> str:
    counts = "x".join(map(str, cells))
    return f"Newton {name} {counts}, {1e3 * step:g} ms, {iterations} iterations"


def beam(name: str, along: int, step: float, iterations: int) -> dict[str, Any]:
    """Scene cantilever: tip deflection over time."""
    cells = (along, along // 4, along // 4)
    builder = grid((0.2, 0.05, 0.05), cells, (0.0, -0.025, 0.1), 1000.0, lame(100e3, 0.40), fixed=True)
    builder.color()
    model = builder.finalize()
    solver = solver_of(name, model, iterations)

    def run(length: float = 0.6) -> tuple[dict[str, list[float]], Clock]:
        state, after = model.state(), model.state()
        rest = state.particle_q.numpy().copy()
        tip = int(np.argmin(np.linalg.norm(rest - [0.2, 0.0, 0.125], axis=1)))
        clock, time, deflection = Clock(), [0.0], [0.0]
        for i in range(round(length / step)):
            with clock:
                state.clear_forces()
                solver.step(state, after, None, None, step)
            state, after = after, state
            time.append((i + 1) * step)
            deflection.append(float(state.particle_q.numpy()[tip, 2] - rest[tip, 2]))
        return {"time": time, "tip_deflection": finite(deflection)}, clock

    run(2 * step)  # compiles
    return {"scene": "cantilever", "label": titled(name, cells, step, iterations), "simulated": 0.6} | timed(run)


def cube(name: str, n: int, step: float, iterations: int) -> dict[str, Any]:
    """Scene tofu_grasp: grip force, lift and sag over time."""
    law = lame(20e3, 0.45)
    builder = grid((0.05, 0.05, 0.05), (n, n, n), (-0.025, -0.025, RADIUS), 1050.0, law, fixed=False)
    touch = newton.ModelBuilder.ShapeConfig(density=0.0, ke=STIFF, kd=0.0, mu=0.6)
    builder.add_ground_plane(cfg=touch)
    plates, shapes = [], []
    for x in (-0.0431, 0.0431):
        plates.append(builder.add_body(xform=wp.transform((x, 0.0, 0.029), wp.quat_identity()), is_kinematic=True))
        shapes.append(builder.add_shape_box(plates[-1], hx=0.005, hy=0.03, hz=0.03, cfg=touch))
    builder.color()
    model = builder.finalize()
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = STIFF, 0.0, 0.6
    pipeline = newton.CollisionPipeline(model, soft_contact_gap=2e-3)
    solver = solver_of(name, model, iterations)
    closing = (0.0431 - 0.005 - 0.5 * 0.85 * 0.05) / 0.02
    ends = np.cumsum([0.3, closing, 0.3, 1.0, 0.3])
    poses = model.body_q.numpy()
    tets, inverse = model.tet_indices.numpy(), model.tet_poses.numpy()
    mass = 1.0 / model.particle_inv_mass.numpy()

    def wanted(time: float) -> tuple[float, float, float, float]:
        """Way and speed of a plate, inwards and up."""
        near = float(np.clip(time - ends[0], 0.0, closing))
        up = float(np.clip(time - ends[2], 0.0, 1.0))
        return 0.02 * near, 0.02 * (0.0 < near < closing), 0.05 * up, 0.05 * (0.0 < up < 1.0)

    def borne(x: Any, acceleration: Any, face: Any) -> float:
        """Force of a plate on the nodes of its face, from the law [N]: mass times acceleration less elastic force."""
        edges = np.stack([x[tets[:, k]] - x[tets[:, 0]] for k in (1, 2, 3)], axis=2)
        f = edges @ inverse
        det = np.linalg.det(f)
        cofactor = det[:, None, None] * np.linalg.inv(f).transpose(0, 2, 1)
        stress = law[0] * f + ((law[0] + law[1]) * (det - 1.0) - law[0])[:, None, None] * cofactor
        volume = 1.0 / (6.0 * np.linalg.det(inverse))
        pulls = -volume[:, None, None] * stress @ inverse.transpose(0, 2, 1)
        force = np.zeros_like(x)
        for k in (1, 2, 3):
            np.add.at(force, tets[:, k], pulls[:, :, k - 1])
        np.add.at(force, tets[:, 0], -pulls.sum(axis=2))
        return float((mass[face] * acceleration[face, 0] - force[face, 0]).sum())

    def run(length: float = float(ends[-1])) -> tuple[dict[str, list[float]], Clock]:
        state, after = model.state(), model.state()
        contacts = pipeline.contacts()
        told = solver.observables({"contact_f"}, contacts=contacts) if name == "VBD" else None
        rest = state.particle_q.numpy().astype(float)
        faces = [np.flatnonzero(np.abs(rest[:, 0] - x) < 1e-6) for x in (-0.025, 0.025)]
        height, clock = float(np.ptp(rest[:, 2])), Clock()
        curves: dict[str, list[float]] = {"time": [0.0], "grip_force": [0.0], "lift_height": [0.0], "sag": [0.0]}
        velocity = np.zeros_like(rest)
        for i in range(round(length / step)):
            near, closing_speed, up, rising = wanted((i + 1) * step)
            pose, speed = poses.copy(), np.zeros((len(poses), 6), dtype=np.float32)
            for sign, plate in zip((1.0, -1.0), plates, strict=True):
                pose[plate, :3] += [sign * near, 0.0, up]
                speed[plate, :3] = [sign * closing_speed, 0.0, rising]
            state.body_q.assign(pose)
            state.body_qd.assign(speed)
            with clock:
                state.clear_forces()
                pipeline.collide(state, contacts)
                if told is None:
                    solver.step(state, after, None, contacts, step)
                else:
                    solver.step(state, after, None, contacts, step, observables=told)
            state, after = after, state
            x, before = state.particle_q.numpy().astype(float), velocity
            velocity = state.particle_qd.numpy().astype(float)
            if told is None:
                force = [borne(x, (velocity - before) / step, face) for face in faces]
            else:
                count = int(contacts.soft_contact_count.numpy()[0])
                on = contacts.soft_contact_shape.numpy()[:count]
                push = told.contact_f.numpy()[contacts.rigid_contact_max :][:count]
                force = [float(push[on == shape, 0].sum()) for shape in shapes]
            curves["time"].append((i + 1) * step)
            curves["grip_force"].append(0.5 * (abs(force[0]) + abs(force[1])))
            curves["lift_height"].append(float((x - rest)[:, 2].mean()))
            curves["sag"].append(height - float(np.ptp(x[:, 2])))
        # as softseam does: the rise since the lift began
        lifted = min(int(np.searchsorted(curves["time"], ends[2])), len(curves["time"]) - 1)
        start = curves["lift_height"][lifted]
        curves["lift_height"] = [h - start if i >= lifted else 0.0 for i, h in enumerate(curves["lift_height"])]
        return {key: finite(values) for key, values in curves.items()}, clock

    run(2 * step)  # compiles
    label = titled(name, (n, n, n), step, iterations)
    return {"scene": "tofu_grasp", "label": label, "simulated": float(ends[-1])} | timed(run)


def finite(values: list[float]) -> list[float]:
    """The same values. Raises ArithmeticError where the run diverged."""
    if not np.isfinite(values).all() or np.abs(values).max() > 1e6:
        raise ArithmeticError("diverged")
    return values


def main(out: Path, scenes: list[str]) -> None:
    wp.config.quiet = True
    wp.set_device("cpu")
    found: list[dict[str, Any]] = []
    for scene, make, settings in (("cantilever", beam, BEAMS), ("tofu_grasp", cube, CUBES)):
        for given in settings if scene in scenes else ():
            try:
                row = make(*given)
            except (ValueError, ArithmeticError, RuntimeError) as error:
                row = {"scene": scene, "label": f"{make.__name__} {given}", "failed": str(error)}
            row["version"] = f"Newton {newton.__version__}"
            found.append(row)
            sys.stderr.write(f"{row['label']}: {row.get('failed') or row['simulated'] / row['cpu']}\n")
    out.write_text(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
