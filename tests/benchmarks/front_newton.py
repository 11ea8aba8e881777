"""A tray of cubes by Newton: forces, CPU time and shapes as JSON, for front_rivals.py to compare.

Runs in an environment of its own (`python -m benchmarks.front_newton TRAY.json OUT.json SETTING`) on the processor,
with newton, warp and numpy and nothing of softseam. Laws and masses are those of `rival_newton`. Either VBD has all
cubes, or the gripped one, and XPBD the others, by one of Newton's coupled solvers. VBD gives the forces of tools and
floor; coupled solvers give none: there the fingers' force is what the tetrahedra at a finger bear by VBD's law.

XPBD's bodies meet by spheres around their particles. Those of 4 mm are the smallest that no particle of a cube in 4^3
cells passes between; cubes are inset by as much, with mass and stiffness of the whole ones.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import newton  # type: ignore[import-not-found]
import numpy as np
import warp as wp  # type: ignore[import-not-found]
from benchmarks.front_tray import Floats, Tray, ended, grid_of
from benchmarks.rival_clock import Clock
from benchmarks.rival_newton import STIFF, lame
from newton.solvers.experimental.coupled import (  # type: ignore[import-not-found]
    SolverCoupledADMM,
    SolverCoupledProxy,
)

RADIUS, SPHERE = 1e-4, 4e-3
"""of a particle of VBD alone, and of one that XPBD meets [m]"""
BETWEEN, SEEN = 2e-4, 3e-4
"""distance at which VBD's bodies repel one another, and how much farther they are looked for [m]"""
RHO = 45.0
"""penalty of ADMM"""


