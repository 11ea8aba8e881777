"""What a depth camera sees of an environment, beside what its agent sees: a depth and a label for each pixel."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict, Space
from numpy.typing import ArrayLike, NDArray

from softseam.errors import BadInput, NotReset, missing_extra
from softseam.given import whole
from softseam.gym.picture import FILL
from softseam.gym.scene_env import SceneEnv
from softseam.observation import Observation
from softseam.view import raster
from softseam.view.tool_shapes import PLANE_EXTENTS, ToolShape, rotate, tool_shapes

try:
    from softseam.view.rays import cast
except ModuleNotFoundError as error:
    raise missing_extra(error, "softseam.gym.Camera") from error

Floats = NDArray[np.float64]
Seen = dict[str, NDArray[Any]]

_FROM = np.array([[0.50, -0.87, 0.60], [0.87, -0.50, 0.60], [0.15, -0.26, 1.00]])
"""directions from the body to a camera that is not placed: right, front, above"""
_AWAY = 6.0
"""its distance in longest edges of the body"""


class Camera(gymnasium.ObservationWrapper[Seen, Any, Any]):
    """An environment whose agent also sees a picture: how far each pixel is, and what it shows.

    What is seen becomes {"seen": what it was, "depth": (height, width), "mask": (height, width)}; of an environment
    that shows several things already (`PointCloud`) these two join them. Depth is the distance along the camera's axis
    [m], `far` where there is nothing nearer. Mask is 0 there, and elsewhere the place of what is seen in `names`,
    counted from 1. Rows are from above, z is up. The same state gives the same bits.

    height, width  of the picture in pixels; these are square
    eye, target    where the camera is, and what it looks at (3,) [m]; without them it looks at the body as each
                   episode begins, over half of the picture, from the front, the right or above, whence tools hide least
    fov            vertical angle of view [degrees]
    far            the largest depth [m]

    A plane is seen as far as `far`, round tools as 48 flat sides. The simulation runs in this process.
    Raises BadInput for what is no environment of a scene, and for numbers that are none of a picture.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        height: int = 64,
        width: int = 64,
        *,
        eye: ArrayLike | None = None,
        target: ArrayLike | None = None,
        fov: float = 26.0,
        far: float = 5.0,
    ) -> None:
        for name, value in (("height", height), ("width", width)):
            if (whole(value) or 0) < 1:
                raise BadInput(f"{name}={value!r}: give a whole number of pixels, 1 or more")
        if not 0.0 < fov < 180.0:
            raise BadInput(f"fov={fov!r}: give an angle between 0 and 180 degrees")
        if not 0.0 < far < np.inf:
            raise BadInput(f"far={far!r}: give a distance [m] above 0")
        super().__init__(env)
        if not isinstance(env.unwrapped, SceneEnv):
            raise BadInput(f"{type(env.unwrapped).__name__} is no environment of a scene: it has nothing to see")
        self._inner, self._scene_env = env, env.unwrapped
        self._height, self._width, self._fov, self._far = height, width, fov, far
        self._placed = _placed(eye, target, fov)
        scene = self._scene_env.scene
        self.names = (*scene.bodies, *scene.tools)
        """what labels of the mask stand for: bodies, then tools"""
        inner = env.observation_space
        self._joins = isinstance(inner, Dict)
        spaces: dict[str, Space[Any]] = dict(inner.spaces) if isinstance(inner, Dict) else {"seen": inner}
        spaces["depth"] = Box(0.0, far, (height, width), np.float32)
        spaces["mask"] = Box(0, max(len(self.names), 1), (height, width), np.min_scalar_type(len(self.names)))
        self.observation_space: Space[Any] = Dict(spaces)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        seen, info = self._inner.reset(seed=seed, options=options)
        session = self._scene_env.session
        meshes = session.surface_meshes()
        self._triangles = {name: meshes[name].triangles.astype(np.int64) for name in session.scene.bodies}
        of_tools = {name: tool for mesh in meshes.values() for name, tool in mesh.tools.items()}
        # a plane is a square: one that reaches `far` to all sides
        shapes = {shape.name: shape for shape in tool_shapes(session.scene, 2.0 * self._far / PLANE_EXTENTS, of_tools)}
        self._tools = [shapes[name] for name in self._scene_env.scene.tools]
        self._camera = self._placed or max(self._fitted(session.last), key=lambda one: self._shown(session.last, one))
        self._picture = self._taken(session.last)
        return self.observation(seen), info

    def observation(self, observation: Any) -> Seen:
        try:
            self._picture = self._taken(self._scene_env.session.last)
        except NotReset:  # the simulation failed: the picture that was taken last
            pass
        return {**(observation if self._joins else {"seen": observation}), **self._picture}

    def _cast(self, observation: Observation, camera: raster.Camera) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        bodies = [(observation.frames[name].point_x, triangles) for name, triangles in self._triangles.items()]
        tools = [_posed(shape, observation) for shape in self._tools]
        return cast(camera, self._height, self._width, [*bodies, *tools])

    def _taken(self, observation: Observation) -> Seen:
        depth, which = self._cast(observation, self._camera)
        mask = np.where(depth < self._far, which + 1, 0)
        kind = self.observation_space["mask"].dtype  # type: ignore[index]  # it is a Dict
        return {"depth": np.minimum(depth, np.float32(self._far)), "mask": mask.astype(kind)}

    def _fitted(self, observation: Observation) -> list[raster.Camera]:
        """Cameras that look at the bodies."""
        points = np.concatenate([frame.point_x for frame in observation.frames.values()])
        low, high = points.min(axis=0), points.max(axis=0)
        middle, away = 0.5 * (low + high), _AWAY * float((high - low).max())
        cameras = [raster.Camera(middle + away * each, middle, self._fov) for each in _FROM]
        return [each.fitted(points, self._width, self._height, FILL) for each in cameras]

    def _shown(self, observation: Observation, camera: raster.Camera) -> int:
        """Pixels of bodies."""
        _, which = self._cast(observation, camera)
        return int(((which >= 0) & (which < len(self._triangles))).sum())


def _posed(shape: ToolShape, observation: Observation) -> tuple[Floats, NDArray[np.int64]]:
    """A tool's corners where it is [m], and its triangles."""
    tool = observation.tools[shape.name]
    return rotate(tool.orientation, shape.vertices) + tool.position, shape.triangles


def _placed(eye: ArrayLike | None, target: ArrayLike | None, fov: float) -> raster.Camera | None:
    """The camera that is given, None where none is. Raises BadInput."""
    if eye is None and target is None:
        return None
    at, towards = _place("eye", eye), _place("target", target)
    if np.array_equal(at, towards):
        raise BadInput(f"eye={eye!r} and target are the same place: a camera looks from the one to the other")
    return raster.Camera(at, towards, fov)


def _place(name: str, given: ArrayLike | None) -> Floats:
    try:
        place = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        place = np.zeros(0)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise BadInput(f"{name}={given!r}: give three numbers [m], and both eye and target, or neither")
    return place
