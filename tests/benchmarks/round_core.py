"""What cells that follow a sphere change: `python tests/benchmarks/round_core.py [--step 0.02]`.

stiff_inclusion by FEM alone, on equal cells, whose octants make up the core, and on hexahedra of a file that end at it:
a cube of m x m x m cells in the core, k cells from there to the sphere and j from the sphere to the block's faces along
each of six ways, m x m of them side by side. The sphere's corners are moved outwards until the flat-sided core has its
volume. Values are of the end of the last hold; CPU seconds without compiling.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from hexahedra import vtk

from softseam.chart.measure import measure
from softseam.variants import with_model, with_settings
from softseam_protocol.scene import Scene
from softseam_protocol.scene_file import load_scene

Floats = NDArray[np.float64]

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "stiff_inclusion.yaml"
RADIUS, HALF = 0.0125, 0.025
"""of the core; half the block's edge [m]"""
INNER = 0.55
"""half edge of the cube in the core, over the sphere's radius"""
QUANTITIES = ("grip_force", "sag", "core.von_mises", "beside.von_mises")
ACROSS = (4, 6, 8)
ROUND = ((2, 1, 1), (2, 1, 2), (3, 1, 2), (4, 2, 3))
"""m, k and j"""


def round_cells(m: int, k: int, j: int, radius: float) -> tuple[Floats, NDArray[np.int64], NDArray[np.bool_]]:
    """Points (n, 3) [m], corners (c, 8), and which cells are in the core (c,)."""
    at = np.linspace(-1.0, 1.0, m + 1)
    number: dict[tuple[int, ...], int] = {}
    points, cells, inside = list[Floats](), list[list[int]](), list[bool]()

    def node(p: Floats) -> int:
        key = tuple(np.rint(p * 1e9).astype(int).tolist())
        if key not in number:
            number[key] = len(points)
            points.append(p)
        return number[key]

    def brick(place: Callable[[int, int, int], Floats], depth: int, core: int) -> None:
        ids = [[[node(place(u, v, w)) for w in range(depth + 1)] for v in range(m + 1)] for u in range(m + 1)]
        for u, v, w in np.ndindex(m, m, depth):
            ring = ((u, v), (u + 1, v), (u + 1, v + 1), (u, v + 1))
            cells.append([ids[a][b][w] for a, b in ring] + [ids[a][b][w + 1] for a, b in ring])
            inside.append(w < core)

    brick(lambda u, v, w: INNER * radius * at[[u, v, w]], m, m)
    for axis, side in np.ndindex(3, 2):

        def place(u: int, v: int, w: int, axis: int = axis, side: int = side) -> Floats:
            cube = np.roll([(-1.0, 1.0)[side], *(at[[u, v]] if side else at[[v, u]])], axis)
            angle = np.roll([cube[axis], *np.tan(0.25 * np.pi * np.roll(cube, -axis)[1:])], axis)
            on = radius * angle / np.linalg.norm(angle)
            if w <= k:
                return np.asarray((1.0 - w / k) * INNER * radius * cube + w / k * on)
            return np.asarray(on + (w - k) / j * (HALF * cube - on))

        brick(place, k + j, k)
    return np.array(points), np.array(cells), np.array(inside)


def volume(points: Floats, corners: NDArray[np.int64]) -> float:
    """Of hexahedra, by two Gauss points an axis, which are exact [m^3]."""
    sides = np.array(
        [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
    )
    total = 0.0
    for q in np.ndindex(2, 2, 2):
        f = 1.0 + sides * (2.0 * np.array(q) - 1.0) / np.sqrt(3.0)
        slope = 0.125 * sides * np.stack([f[:, 1] * f[:, 2], f[:, 2] * f[:, 0], f[:, 0] * f[:, 1]], axis=1)
        total += float(np.linalg.det(np.einsum("cni,nk->cik", points[corners], slope)).sum())
    return total


def file_of(m: int, k: int, j: int) -> bytes:
    """The block, its core of the sphere's volume."""
    radius, wanted = RADIUS, 4.0 / 3.0 * np.pi * RADIUS**3
    for _ in range(20):
        points, cells, inside = round_cells(m, k, j, radius)
        radius *= (wanted / volume(points, cells[inside])) ** (1.0 / 3.0)
    return vtk(points + np.array([0.0, 0.0, HALF]), cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--step", type=float, default=0.02, help="[s]")
    parser.add_argument("--out", type=Path, default=Path("out/round-core"), help="where the cells are written")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    scene = with_model(load_scene(SCENE).scene, "fem")
    step = f"step={given.step}"
    runs: list[tuple[str, Scene | Path, list[str]]] = [
        (f"{n} x {n} x {n} equal", scene, [step, f"body.cell={2.0 * HALF / n}"]) for n in ACROSS
    ]
    print("| cells | grip [N] | sag [mm] | core [kPa] | beside [kPa] | CPU [s] |\n|---|---|---|---|---|---|")
    for m, k, j in ROUND:
        path = given.out / f"{m}-{k}-{j}.yaml"
        path.with_suffix(".vtk").write_bytes(file_of(m, k, j))
        own = f"body.shape={{kind: mesh, path: {m}-{k}-{j}.vtk, cells: own}}"
        path.write_text(with_settings(scene, [own, "body.cell=null"]).model_dump_json(exclude_none=True))
        runs.append((f"{m**3 + 6 * m * m * (k + j)} round", path, [step]))
    for label, which, settings in runs:
        outcome = measure(which, settings, QUANTITIES, runs=0, limit=300.0)
        if outcome.series is None:
            raise SystemExit(f"{label}: {outcome.reason}")
        grip, sag, core, beside = (float(outcome.series.values[name][-1]) for name in QUANTITIES)
        facts = f"{grip:.2f} | {1e3 * sag:.2f} | {1e-3 * core:.2f} | {1e-3 * beside:.2f} | {outcome.cpu:.1f}"
        print(f"| {label} | {facts} |", flush=True)


if __name__ == "__main__":
    main()
