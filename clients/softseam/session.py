"""A simulation to step: the same in this process and through services on a bus."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softseam.backend import Backend, backend_of
from softseam.duration import expected_duration, too_many_steps
from softseam.errors import BadInput, BadVelocity, NotReset, SceneRefused, SessionClosed, UnknownTool, require_extra
from softseam.given import whole
from softseam.gradient import Asked, Gradient, check_inputs
from softseam.losses import Loss
from softseam.observation import Observation, observation_from
from softseam.one_thread import one_thread
from softseam.previewing import draw_preview
from softseam.scenes import Source, bundle_of, bundle_with, inputs_of, located
from softseam.variants import Model, with_model, with_settings
from softseam_protocol.messages import session as messages
from softseam_protocol.messages.arrays import Vector3
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Recorded, SurfaceMesh
from softseam_protocol.scene.command import BadCommand, NoSuchTool, checked_command
from softseam_protocol.scene.scene import Scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def open_as_given(
    scene: Source,
    connect: str | None = None,
    *,
    model: Model | None = None,
    settings: Sequence[str] = (),
    record: str | Path | bool | None = None,
    timeout: float = 120.0,
) -> Session:
    """A session on a scene as it is given, without a plan for its tolerance; arguments as for `softseam.open`."""
    varied, bundle = _read(scene, model, settings)
    if isinstance(record, str | Path):
        for what, used in inputs_of(scene).items():
            if Path(record).resolve() == used.resolve():
                raise BadInput(f"record={str(record)!r} is {what}, which would be lost: choose another name")
    if record and any(body.said("ladder", ()) for body in varied.bodies.values()):
        raise BadInput("a body with a ladder changes its cells, and a recording has one surface a body: do not record")
    try:
        backend = backend_of(bundle, connect, record, timeout)
    except SceneRefused as error:
        raise SceneRefused(located(str(error), scene, settings)) from error
    return Session(varied, bundle, backend, model, scene)


def _read(scene: Source, model: Model | None, settings: Sequence[str]) -> tuple[Scene, Bundle]:
    """The scene as it is simulated, and what a participant needs for it. Raises SceneRefused and BadInput."""
    parsed, bundle = bundle_of(scene)
    varied = _varied(parsed, model, settings)
    if endless := too_many_steps(varied):
        raise SceneRefused(located(endless, scene, settings))
    return varied, bundle if varied is parsed else bundle_with(varied, bundle, scene, settings)


def _varied(scene: Scene, model: Model | None, settings: Sequence[str]) -> Scene:
    """The scene with settings and one model; what does not go with its regions may go with that model alone."""
    if model is None:
        return with_settings(scene, settings)
    try:
        return with_model(with_settings(scene, settings), model)
    except SceneRefused:
        if model == "hybrid" or any(setting.strip().startswith("regions") for setting in settings):
            raise
    return with_model(with_settings(with_model(scene, model), settings), model)


class Session:
    """One simulation of one scene. A context manager; not for use from several threads at once."""

    def __init__(
        self, scene: Scene, bundle: Bundle, backend: Backend, model: Model | None = None, source: Source | None = None
    ) -> None:
        """model: which the scene was opened with; source: what it was read from, if it was"""
        self._backend: Backend | None = backend
        self._model, self._source = model, source or bundle
        self._turn = threading.RLock()
        self._last: Observation | None = None
        self._seed = 0
        self._commands: list[Mapping[str, Vector3] | None] | None = None
        """of the steps since the start; None where they are not known"""
        self._opened = scene, bundle  # what settings of `reset` are applied to
        self._take_scene(scene, bundle)
        self.recorded: Recorded | None = None
        """after `close`: where the recording is, and what it lost; None without one"""
        self.unrecorded = ""
        """after `close`: why nothing is known of a recording that was asked for"""
        self.plan_anew: Callable[[messages.ErrorEstimate | None], Session | None] | None = None
        """of a session that was planned: another one, where this one's errors are not what the plan expected"""

    def _take_scene(self, scene: Scene, bundle: Bundle) -> None:
        """Simulate this scene from now on."""
        self.scene, self.bundle = scene, bundle
        self._there: Bundle | None = bundle  # what the backend has; None where an answer was lost: it is sent again
        # the bundle's order, in which the tools' arrays come: it is not that of a scene made in a program
        self._tools = tuple(Scene.model_validate_json(bundle.scene).tools)
        self._length = expected_duration(scene)

    @property
    def done(self) -> bool:
        """Whether the scene's duration is over; without one, whether its motion is, or would be.

        Tools driven by hand do not advance the scene's motion: then the session is done when that motion would have
        ended. Where that depends on a force, or on the width of a mesh, give the scene a duration.
        """
        return self._last is not None and self._last.done

    @property
    def last(self) -> Observation:
        """The latest observation."""
        if self._last is None:
            self._running()
            raise NotReset("the session has not begun: call reset() first")
        return self._last

    @one_thread
    def reset(
        self, seed: int | None = None, *, scene: str | Path | Scene | None = None, settings: Sequence[str] | None = None
    ) -> Observation:
        """Put the bodies and the tools where the scene starts, or where another one does.

        seed      in place of the scene's
        scene     another scene from now on, with the model that this session was opened with; it is not planned
        settings  "key.key=value", each in place of what the scene says, as for `softseam.open`. They do not add up:
                  with settings the scene is as it was opened, or given here, and these. None: the scene as it is.

        Participants keep what scenes share that differ only in numbers: those of materials, damping, gravity, friction,
        motion, poses and size.
        Raises SceneRefused for a scene that cannot be simulated; the session keeps the scene that it had.
        """
        backend = self._running()
        opened = self._opened if scene is None else _read(scene, self._model, ())
        source = self._source if scene is None else scene
        varied, bundle = (self.scene, self.bundle) if scene is None and settings is None else opened
        if settings:
            varied = with_settings(varied, settings)
            if endless := too_many_steps(varied):
                raise SceneRefused(located(endless, varied, settings))
            bundle = bundle_with(varied, bundle, source, settings)
        seed = varied.seed if seed is None else seed
        number = whole(seed)
        if number is None or not 0 <= number < 2**31:
            raise BadInput(f"seed is {seed!r}: give a whole number from 0 to 2147483647")
        self._seed, self._commands = number, []
        if self._there is not None and (bundle.scene, bundle.files) == (self._there.scene, self._there.files):
            return self._observe(backend.reset(number))
        there, self._there, self._last = self._there, None, None
        try:
            message = backend.reset(number, bundle)
        except SceneRefused as error:
            self._there = there
            raise SceneRefused(located(str(error), varied if scene is None else scene, settings or ())) from error
        self._opened, self._source, self.plan_anew = opened, source, None
        self._take_scene(varied, bundle)
        return self._observe(message)

    @one_thread
    def step(
        self,
        tool_velocities: Mapping[str, ArrayLike] | None = None,
        *,
        count: int = 1,
        fields: bool = True,
    ) -> Observation:
        """Take one macro step, or `count` alike; tools that are not named stand still.

        tool_velocities  velocity of each tool (3,) [m/s], or with its angular velocity about its position (6,)
                         [m/s, rad/s], or also with 1 to make it hold the particles of a sheet or rope within
                         reach, 0 to let go (7,); None follows the scene's own motion
        fields           also observe the fields of the whole body at the end
        """
        backend = self._begun()
        steps = whole(count)
        if steps is None or steps < 1:
            raise BadInput(f"count is {count!r}: give a whole number of steps, 1 or more")
        velocities = None if tool_velocities is None else self._checked(tool_velocities)
        observation = self._observe(backend.step(steps, velocities, fields))
        self._note(steps, velocities)
        if velocities is not None and self._length is not None and not observation.done:
            over = observation.time >= self._length - 1e-6 * self.scene.step
            self._last = observation = replace(observation, done=over)
        return observation

    @one_thread
    def run(
        self,
        progress: Callable[[Observation], None] | None = None,
        *,
        fields: bool = False,
        max_steps: int | None = None,
    ) -> Observation:
        """Follow the scene's own motion to its end; resets first if need be.

        progress   called with the observation of every step, in their order. Over a bus they come a tenth of a second
                   at a time, and the simulation is ahead of them: to act between steps, use `step`.
        fields     also observe the fields of the whole body after every step
        max_steps  most steps to take; None: as many as the motion has
        """
        most = None if max_steps is None else whole(max_steps)
        if max_steps is not None and (most is None or most < 0):
            raise BadInput(f"max_steps is {max_steps!r}: give a whole number of steps, or None for all")
        observation = self._last if self._last is not None else self.reset()
        taken, done = 0, observation.done
        unread: messages.Observation | None = None  # what nobody looks at is read at the end
        try:
            while not done and (most is None or taken < most):
                backend = self._running()
                if fields:
                    several: Sequence[messages.Observation] = [backend.step(1, None, fields=True)]
                else:
                    several = backend.follow(None if most is None else most - taken)
                taken, done = taken + len(several), several[-1].report.done
                self._note(len(several), None)
                if progress is None:
                    unread = several[-1]
                    continue
                seen = [observation_from(message, self._tools) for message in several]
                self._last = seen[-1]
                for observation in seen:
                    progress(observation)
        finally:
            if unread is not None:
                self._observe(unread)
        return self.last

    @one_thread
    def gradient(
        self,
        loss: Loss,
        wrt: Sequence[str],
        *,
        commands: Sequence[Mapping[str, ArrayLike]] | None = None,
        steps: int | None = None,
        near: float = 1e-4,
    ) -> Gradient:
        """Derivatives of a loss of a run from the start of the scene, where the session then stands at its end.

        loss      a function of the `Run` that returns its value and its `Slope`: of `softseam.losses`, or your own
        wrt       names: "young" [Pa]; "friction" of all tools alike, "friction.TOOL" [1]; "way.TOOL" in each step
                  (s, 3) [m]; "velocity" [m/s] and "position" [m] of the whole body at the start (3,)
        commands  velocities of tools step by step, as for `step`; None follows the scene's own motion
        steps     most steps of that motion; None: all
        near      contacts are reported as `crossed` within such a relative change of forces

        By the adjoint of FEM's implicit Euler steps, contact and friction included: exact but for the tolerance that
        steps are solved to (`models.fem.tolerance`; 1e-7 is enough for six digits). Tools go as they do in the run,
        whatever the inputs are. Raises BadInput for what gradients do not go through, with the key and a remedy.
        """
        backend = self._running()
        check_inputs(wrt, self._tools)
        most = None if steps is None else whole(steps)
        if steps is not None and (most is None or most < 1):
            raise BadInput(f"steps is {steps!r}: give a whole number of steps, 1 or more")
        moved = None if commands is None else [self._checked(one) for one in commands]
        self._commands = None
        gradient, seen = backend.differentiate(Asked(loss, wrt, moved, most, near))
        self._observe(seen)
        return gradient

    def _checked(self, velocities: Mapping[str, ArrayLike]) -> dict[str, Vector3]:
        """As `checked_command`. Raises UnknownTool and BadVelocity."""
        try:
            return checked_command(velocities, self.scene)
        except BadCommand as error:
            raise (UnknownTool if isinstance(error, NoSuchTool) else BadVelocity)(str(error)) from None

    @one_thread
    def doubts(self) -> list[str]:
        """What is doubtful about the scene, where that costs little to find out: sentences that begin with their key.

        `softseam check` warns of the same, and `softseam run` before the first step. Over a bus it is what the scene
        alone shows, without the meshes that it names.
        """
        return self._running().doubts(self.scene)

    @one_thread
    def snapshot(self) -> bytes:
        """Everything that the future of the simulation depends on."""
        return self._begun().save()

    @one_thread
    def restore(self, state: bytes) -> Observation:
        """Go back to a snapshot of this scene; what follows is the same, bit for bit, as it was after it."""
        if not isinstance(state, bytes | bytearray | memoryview):
            raise BadInput(f"restore() takes the bytes that snapshot() gave, not {type(state).__name__}")
        self._commands = None
        return self._observe(self._running().load(bytes(state)))

    @one_thread
    def estimate_errors(self) -> messages.ErrorEstimate | None:
        """Where stress is off as the body stands, said in `text`; None of a body of particles.

        Runs that follow the scene's own motion to its end say it there, unasked (`Observation.error_estimate`); a
        session that is stepped by hand has no end, so it says it when asked. It costs about a step. How far forces and
        displacements are off is claimed: `claims`.
        """
        return self._begun().estimate()

    @one_thread
    def claims(self) -> dict[str, Any]:
        """How far each quantity is claimed to be off since `reset`, as `softseam run` claims it in its report.

        What was done is done again in this process, and once more on cells and with steps twice as long: it costs what
        it took, and a part of that. Raises BadInput where nothing can be claimed, and says why.
        """
        self._begun()
        if not self._commands:
            why = (
                "no step was taken" if self._commands == [] else "what was done before restore() or gradient() is gone"
            )
            raise BadInput(f"no claims: {why}; call reset() and step from there")
        require_extra("solve", "simulating in this process")
        from softseam.claims.repeated import claims_of
        from softseam.claims.sibling import NoSibling

        try:
            return claims_of(self.scene, self.bundle, self._seed, self._commands)
        except NoSibling as error:
            raise BadInput(f"no claims: {error}") from None

    def _note(self, steps: int, velocities: Mapping[str, Vector3] | None) -> None:
        """Keep what was commanded, for `claims`."""
        if self._commands is not None:
            self._commands += steps * [velocities]

    @one_thread
    def surface_meshes(self) -> Mapping[str, SurfaceMesh]:
        """What draws the points of each body's surface, by body: triangles, cells behind it, tools that are meshes.

        Raises BadInput where the simulation is not in this process.
        """
        return self._running().surface_meshes()

    def picture(self, path: str | Path = "scene.png") -> Path:
        """Draw the scene as it starts to a .png, from four sides, and return its path: bodies, tools, their ways if
        nothing pushes back, and what of them touches first. It needs no screen, and simulates nothing.

        Raises BadInput where the file cannot be written, and MissingExtra without the extras solve and view.
        """
        return draw_preview(self.bundle, Path(path))

    def replan(self) -> bool:
        """Plan anew where the body as it stands errs more than it did in the run that the plan was found by.

        A scene with a `tolerance` is planned for its own motion; one that is stepped by hand may be held harder. Its
        errors are then taken to be as much larger, and the session begins anew, so call `reset`: cells, and with them
        the shapes of fields and snapshots, are others. Returns whether that was needed; planning takes up to minutes.
        """
        if self.plan_anew is None:
            raise BadInput("this session has no plan: give its scene a `tolerance`, and open it without a model")
        other = self.plan_anew(self.estimate_errors())
        if other is None:
            return False
        self.close()
        vars(self).update(vars(other))  # whoever holds this session goes on with it
        return True

    def close(self) -> None:
        """End the session and free what it holds; closing twice does nothing."""
        backend, self._backend = self._backend, None
        if backend is not None:
            backend.close()
            self.recorded, self.unrecorded = backend.recorded, backend.unrecorded

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _running(self) -> Backend:
        if self._backend is None:
            raise SessionClosed("the session is closed: open another one with softseam.open()")
        return self._backend

    def _begun(self) -> Backend:
        backend = self._running()
        if self._last is None:
            raise NotReset("the session has not begun: call reset() first")
        return backend

    def _observe(self, message: messages.Observation) -> Observation:
        observation = observation_from(message, self._tools)
        self._last = observation
        return observation