class Cubes:
    """The tray in Newton, and which particles are the gripped cube's."""

    def __init__(self, tray: Tray, cells: int, coupled: bool) -> None:
        self.tray, self.radius = tray, SPHERE if coupled else RADIUS
        edge = tray.edge - 2.0 * (SPHERE if coupled else 0.0)
        scale = tray.edge / edge
        self.law = lame(scale * tray.material["young"], tray.material["poisson"])
        builder = newton.ModelBuilder(gravity=(0.0, 0.0, -tray.gravity))
        for at, velocity in zip(tray.cubes, tray.velocities, strict=True):
            lift = np.array([0.0, 0.0, 0.0 if coupled else RADIUS])
            builder.add_soft_grid(
                pos=wp.vec3(*(np.array(at) - 0.5 * edge + lift)),
                rot=wp.quat_identity(),
                vel=wp.vec3(*velocity),
                dim_x=cells,
                dim_y=cells,
                dim_z=cells,
                cell_x=edge / cells,
                cell_y=edge / cells,
                cell_z=edge / cells,
                density=1.0,
                k_mu=self.law[0],
                k_lambda=self.law[1],
                k_damp=0.0 if coupled else tray.material["damping"] * self.law[0],  # XPBD diverges by it
                particle_radius=self.radius,
            )
        # as in rival_newton: a tetrahedron's mass, shared by its four, for Newton gives each particle a whole cell's
        x, tets = np.array(builder.particle_q), np.array(builder.tet_indices).reshape(-1, 4)
        volume = np.linalg.det(x[tets[:, 1:]] - x[tets[:, :1]]) / 6.0
        density = tray.material["density"] * scale**3
        self.mass = np.bincount(tets.ravel(), np.repeat(0.25 * density * volume, 4), minlength=len(x))
        builder.particle_mass = self.mass.tolist()
        between = tray.material["friction"]
        # Newton takes the geometric mean of both frictions by VBD, the arithmetic one by XPBD
        floor = 2.0 * tray.floor - between if coupled else tray.floor**2 / between

        def touch(friction: float) -> Any:
            return newton.ModelBuilder.ShapeConfig(density=0.0, ke=STIFF, kd=0.0, mu=friction)

        self.floor = builder.add_ground_plane(cfg=touch(floor)) if tray.gravity else None
        for wall in tray.walls:
            half = [0.5 * each for each in wall["size"]]
            at = wp.transform(wp.vec3(*wall["position"]), wp.quat_identity())
            builder.add_shape_box(-1, xform=at, hx=half[0], hy=half[1], hz=half[2], cfg=touch(0.0))
        self.fingers: dict[str, tuple[int, int]] = {}
        for name, way in tray.ways.items():
            half = [0.5 * each for each in tray.finger["size"]]
            at = wp.transform(wp.vec3(*way[0]), wp.quat_identity())
            body = builder.add_body(xform=at, is_kinematic=True)
            cfg = touch(tray.finger["friction"] ** 2 / between)
            self.fingers[name] = body, builder.add_shape_box(body, hx=half[0], hy=half[1], hz=half[2], cfg=cfg)
        builder.color()
        self.model = model = builder.finalize()
        model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = STIFF, 0.0, between
        model.particle_mu = between
        self.each = len(x) // len(tray.cubes)
        self.gripped = np.arange(len(x) - self.each, len(x))
        self.tets = tets

    def solver(self, name: str, iterations: int) -> Any:
        """VBD for all, or coupled with XPBD."""

        def vbd(view: Any) -> Any:
            alone = {
                "particle_enable_self_contact": True,
                "particle_self_contact_margin": BETWEEN,
                "particle_self_contact_gap": SEEN,
            }
            return newton.solvers.SolverVBD(
                view,
                iterations=iterations,
                particle_enable_tile_solve=False,
                friction_epsilon=1e-3,
                **(alone if name == "VBD" else {}),
            )

        if name == "VBD":
            return vbd(self.model)
        own, others = self.gripped.tolist(), list(range(int(self.gripped[0])))
        of_others = int((self.tets < self.gripped[0]).all(axis=1).sum())

        def contact_only(view: Any) -> None:
            # XPBD sees the gripped cube's particles as proxies: their tetrahedra, the last, are VBD's alone
            view.tet_count = min(view.tet_count, of_others)

        entry: Callable[..., Any] = SolverCoupledProxy.Entry
        kind = name.split(", ")[1]
        entries = [
            entry(name="vbd", solver=vbd, particles=own, bodies=[body for body, _ in self.fingers.values()]),
            entry(
                name="xpbd",
                solver=lambda view: newton.solvers.SolverXPBD(view, iterations=2),
                particles=others,
                configure_view=None if kind == "ADMM" else contact_only,
            ),
        ]
        if kind == "ADMM":
            pair = SolverCoupledADMM.ContactPair(source="vbd", destination="xpbd")
            config = SolverCoupledADMM.Config(iterations=5, rho=RHO, contact_pairs=[pair])
            return SolverCoupledADMM(model=self.model, entries=entries, coupling=config)
        proxy = SolverCoupledProxy.Proxy(source="vbd", destination="xpbd", particles=own, mode=kind)
        return SolverCoupledProxy(
            model=self.model, entries=entries, coupling=SolverCoupledProxy.Config(proxies=[proxy], iterations=1)
        )

    def borne(self, x: Floats, acceleration: Floats, rest: Floats) -> list[float]:
        """Forces of the fingers on the nodes of their faces, from the law [N]: mass times acceleration less elastic
        force."""
        tets = self.tets[(self.tets >= self.gripped[0]).all(axis=1)]
        inverse = np.linalg.inv(np.stack([rest[tets[:, k]] - rest[tets[:, 0]] for k in (1, 2, 3)], axis=2))
        f = np.stack([x[tets[:, k]] - x[tets[:, 0]] for k in (1, 2, 3)], axis=2) @ inverse
        det = np.linalg.det(f)
        cofactor = det[:, None, None] * np.linalg.inv(f).transpose(0, 2, 1)
        mu, bulk = self.law
        stress = mu * f + ((mu + bulk) * (det - 1.0) - mu)[:, None, None] * cofactor
        pulls = -(1.0 / (6.0 * np.linalg.det(inverse)))[:, None, None] * stress @ inverse.transpose(0, 2, 1)
        force = np.zeros_like(x)
        for k in (1, 2, 3):
            np.add.at(force, tets[:, k], pulls[:, :, k - 1])
        np.add.at(force, tets[:, 0], -pulls.sum(axis=2))
        own = rest[self.gripped, 0]
        faces = [self.gripped[np.abs(own - end) < 1e-5] for end in (own.min(), own.max())]
        return [float((self.mass[face] * acceleration[face, 0] - force[face, 0]).sum()) for face in faces]


