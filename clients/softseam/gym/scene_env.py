"""A scene as an environment: actions move its tools, and what its client observes is seen."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import ArrayLike, NDArray

from softseam.duration import expected_duration
from softseam.errors import BadInput, NotReset, SimulationFailed
from softseam.given import whole
from softseam.gym.picture import NO_MARKS, Image, Picture
from softseam.gym.show import MODES, Window, checked, modes_here, warn_of_none
from softseam.observation import Observation
from softseam.opening import open as open_session
from softseam.scenes import bundle_of
from softseam.session import Session
from softseam.variants import Model, with_settings
from softseam.view.raster import Camera
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import PlaneTool

Numbers = NDArray[np.float32]

_AXES = ("x", "y", "z")
_WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")


class SceneEnv(gymnasium.Env[Numbers, Any], ABC):
    """A scene whose tools an agent moves, until its duration is over (truncated) or `ended` says so (terminated).

    A subclass says what is rewarded (`reward`). It may say what ends an episode (`ended`), how a scene differs from one
    episode to the next (`vary`), what an action does (`act`, with an `action_space` of its own), and what is seen
    (`see`, with an `observation_space`).

    Without these, an action has three numbers from -1 to 1 for each tool that the scene moves: its velocity, in parts
    of `speed`. Seen are these tools' ways since the start [m], the forces and torques on them [N, N m], and the scene's
    quantities (SI), in the order of `names`. They differ in size: `gymnasium.wrappers.NormalizeObservation` helps.

    A step that finds no solution ends the episode (truncated), and `info["failed"]` says why; so does a simulation that
    cannot go on. Bad actions raise BadInput, and change nothing. `info` has the time [s] and the scene's quantities;
    `session.last` has all that a client observes.
    """

    metadata = MODES
    speed: float = 0.05
    """of a tool at an action of 1 [m/s]"""

    def __init__(
        self,
        scene: str | Path | Scene,
        *,
        settings: Sequence[str] = (),
        model: Model | None = None,
        connect: str | None = None,
        repeat: int = 1,
        record: str | Path | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Arguments as for `softseam.open`, and:

        repeat       steps of the simulation in one step of the environment
        record       folder for a recording of each episode, to replay (in this process only); those that are there stay
        render_mode  "rgb_array": `render` gives a picture (360, 480, 3), without a display; "human": each step is shown
                     in a window; None: neither
        """
        self.render_mode, self.metadata = checked(render_mode), modes_here()
        steps = whole(repeat)
        if steps is None or steps < 1:
            raise BadInput(f"repeat is {repeat!r}: give a whole number of steps, 1 or more")
        if record is not None and connect is not None:
            raise BadInput("episodes are recorded in this process only: leave out `record` or `connect`")
        if render_mode is not None and connect is not None:
            raise BadInput("episodes are drawn in this process only: leave out `render_mode` or `connect`")
        self.scene = with_settings(bundle_of(scene)[0], settings)
        """as it is in every episode, but for what `vary` changes"""
        if not expected_duration(self.scene):
            raise BadInput(
                f"how long an episode of {self.scene.name!r} is, nothing says: give the scene a duration, "
                "e.g. settings=['duration=3']"
            )
        self._given, self._settings, self._model, self._connect = scene, tuple(settings), model, connect
        self._repeat, self._record = steps, None if record is None else Path(record)
        self._session: Session | None = None
        self._begun_with: tuple[int, tuple[str, ...]] = (0, ())  # seed and settings of the episode
        self._shown: Observation | None = None  # of the moment that `render` draws
        self._picture: Picture | None = None
        self._camera: Camera | None = None
        self._window: Window | None = None
        self.tools = moved(self.scene)
        """that actions move"""
        self._quantities = self.scene.asked
        each = [f"{tool}.{what}" for tool in self.tools for what in (*_AXES, *_WRENCH)]
        self.names = (*each, *self._quantities)
        """of what `see` returns where it is not overridden"""
        own = getattr(type(self), "action_space", None)
        ours = Box(-1.0, 1.0, (3 * len(self.tools),), np.float32)
        self.action_space: Space[Any] = own if isinstance(own, Space) else ours
        self.observation_space = Box(-np.inf, np.inf, (len(self.names),), np.float32)

    # ---- what a subclass says

    @abstractmethod
    def reward(self, before: Observation, after: Observation) -> float:
        """Of a step of the environment, from what was observed before and after it."""

    def ended(self, observation: Observation) -> bool:
        """Whether the task is over, for better or worse."""
        return False

    def vary(self, random: np.random.Generator) -> Sequence[str]:
        """Settings of the coming episode, e.g. ["body.material.young=18e3"], as `Session.reset` takes them."""
        return ()

    def act(self, action: Any) -> Mapping[str, ArrayLike]:
        """Velocities of the tools [m/s], as `Session.step` takes them, from an action within the action space."""
        return dict(zip(self.tools, self.speed * action.reshape(-1, 3).astype(np.float64), strict=True))

    def see(self, observation: Observation) -> Numbers:
        """What the agent sees. A quantity that is not known yet is 0."""
        seen: list[float] = []
        for name in self.tools:
            seen += [*(observation.tools[name].position - self._start[name]), *observation.wrench[name]]
        seen += [observation.quantities.get(name, 0.0) for name in self._quantities]
        return np.array(seen, np.float32)

    def marks(self) -> NDArray[np.float64]:
        """Lines that a picture shows beside bodies and tools, such as a target (l, 2, 3) [m]."""
        return NO_MARKS

    # ---- what Gymnasium calls

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Begin an episode. The same seed gives the same episodes, with the same actions bit for bit."""
        super().reset(seed=seed)
        varied, seed = tuple(self.vary(self.np_random)), int(self.np_random.integers(2**31))
        if self._record is not None:
            self._end()
        if self._session is None:
            self._session = self._open()
        self._begun_with = seed, varied
        observation = self._shown = self._session.reset(seed, settings=varied)
        self._start = {name: observation.tools[name].position for name in self.tools}
        seen = self.see(observation)
        if self.render_mode is not None:
            self._picture = Picture(self._session.scene, self._session.surface_meshes())
            self._camera = self._picture.place(observation, self.marks())
        self._show()
        return seen, self._told(observation)

    def step(self, action: Any) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Move the tools for `repeat` steps. Numbers beyond the action space are as its border."""
        session, taken = self.session, self._within(action)
        before = session.last
        try:
            after = self._advance(session, self.act(taken))
        except SimulationFailed as error:
            self._end()
            return self.see(before), 0.0, False, True, {**self._told(before), "failed": str(error)}
        self._shown = after
        self._show()
        info = self._told(after)
        failed = [event.message for event in after.events if event.kind is EventKind.SOLVER]
        if failed:
            info["failed"] = failed[0]
        truncated = after.done or bool(failed)
        return self.see(after), float(self.reward(before, after)), self.ended(after), truncated, info

    def render(self) -> Image | None:
        """The moment as a picture (360, 480, 3), where `render_mode` is "rgb_array"; "human" shows it in a window."""
        if self.render_mode is None:
            warn_of_none(self)
            return None
        if self._picture is None:
            self._picture = Picture(self.session.scene, self.session.surface_meshes(), self._camera)
        assert self._shown is not None
        image = self._picture.of(self._shown, self.marks())
        if self.render_mode == "rgb_array":
            return image
        self._window = self._window or Window(self.scene.name)
        self._window.show(image)
        return None

    def close(self) -> None:
        """End the session and free what it holds; `reset` opens another one."""
        self._end()
        window, self._window = self._window, None
        if window is not None:
            window.close()

    def _show(self) -> None:
        if self.render_mode == "human":
            self.render()

    def _end(self) -> None:
        session, self._session = self._session, None
        if session is not None:
            session.close()

    @property
    def session(self) -> Session:
        """That of the episode; NotReset without one."""
        if self._session is None:
            raise NotReset("no episode has begun, or its simulation failed: call reset()")
        return self._session

    # ---- what `copy.deepcopy` and `pickle` call

    def __getstate__(self) -> dict[str, Any]:
        """All but the session, of which its snapshot is kept, and what is shown. Raises BadInput where it records."""
        if self._record is not None:
            raise BadInput(
                f"{type(self).__name__} records its episodes, so it has no copies: make one without `record`"
            )
        state = vars(self) | {"_session": None, "_shown": None, "_picture": None, "_window": None}
        return state | {"_snapshot": None if self._session is None else self._session.snapshot()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Open another session where there was one, which goes on from there with the same bits."""
        snapshot = state.pop("_snapshot")
        vars(self).update(state)
        if snapshot is not None:
            seed, settings = self._begun_with
            self._session = self._open()
            self._session.reset(seed, settings=settings)
            self._shown = self._session.restore(snapshot)

    # ----

    def _advance(self, session: Session, velocities: Mapping[str, ArrayLike]) -> Observation:
        """Take the steps of the simulation that an action lasts."""
        return session.step(velocities, count=self._repeat)

    def _open(self) -> Session:
        record = None
        if self._record is not None:
            self._record.mkdir(parents=True, exist_ok=True)
            there = [path.stem.removeprefix("episode-") for path in self._record.glob("episode-*.mcap")]
            number = 1 + max((int(text) for text in there if text.isdecimal()), default=0)
            record = self._record / f"episode-{number:06d}.mcap"
        return open_session(self._given, self._connect, model=self._model, settings=self._settings, record=record)

    def _told(self, observation: Observation) -> dict[str, Any]:
        """Numbers alone, which environments in other processes send to their agent."""
        return {"time": observation.time, **{name: observation.quantities.get(name, 0.0) for name in self._quantities}}

    def _within(self, action: Any) -> Any:
        space = self.action_space
        if not isinstance(space, Box):
            if space.contains(action):
                return action
            raise BadInput(f"{action!r} is no action of {space}")
        try:
            numbers = np.asarray(action, np.float32)
        except (TypeError, ValueError):
            raise BadInput(f"an action is {space.shape[0]} numbers, not {action!r}") from None
        if numbers.shape != space.shape:
            raise BadInput(f"an action is {space.shape[0]} numbers, not {action!r}")
        check_finite(numbers, "action")
        return np.clip(numbers, space.low, space.high)


def check_finite(numbers: NDArray[Any], name: str) -> None:
    """Raises BadInput that names the first number that is none."""
    for index in np.argwhere(~np.isfinite(numbers))[:1].tolist():
        raise BadInput(f"{name}{index} is {numbers[tuple(index)]}, which is not finite")


def moved(scene: Scene) -> tuple[str, ...]:
    """The tools that a scene's motion moves, in the scene's order; without one, all but planes."""
    named = {name for phase in scene.motion for name in getattr(phase, "tools", ())}
    if not named:
        named = {name for name, tool in scene.tools.items() if not isinstance(tool, PlaneTool)}
    return tuple(name for name in scene.tools if name in named)
