"""Many pieces at once as people see them, and how they are copied: what `BatchEnv` has beside its episodes."""

from abc import abstractmethod
from typing import Any, Literal

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from softseam.errors import BadInput
from softseam.gym.picture import Image, Picture, Pose
from softseam.gym.show import Window, tiled, warn_of_none
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.recording import SurfaceMesh
from softseam_protocol.scene.scene import Scene

Numbers = NDArray[np.float32]
Device = Literal["cpu", "cuda"]


class ShownBatch(VectorEnv[Numbers, Numbers, Any]):
    """Draws and copies what a subclass simulates in a batch."""

    scene: Scene
    _batch: Any
    _opened: tuple[int, Device]
    """what the batch was opened with"""
    _over: NDArray[np.bool_] | None = None
    """episodes that ended with the last step; None before the first reset"""
    _picture: Picture | None = None
    _window: Window | None = None

    @abstractmethod
    def _open(self, threads: int, device: Device) -> Any:
        """A batch of such pieces."""

    def render(self) -> tuple[Image, ...] | None:
        """A picture (360, 480, 3) of each piece, where `render_mode` is "rgb_array"; "human" shows four in a window."""
        if self.render_mode == "rgb_array":
            return tuple(self._drawn(i) for i in range(self.num_envs))
        if self.render_mode is None:
            warn_of_none(self)
            return None
        self._window = self._window or Window(self.scene.name)
        self._window.show(tiled([self._drawn(i) for i in range(min(self.num_envs, 4))]))
        return None

    def close_extras(self, **kwargs: Any) -> None:
        self._batch.close()
        if self._window is not None:
            self._window.close()

    def __getstate__(self) -> dict[str, Any]:
        """All but the batch, of which the pieces are kept, and what is shown: for `copy.deepcopy` and `pickle`."""
        state = vars(self) | {"_batch": None, "_picture": None, "_window": None}
        return state | {"_pieces": [self._batch.snapshot(i) for i in range(self.num_envs)]}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Open another batch, which goes on from there with the same bits."""
        pieces = state.pop("_pieces")
        vars(self).update(state)
        self._batch = self._open(*self._opened)
        for i, piece in enumerate(pieces):
            self._batch.restore(i, piece)

    def _show(self) -> None:
        if self.render_mode == "human":
            self.render()

    def _drawn(self, index: int) -> Image:
        if self._over is None:
            raise BadInput("no episode has begun: call reset()")
        if self._picture is None:
            structure = self._batch.structure
            self._picture = Picture(self.scene, {"body": block_surface(structure.nodes, structure.x_rest)})
        poses = [
            Pose(*(each.astype(np.float64) for each in pose)) for pose in zip(*self._batch.poses(index), strict=True)
        ]
        return self._picture.draw({"body": self._batch.places(index).astype(np.float64)}, poses)


_FACES = np.array([[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]])
"""corners around each face; corner i of a block is at x = i & 1, y = i >> 1 & 1, z = i >> 2"""


def block_surface(nodes: NDArray[np.int32], rest: NDArray[np.float64]) -> SurfaceMesh:
    """Two triangles for each face that only one block has; its points are the nodes.

    nodes  corners of the blocks (b, 8)
    rest   places of the nodes (n, 3) [m]
    """
    faces = nodes[:, _FACES].reshape(-1, 4)
    middles = np.repeat(rest[nodes].mean(axis=1), len(_FACES), axis=0)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = np.sort(first[count == 1])
    faces, middles = faces[outer], middles[outer]
    a, b, c = (rest[faces[:, i]] for i in range(3))
    inwards = np.einsum("fi,fi->f", np.cross(b - a, c - a), a - middles) < 0.0
    faces = np.where(inwards[:, None], faces[:, ::-1], faces)
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]).astype(np.int32)
    header, none = Header(SCHEMA_VERSION, "local", "", 0, 0, 0, 0.0), np.zeros((0, 3))
    return SurfaceMesh(header, "body", rest, triangles, none, np.ones(3), np.zeros((0, 8)), {})
