"""The sibling of a scene: the same motion of the same bodies, by FEM, on cells and with steps twice as long.

Of an odd number of cells along an axis it has the smaller half. It errs by more than the run that it belongs to, so
the difference of the two shows the run's error: of one of order p in cells and step, E(h) = C h^p, they differ by

    E(2h) - E(h) = (2^p - 1) E(h)                                                                                  (1)

A body with one cell along each axis has no longer ones: its sibling has cells and steps half as long, and

    E(h) - E(h/2) = (1 - 2^-p) E(h)                                                                                (2)

Runs by XPBD, or by both models, have a sibling of FEM alone, so that the model's error is in the difference, too.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam.duration import fem_step, xpbd_step
from softseam.variants import AS_GIVEN, changed, refusal
from softseam_protocol.messages.session import Frame
from softseam_protocol.models import NEAR_DEFAULT, REFERENCE, ModelKind
from softseam_protocol.nearest_axes import nearest_axes
from softseam_protocol.scene.bodies import BlockShape, BodySpec, MeshShape
from softseam_protocol.scene.consistency import implied_model
from softseam_protocol.scene.file import SceneError
from softseam_protocol.scene.scene import Scene

Floats = NDArray[np.float64]

LONGER = 2.0
"""how many times as long as the run's its cells and steps are [1]"""
BOTH = 2.0
"""what a step of both models takes over one of FEM alone, roughly [1]"""
_ROUNDING = 1e-6
"""cosine of an angle that counts as a right one, and of the body's extent what nodes of two planes are apart [1]"""
LARGEST_SHARE = 0.4
"""of the run's time that a sibling may take unasked [1]"""


class NoSibling(Exception):
    """Why a scene has none, for people."""


@dataclass(frozen=True)
class Sibling:
    """What a scene's sibling is."""

    scene: Scene
    settings: tuple[str, ...]
    """that make it of the run's scene"""
    finer: bool
    """whether its cells and steps are half as long, for there are no longer cells"""
    share: float
    """of the run's processor time that it is foreseen to take, by the numbers of cells and steps [1]"""
    cell: float = 0.0
    """longest edge of the run's cells [m]"""


def sibling_of(scene: Scene, frames: Mapping[str, Frame]) -> Sibling:
    """The sibling of a scene as it is run; frames: of its bodies at rest. Raises NoSibling."""
    bodies = {name: it for name, body in scene.bodies.items() if (it := body.in_cells) is not None}
    if len(bodies) < len(scene.bodies):
        raise NoSibling("bodies of particles have no cells to compare with longer ones")
    edges = {name: cell_edges(body, frames[name]) for name, body in bodies.items()}
    counts = {name: _counts(body, frames[name], edges[name]) for name, body in bodies.items()}
    finer = all(bool((count == 1).all()) for count in counts.values())
    factor = 1.0 / LONGER if finer else LONGER
    settings = [f"step={factor * scene.step:.12g}"]
    if scene.symmetry:
        settings.append("symmetry=[]")  # a plane of it may cut longer cells
    before = after = 0.0
    for name in bodies:
        fewer = np.maximum(1.0, np.floor(counts[name] / factor))
        n_cells = len(frames[name].cell_near)
        regions = scene.of(name).regions
        if regions.cut:
            before += BOTH * fem_step(n_cells)
        elif _model(scene.of(name), bodies[name]) == REFERENCE:
            before += fem_step(n_cells * 0.5 ** len(scene.symmetry))
        else:
            before += xpbd_step(n_cells, scene.step)
        after += fem_step(n_cells * float(np.prod(fewer / counts[name])))
        own, cells = ("", "body") if scene.one is not None else (f"bodies.{name}.", f"bodies.{name}")
        wanted = ", ".join(f"{edge:.12g}" for edge in edges[name] * counts[name] / fewer)
        settings += [f"{own}regions={{default: fem}}", f"{cells}.cell=[{wanted}]"]
    try:
        other = changed(scene, (*AS_GIVEN, *settings))
    except SceneError as error:
        how = "half" if finer else "twice"
        raise NoSibling(f"with cells and steps {how} as long the scene would be wrong: {refusal(error)}") from None
    longest = max(float(each.max()) for each in edges.values())
    return Sibling(other, tuple(settings), finer, after / before / factor, longest)


def _model(scene: Scene, body: BodySpec) -> ModelKind:
    """Model of a body that is not cut: where the scene leaves that open, the one that it gets unless it is large."""
    implied = implied_model(body, scene.models, scene.symmetry)
    return scene.regions.default or (implied[0] if implied else NEAR_DEFAULT)


def cell_edges(body: BodySpec, frame: Frame) -> Floats:
    """Edges of a body's cells along x, y and z (3,) [m]. Raises NoSibling where they have none of their own."""
    if isinstance(body.shape, BlockShape) and (body.cell is not None or body.shape.borders == "materials"):
        size = np.array(body.shape.size)
        wanted = np.cbrt(size.prod() / len(frame.cell_near)) if body.cell is None else np.broadcast_to(body.cell, 3)
        return np.asarray(size / np.maximum(1, np.rint(size / wanted)))
    if isinstance(body.shape, MeshShape) and body.shape.cells != "boxes":
        raise NoSibling("the mesh brings its own cells: body.shape.cells: boxes lets its solid lie in longer ones")
    # nodes are half an edge apart, in the mean
    at = np.sort(_along_axes(body, frame), axis=0)
    extent = at[-1] - at[0]
    planes = 1 + (np.diff(at, axis=0) > _ROUNDING * extent).sum(axis=0)
    return np.asarray(2.0 * extent / (planes - 1))


def _counts(body: BodySpec, frame: Frame, edges: Floats) -> Floats:
    """Cells along x, y and z, or along the axes next to these where a mesh's lie turned (3,)."""
    return np.asarray(np.rint(np.ptp(_along_axes(body, frame), axis=0) / edges))


def _along_axes(body: BodySpec, frame: Frame) -> Floats:
    """Where nodes are along x, y and z, of a mesh along the axes of its lattice, the one next to x first (N, 3) [m].

    Of all ways from a node to another that are orthogonal to the shortest, and then to both, the shortest is along an
    axis.
    """
    if isinstance(body.shape, BlockShape):
        return frame.x
    away = frame.x[1:] - frame.x[0]
    found: list[Floats] = []
    for _ in range(3):
        length = np.linalg.norm(away, axis=1)
        shortest = int(np.argmin(length))
        found.append(away[shortest] / length[shortest])
        away = away[np.abs(away @ found[-1]) < _ROUNDING * length]
    axes = np.array(found).T
    return np.asarray(frame.x @ axes[:, nearest_axes(axes)])
