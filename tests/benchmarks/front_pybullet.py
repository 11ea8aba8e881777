"""A tray of cubes by PyBullet's deformable world: forces, CPU time and shapes as JSON, for front_rivals.py to compare.

Runs in an environment of its own (`python -m benchmarks.front_pybullet TRAY.json OUT.json SETTING`), with pybullet and
numpy and nothing of softseam. The law is Bullet's, stable neo-Hookean, on five tetrahedra a cell. Fingers and floor are
boxes on sliding joints that motors drive or hold: their force is the motor's.

Bullet's constants are those of Smith, de Goes and Kim 2018, "Stable Neo-Hookean flesh simulation": made so that for
small strains Young's modulus and Poisson's ratio are the tray's. All nodes of a body weigh the same. The friction of
two bodies is the product of their coefficients. Elasticity is explicit, so steps are shorter than waves take through a
cell.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pybullet as bullet  # type: ignore[import-not-found]
from benchmarks.front_tray import Floats, Tray, ended, grid_of
from benchmarks.rival_clock import Clock

VOXEL = 0.01
"""of the signed distance of boxes [m]; Bullet's own, 0.25 m, is larger than all that is here"""
HEAVY = 1.0
"""mass of fingers and floor, on their joints [kg]"""
STRONG = 1e9
"""most that a motor may push [N]"""
GAIN = 0.1
"""share of its error of place that a motor takes back a step"""
CORNERS = (0, 1, 2, 4), (3, 1, 7, 2), (5, 1, 4, 7), (6, 2, 7, 4), (1, 2, 4, 7)
"""five tetrahedra of a cell by its corners, of which bit 0, 1 and 2 are x, y and z"""


def cube(edge: float, cells: int) -> tuple[Floats, Any]:
    """Points (p, 3) about the middle [m] and tetrahedra (t, 4), mirrored from cell to cell so that their faces meet."""
    at = np.arange(cells + 1)
    points = np.stack(np.meshgrid(at, at, at, indexing="ij"), axis=-1).reshape(-1, 3)
    low = points[(points < cells).all(axis=1)]
    bits = np.array([[corner >> axis & 1 for axis in range(3)] for corner in range(8)])
    corner = np.array(CORNERS)[None] ^ (low.sum(axis=1) % 2)[:, None, None]
    place = low[:, None, None, :] + bits[corner]
    tets = (place @ [(cells + 1) ** 2, cells + 1, 1]).reshape(-1, 4)
    x: Floats = np.asarray(points * (edge / cells) - 0.5 * edge, dtype=np.float64)
    inverted = np.linalg.det(x[tets[:, 1:]] - x[tets[:, :1]]) < 0.0
    tets[inverted] = tets[inverted][:, [1, 0, 2, 3]]
    return x, tets


def written(path: Path, points: Floats, tets: Any) -> None:
    """As the file that Bullet reads."""
    rows = [
        "# vtk DataFile Version 2.0\ncube\nASCII\nDATASET UNSTRUCTURED_GRID",
        f"POINTS {len(points)} double",
        *(" ".join(f"{each:.17g}" for each in point) for point in points),
        f"\nCELLS {len(tets)} {5 * len(tets)}",
        *(f"4 {' '.join(map(str, tet))}" for tet in tets),
        f"\nCELL_TYPES {len(tets)}",
        *["10"] * len(tets),
    ]
    path.write_text("\n".join(rows) + "\n")


def box(size: Sequence[float], place: Sequence[float], friction: float, axes: Sequence[Sequence[int]] = ()) -> int:
    """A box, of which motors move each axis that is given, or that stays."""
    shape, count = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[0.5 * each for each in size]), len(axes)
    if not axes:
        body = bullet.createMultiBody(0, shape, basePosition=place)
        bullet.changeDynamics(body, -1, lateralFriction=friction)
        return int(body)
    body = bullet.createMultiBody(
        0,
        -1,
        -1,
        place,
        linkMasses=[HEAVY] * count,
        linkCollisionShapeIndices=[*[-1] * (count - 1), shape],
        linkVisualShapeIndices=[-1] * count,
        linkPositions=[[0, 0, 0]] * count,
        linkOrientations=[[0, 0, 0, 1]] * count,
        linkInertialFramePositions=[[0, 0, 0]] * count,
        linkInertialFrameOrientations=[[0, 0, 0, 1]] * count,
        linkParentIndices=list(range(count)),
        linkJointTypes=[bullet.JOINT_PRISMATIC] * count,
        linkJointAxis=axes,
    )
    for link in range(count):
        bullet.changeDynamics(body, link, lateralFriction=friction, linearDamping=0, angularDamping=0, jointDamping=0)
    return int(body)


def drive(body: int, joint: int, place: float, speed: float) -> None:
    """By its motor, in the next step."""
    bullet.setJointMotorControl2(
        body,
        joint,
        bullet.POSITION_CONTROL,
        targetPosition=place,
        targetVelocity=speed,
        force=STRONG,
        positionGain=GAIN,
        velocityGain=1,
    )