def run(tray: Tray, solver: str, cells: int, step: float, iterations: int, limit: float) -> dict[str, Any]:
    """What came of it."""
    cubes = Cubes(tray, cells, coupled=solver != "VBD")
    model, by = cubes.model, cubes.solver(solver, iterations)
    pipeline = newton.CollisionPipeline(model, soft_contact_gap=2e-3)
    contacts = pipeline.contacts()
    given = by.observables({"contact_f"}, contacts=contacts) if solver == "VBD" else None
    state, after = model.state(), model.state()
    poses = model.body_q.numpy() if cubes.fingers else None
    rest = state.particle_q.numpy().astype(float)
    began = cubes.mass @ state.particle_qd.numpy()
    clock, late, rows = Clock(), Clock(), []
    looks: dict[str, Any] = {}
    steps = round(tray.duration / step)
    velocity = state.particle_qd.numpy().astype(float)
    for i in range(steps):
        then = (i + 1) * step
        if poses is not None:
            pose, speed = poses.copy(), np.zeros((len(poses), 6), dtype=np.float32)
            for name, (body, _) in cubes.fingers.items():
                at = tray.place(name, then)
                pose[body, :3] = at
                speed[body, :3] = (at - tray.place(name, i * step)) / step
            state.body_q.assign(pose)
            state.body_qd.assign(speed)
        # the first step compiles
        with late if then > tray.closes and i else clock if i else Clock():
            state.clear_forces()
            pipeline.collide(state, contacts)
            if given is None:
                by.step(state, after, None, contacts, step)
            else:
                by.step(state, after, None, contacts, step, observables=given)
        state, after = after, state
        look, before = tray.looked(then, step), velocity
        if look or tray.near_look(then + step) or i % 50 == 0:
            x, velocity = state.particle_q.numpy().astype(float), state.particle_qd.numpy().astype(float)
            if not np.isfinite(x).all() or np.abs(x).max() > 10.0:
                return {"stopped": f"diverged before {then:.2f} s"}
            if look:
                looks[look] = x.reshape(len(tray.cubes), -1, 3).tolist()
            if tray.near_look(then):
                rows.append([then, *_forces(cubes, contacts, given, x, (velocity - before) / step, rest)])
        if clock.cpu + late.cpu > limit:
            return {"stopped": f"{i + 1} of {steps} steps took {clock.cpu + late.cpu:.0f} CPU s"}
    found = np.array(rows)
    forces = {"floor": found[:, 1], "left": found[:, 2], "right": found[:, 3]} if rows else {}
    if solver != "VBD":
        forces.pop("floor", None)
    momenta = began, cubes.mass @ state.particle_qd.numpy()
    time = found[:, 0] if rows else np.zeros(0)
    return ended(tray, grid_of(rest, len(tray.cubes)), looks, time, forces, momenta, late.cpu)


def _forces(cubes: Cubes, contacts: Any, given: Any, x: Floats, acceleration: Floats, rest: Floats) -> list[float]:
    """Of the floor, 0 where it is not given, and of each finger [N]."""
    if given is None:
        return [0.0, *cubes.borne(x, acceleration, rest)]
    count = int(contacts.soft_contact_count.numpy()[0])
    on = contacts.soft_contact_shape.numpy()[:count]
    push = given.contact_f.numpy()[contacts.rigid_contact_max :][:count]
    fingers = (float(push[on == shape, 0].sum()) for _, shape in cubes.fingers.values())
    return [float(push[on == cubes.floor, 2].sum()), *fingers]


def main(scene: Path, out: Path, setting: dict[str, Any]) -> None:
    wp.config.quiet = True
    wp.set_device("cpu")
    try:
        found = run(Tray.read(scene), **setting)
    except (ValueError, ArithmeticError, RuntimeError) as error:
        found = {"stopped": " ".join(str(error).split())[:200]}
    out.write_text(json.dumps({"version": f"Newton {newton.__version__}"} | found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), json.loads(sys.argv[3]))