class World:
    """The tray in PyBullet."""

    def __init__(self, tray: Tray, cells: int, step: float, margin: float, repulsion: float) -> None:
        self.tray = tray
        bullet.connect(bullet.DIRECT)
        bullet.resetSimulation(bullet.RESET_USE_DEFORMABLE_WORLD)
        bullet.setGravity(0, 0, -tray.gravity)
        bullet.setTimeStep(step)
        bullet.setPhysicsEngineParameter(sparseSdfVoxelSize=VOXEL)
        own = tray.material["friction"] ** 0.5
        size, friction = tray.finger["size"], tray.finger["friction"] / own
        self.floor = box((0.4, 0.4, 0.04), (0, 0, -0.02), tray.floor / own, [[0, 0, 1]]) if tray.gravity else None
        for wall in tray.walls:
            box(wall["size"], wall["position"], wall["friction"] / own)
        self.fingers = {name: box(size, way[0], friction, [[1, 0, 0], [0, 0, 1]]) for name, way in tray.ways.items()}
        young, poisson = tray.material["young"], tray.material["poisson"]
        shear = young / (2.0 * (1.0 + poisson))
        bulk = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
        with TemporaryDirectory() as folder:
            mesh = Path(folder) / "cube.vtk"
            written(mesh, *cube(tray.edge, cells))
            self.cubes = [
                bullet.loadSoftBody(
                    str(mesh),
                    basePosition=at,
                    scale=1,
                    mass=tray.mass,
                    useNeoHookean=1,
                    NeoHookeanMu=4.0 / 3.0 * shear,
                    NeoHookeanLambda=bulk + 5.0 / 6.0 * shear,
                    # of Bullet's own shear modulus, which is 4/3 of the real one
                    NeoHookeanDamping=0.75 * tray.material["damping"],
                    collisionMargin=margin,
                    frictionCoeff=own,
                    useSelfCollision=0,
                    repulsionStiffness=repulsion,
                )
                for at in tray.cubes
            ]
        for body, velocity in zip(self.cubes, tray.velocities, strict=True):
            if any(velocity):
                bullet.resetBaseVelocity(body, velocity)

    def shapes(self) -> Floats:
        """Places of all points (n, p, 3) [m]."""
        simulated = bullet.MESH_DATA_SIMULATION_MESH
        return np.array([bullet.getMeshData(each, -1, flags=simulated)[1] for each in self.cubes])

    def drive(self, now: float, then: float) -> None:
        """Fingers on their way, and hold the floor."""
        if self.floor is not None:
            drive(self.floor, 0, 0.0, 0.0)
        for name, body in self.fingers.items():
            at, to = self.tray.place(name, now), self.tray.place(name, then)
            way, speed = to - np.array(self.tray.ways[name][0]), (to - at) / (then - now)
            for joint, axis in enumerate((0, 2)):
                drive(body, joint, way[axis], speed[axis])

    def forces(self) -> list[float]:
        """Of the motors that hold the floor, less its weight, and push the fingers [N]."""
        floor = 0.0 if self.floor is None else bullet.getJointState(self.floor, 0)[3] - HEAVY * self.tray.gravity
        return [floor, *(bullet.getJointState(body, 0)[3] for body in self.fingers.values())]


def run(tray: Tray, cells: int, step: float, margin: float, repulsion: float, limit: float) -> dict[str, Any]:
    """What came of it."""
    world = World(tray, cells, step, margin, repulsion)
    rest = world.shapes()
    share = tray.mass / rest.shape[1]
    began = tray.mass * np.sum(tray.velocities, axis=0)
    clock, late, rows = Clock(), Clock(), []
    looks: dict[str, Any] = {}
    steps = round(tray.duration / step)
    before = x = rest
    for i in range(steps):
        then = (i + 1) * step
        world.drive(i * step, then)
        with late if then > tray.closes else clock:
            bullet.stepSimulation()
        look = tray.looked(then, step)
        if look or i % 50 == 0 or i >= steps - 2:
            before, x = x, world.shapes()
            if not np.isfinite(x).all() or np.abs(x).max() > 1.0:
                return {"stopped": f"diverged before {then:.2f} s"}
            if look:
                looks[look] = x.tolist()
        if tray.near_look(then):
            rows.append([then, *world.forces()])
        if clock.cpu + late.cpu > limit:
            return {"stopped": f"{i + 1} of {steps} steps took {clock.cpu + late.cpu:.0f} CPU s"}
    found = np.array(rows)
    forces = {name: found[:, 1 + at] for at, name in enumerate(("floor", "left", "right"))} if rows else {}
    # no velocity is given: places of the last step over those of the one before, which is what Bullet adds
    momentum = share * ((x - before) / step).sum(axis=(0, 1))
    time = found[:, 0] if rows else np.zeros(0)
    return ended(tray, grid_of(rest, len(tray.cubes)), looks, time, forces, (began, momentum), late.cpu)


def main(scene: Path, out: Path, setting: dict[str, Any]) -> None:
    try:
        found = run(Tray.read(scene), **setting)
    except (ValueError, ArithmeticError, bullet.error) as error:
        found = {"stopped": " ".join(str(error).split())[:200]}
    out.write_text(json.dumps({"version": f"PyBullet {version('pybullet')}"} | found))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), json.loads(sys.argv[3]))
