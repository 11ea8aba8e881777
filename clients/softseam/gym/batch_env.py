"""Many pieces of tofu to lift at once, in one compiled call: what `TofuLift` is for one.

>>> import gymnasium
>>> envs = gymnasium.make_vec("softseam.gym:softseam/TofuLift-v0", num_envs=1024)
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from softseam.errors import BadInput
from softseam.given import whole
from softseam.gym.lift_scene import CRUSHED, HEIGHT, PADS, SPEED, STEPS, SUBSTEPS, settings_of
from softseam.gym.randomise import Drawn, Randomise
from softseam.gym.reward import GENTLE, Grip, Term
from softseam.gym.scene_env import check_finite
from softseam.gym.show import checked, modes_here
from softseam.gym.shown_batch import Device, Numbers, ShownBatch
from softseam.gym.sight import BOUND, SEEN, Sight
from softseam.gym.task_env import ACT
from softseam.scenes import bundle_of
from softseam.variants import with_settings
from softseam_protocol.scene.tools import BoxTool

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class BatchEnv(ShownBatch):
    """`TofuLift` for many pieces, simulated by XPBD, eight side by side in each thread.

    See there for what is done, seen and rewarded. `info` has arrays: the time, grip_force, lift_height, slip,
    peak_von_mises, compression, stress (the largest so far) and is_success.

    Environment i draws its pieces as a `TofuLift` does that was reset with the seed + i, and what becomes of one does
    not depend on how many there are, nor on the threads: the same bits.

    reward, randomise  as for `TofuLift`
    autoreset_mode     when an episode that ended is followed by the next one, see Gymnasium; where DISABLED, by
                       `reset(options={"reset_mask": mask})`
    threads            that share the pieces
    device             cpu, or cuda: a graphics card, by numba-cuda (pip install 'softseam[cuda]')
    settings           of the scene, as `softseam run --set` takes them
    render_mode        "rgb_array": `render` gives a picture of each piece; "human": a window shows four of them
    """

    def __init__(
        self,
        num_envs: int = 64,
        *,
        reward: Sequence[Term[Grip]] = GENTLE,
        randomise: Randomise | None = Randomise(),  # noqa: B008 - it is frozen
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        device: Device = "cpu",
        settings: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> None:
        """Raises BadInput."""
        self.render_mode = checked(render_mode)
        count = whole(num_envs)
        if count is None or count < 1:
            raise BadInput(f"num_envs is {num_envs!r}: give a whole number of environments, 1 or more")
        if whole(threads) is None or threads < 1:
            raise BadInput(f"threads is {threads!r}: give a whole number, 1 or more")
        named = {name: mode for mode in AutoresetMode for name in (mode, mode.name, mode.value)}
        if autoreset_mode not in named:
            raise BadInput(f"autoreset_mode is {autoreset_mode!r}: there are {', '.join(AutoresetMode.__members__)}")
        self.autoreset_mode = named[autoreset_mode]
        self.num_envs = count
        self.metadata = {**modes_here(), "autoreset_mode": self.autoreset_mode}
        self.single_action_space = Box(-1.0, 1.0, (2,), np.float32)
        self.single_observation_space = Box(-BOUND, BOUND, (len(SEEN),), np.float32)
        self.action_space = batch_space(self.single_action_space, count)
        self.observation_space = batch_space(self.single_observation_space, count)
        self.scene = with_settings(
            bundle_of("tofu_grasp")[0], ["regions={default: pbd}", *settings_of("xpbd", ACT), *settings]
        )
        self.steps = 0
        """of training, in all environments together; set it to go on where another one stopped"""
        self._terms = tuple(reward)
        self._randomise = Randomise.nothing(self.scene) if randomise is None else randomise
        self._tools = list(self.scene.tools)
        self._pads = [self._tools.index(pad) for pad in PADS]
        self._randomise.check_substep(self.scene, ACT / SUBSTEPS)
        self._opened = int(threads), device
        self._batch = self._open(*self._opened)
        self._random = [seeding.np_random(None)[0] for _ in range(count)]
        rest = self._batch.structure.x_rest
        self._ground = float(rest[:, 2].min())
        top = np.array([0.0, 0.0, rest[:, 2].max()])
        away = np.linalg.norm(rest - top, axis=1)
        self._around = np.flatnonzero(away < away.min() + 1e-9)
        """nodes around the middle of the top, whose mean the marker is"""
        self._points_of_face = int((rest[:, 0] < rest[:, 0].min() + 1e-9).sum())
        none = np.zeros(count)
        self._along, self._width, self._apart = np.zeros((count, 2)), none.copy(), none.copy()
        self._closed, self._risen, self._count, self._base = none.copy(), none.copy(), none.copy(), none.copy()
        self._last, self._young = np.zeros((count, 2)), none.copy()
        self._start = np.zeros((count, 3))
        self._lifting, self._felt = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
        self._over: Mask | None = None
        """episodes that ended with the last step; None before the first reset"""

    def _open(self, threads: int, device: Device) -> Any:
        from softseam_services.body.errors import SettingError
        from softseam_services.pbd.batch.batch import Batch

        try:
            return Batch(self.scene, self.num_envs, ACT, SUBSTEPS, threads, device)
        except SettingError as error:
            raise BadInput(str(error)) from error

    # ---- what Gymnasium calls

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Begin episodes: all, or those of options["reset_mask"]. Environment i takes seed + i, or the i-th seed."""
        mask = np.ones(self.num_envs, dtype=np.bool_)
        if options is not None and "reset_mask" in options:
            mask = np.asarray(options["reset_mask"])
            if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
                raise BadInput(f"reset_mask: give an array of {self.num_envs} truth values, one of them true at least")
            if self._over is None and not mask.all():
                raise BadInput("reset_mask: no episode has begun yet, reset all of them first")
        seeds: Sequence[int | None] = [None] * self.num_envs
        if seed is not None:
            seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
            if len(seeds) != self.num_envs:
                raise BadInput(f"{len(seeds)} seeds for {self.num_envs} environments: give one each, or one number")
        for i in np.flatnonzero(mask).tolist():
            if seeds[i] is not None:
                self._random[i] = seeding.np_random(seeds[i])[0]
        first = self._over is None
        self._begin(mask)
        if first or mask.all():
            self._found = self._batch.outcome()
            self._sight, self._grip = self._look()
            self._over = np.zeros(self.num_envs, dtype=np.bool_)
            self._seen = self._sight.numbers(None, ACT, SPEED, HEIGHT)
        else:
            assert self._over is not None
            self._over[mask] = False
            self._look_anew(mask)
        self._show()
        return self._seen.copy(), self._told()

    def step(self, actions: Any) -> tuple[Numbers, Floats, Mask, Mask, dict[str, Any]]:
        """One action of 0.04 s in each environment (num_envs, 2). Raises BadInput for what is no such array."""
        if self._over is None:
            raise BadInput("no episode has begun: call reset()")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._over.any():
            raise BadInput(f"{int(self._over.sum())} episodes are over: reset them, with options['reset_mask']")
        taken = self._within(actions)
        new = self._over.copy()
        sound, (before, then) = self._act(taken), (self._sight, self._grip)
        self._count += 1.0
        self._sight, self._grip = self._look(then)
        self._keep_where_lost(before, then)
        seen = self._sight.numbers(before, ACT, SPEED, HEIGHT)
        crushed = self._grip.compression >= CRUSHED
        success = (self._grip.lift >= HEIGHT) & ~crushed & sound
        terminated = success | crushed | ~sound
        truncated = (self._count >= STEPS) & ~terminated
        self.steps += int((~new).sum())
        reward = sum(term.of(then, self._grip, self.steps) for term in self._terms) - 2e-3
        reward = np.where(sound, reward + np.where(crushed, -1.0, success), -1.0)
        self._seen = seen
        if new.any():  # NEXT_STEP: what ended before begins now
            reward[new], terminated[new], truncated[new], success[new] = 0.0, False, False, False
            self._begin(new)
            self._look_anew(new)
        self._over = terminated | truncated
        info = self._told() | {"is_success": success, "_is_success": ~new}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._over.any():
            info = self._begin_at_once(info)
        self._show()
        return self._seen.copy(), np.asarray(reward, np.float64), terminated, truncated, info

    def snapshot(self, index: int) -> dict[str, Any]:
        """One environment as it is, to put back with `restore`, here or in another batch of the same settings."""
        return {
            "body": self._batch.snapshot(index),
            "random": self._random[index].bit_generator.state,
            "own": {name: np.array(each[index]) for name, each in self._own().items()},
        }

    def restore(self, index: int, snapshot: Mapping[str, Any]) -> None:
        """Put an environment back. Raises BadInput where the snapshot is none of this scene's."""
        try:
            kept = {name: snapshot["own"][name] for name in self._own()}
            self._batch.restore(index, snapshot["body"])
            self._random[index].bit_generator.state = snapshot["random"]
        except (ValueError, KeyError, TypeError) as error:
            raise BadInput(f"no snapshot of such an environment: {error}") from error
        for name, each in self._own().items():
            each[index] = kept[name]

    # ----

    def _own(self) -> dict[str, Any]:
        """What the environments have beside their pieces, by name."""
        assert self._over is not None
        kept = {name: getattr(self, f"_{name}") for name in _KEPT}
        return kept | {f"sight {k}": v for k, v in self._sight._asdict().items()} | vars(self._grip)

    def _within(self, actions: Any) -> Floats:
        try:
            numbers = np.asarray(actions, np.float64)
        except (TypeError, ValueError):
            raise BadInput(f"actions are {self.num_envs} x 2 numbers, not {actions!r}") from None
        if numbers.shape != (self.num_envs, 2):
            raise BadInput(f"actions are {self.num_envs} x 2 numbers, not an array {numbers.shape}")
        check_finite(numbers, "actions")
        return np.clip(numbers, -1.0, 1.0).astype(np.float32).astype(np.float64)

    def _begin(self, mask: Mask) -> None:
        """New pieces where the mask is."""
        from softseam_services.pbd.batch.pieces import Pieces

        which = np.flatnonzero(mask)
        drawn = []
        for i in which:
            drawn.append(self._randomise.draw(self.scene, PADS, self._random[i]))
            self._random[i].integers(2**31)  # the seed of the session that `TofuLift` would begin
        own = self._batch.structure.own(len(which))
        size = np.array([own.size[0] if each.size is None else each.size for each in drawn])
        position, orientation = own.position.copy(), own.orientation.copy()
        for place, each in enumerate(drawn):
            for pad in self._pads:
                position[place, pad] = each.place(own.position[place, pad])
                orientation[place, pad] = math.cos(0.5 * each.turn), 0.0, 0.0, math.sin(0.5 * each.turn)
        friction = np.array([[each.friction[name] for name in self._tools] for each in drawn])
        fields = [each.friction_field for each in drawn]
        self._batch.put(which, Pieces(size, *_columns(drawn), friction, fields, position, orientation))
        turn = np.array([each.turn for each in drawn])
        along = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        left, right = (position[:, pad, :2] for pad in self._pads)
        box = self.scene.tools[PADS[0]]
        assert isinstance(box, BoxTool)
        self._along[which] = along
        self._young[which] = [each.young for each in drawn]
        self._width[which] = (np.abs(along) * size[:, :2]).sum(axis=1)
        self._apart[which] = np.einsum("ki,ki->k", right - left, along) - box.size[0]
        self._closed[which] = self._risen[which] = self._count[which] = 0.0
        self._last[which], self._lifting[which], self._felt[which] = 0.0, False, False
        self._base[which] = self._ground + 0.5 * size[:, 2]  # of the middle, where the pads rise at once
        self._start[which] = self._marker()[which]

    def _act(self, taken: Floats) -> Mask:
        """Move the pads; which pieces are still sound."""
        close, rise = (SPEED * taken).T
        close, rise = np.maximum(close, -self._closed / ACT), np.maximum(rise, -self._risen / ACT)
        self._closed, self._risen = self._closed + close * ACT, self._risen + rise * ACT
        self._last = taken
        way = np.zeros((self.num_envs, len(self._tools), 3))
        for pad, side in zip(self._pads, (1.0, -1.0), strict=True):
            way[:, pad, :2], way[:, pad, 2] = side * (close * ACT)[:, None] * self._along, rise * ACT
        found = self._found = self._batch.step(way)
        felt = np.any([found.force[:, pad].any(axis=1) for pad in self._pads], axis=0)
        self._lifting |= felt & (rise > 0.0)
        together = found.stress + found.middle.sum(axis=1) + found.force.sum(axis=(1, 2))
        return np.asarray(np.isfinite(together) & (found.least_j > 0.0) & (found.stress <= self._young))

    def _marker(self) -> Floats:
        """Where it is (num_envs, 3) [m]."""
        places = [self._batch.place_of(int(node)).astype(np.float64) for node in self._around]
        return np.asarray(np.mean(places, axis=0))

    def _look(self, then: Grip | None = None) -> tuple[Sight, Grip]:
        """All pieces as they stand; then: how they stood before, at first None."""
        found = self._found
        left, right = (found.force[:, pad].astype(np.float64) for pad in self._pads)
        pressing = [
            np.maximum(-np.einsum("ki,ki->k", left[:, :2], self._along), 0.0),
            np.maximum(np.einsum("ki,ki->k", right[:, :2], self._along), 0.0),
        ]
        pull = -left[:, 2] - right[:, 2]
        marker = self._marker() - self._start
        touching = [found.touching[:, pad] / self._points_of_face for pad in self._pads]
        middle = found.middle[:, 2].astype(np.float64)
        self._base = np.where(self._lifting | (self._count == 0.0), self._base, middle)
        sight = Sight(
            *(
                self._closed,
                self._risen,
                *pressing,
                pull,
                marker[:, 2],
                np.einsum("ki,ki->k", marker[:, :2], self._along),
            ),
            *(*touching, *self._last.T, self._count / STEPS),
        )
        squeezed = np.maximum(1.0 - (self._apart - 2.0 * self._closed) / self._width, 0.0)
        both = left.any(axis=1) & right.any(axis=1)
        self._felt = both | (self._felt & (squeezed > 0.0))  # as `Grips` has it
        self._squeezed = squeezed = np.where(self._felt, squeezed, 0.0)
        self._peak = np.minimum(np.nan_to_num(found.stress.astype(np.float64)), self._young)
        grip = Grip(
            lift=np.where(self._lifting, middle - self._base, 0.0),
            air=np.maximum(self._apart - self._width - 2.0 * self._closed, 0.0),
            force=np.minimum(*pressing),
            slip=found.slip.astype(np.float64) if then is None else np.where(found.slip > 0.0, found.slip, then.slip),
            compression=squeezed if then is None else np.maximum(squeezed, then.compression),
            stress=self._peak if then is None else np.maximum(self._peak, then.stress),
            energy=found.strain.astype(np.float64),
        )
        return sight, grip

    def _keep_where_lost(self, before: Sight, then: Grip) -> None:
        """A piece whose places are no numbers is shown as it stood before, as one is where a `TofuLift` fails."""
        known = np.isfinite(self._found.middle.sum(axis=1) + self._found.force.sum(axis=(1, 2)))
        if not known.all():
            self._sight = Sight(*(np.where(known, *each) for each in zip(self._sight, before, strict=True)))
            self._grip = Grip(
                **{name: np.where(known, new, vars(then)[name]) for name, new in vars(self._grip).items()}
            )

    def _look_anew(self, mask: Mask) -> None:
        """What is seen of the pieces that began where the mask is; they have not been stepped yet."""
        self._sight = Sight(*(np.where(mask, 0.0, value) for value in self._sight))
        grip = {name: np.where(mask, 0.0, value) for name, value in vars(self._grip).items()}
        grip["air"] = np.where(mask, self._apart - self._width, grip["air"])
        self._grip = Grip(**grip)
        self._squeezed, self._peak = np.where(mask, 0.0, self._squeezed), np.where(mask, 0.0, self._peak)
        self._seen[mask] = self._sight.numbers(None, ACT, SPEED, HEIGHT)[mask]

    def _begin_at_once(self, info: dict[str, Any]) -> dict[str, Any]:
        """SAME_STEP: what ended begins anew, and what it ended with is given as `final_obs` and `final_info`."""
        assert self._over is not None
        ended = self._over.copy()
        final = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended):
            final[i] = self._seen[i].copy()
        last = {name: value.copy() for name, value in info.items()}
        self._begin(ended)
        self._look_anew(ended)
        self._over[:] = False
        return self._told() | {
            "is_success": info["is_success"],
            "_is_success": info["_is_success"],
            "final_obs": final,
            "_final_obs": ended,
            "final_info": last,
            "_final_info": ended,
        }

    def _told(self) -> dict[str, Any]:
        grip, everyone = self._grip, np.ones(self.num_envs, dtype=np.bool_)
        info = {
            "time": self._count * ACT,
            "grip_force": grip.force,
            "lift_height": grip.lift,
            "slip": grip.slip,
            "peak_von_mises": self._peak,
            "compression": self._squeezed,
            "stress": grip.stress,
        }
        return {**info, **{f"_{name}": everyone for name in info}}


_KEPT = (
    "along",
    "width",
    "young",
    "apart",
    "closed",
    "risen",
    "count",
    "base",
    "last",
    "start",
    "lifting",
    "felt",
    "over",
    "seen",
)
"""arrays of an environment's own"""


def _columns(drawn: Sequence[Drawn]) -> tuple[Floats, Floats, Floats]:
    return (
        np.array([each.young for each in drawn]),
        np.array([each.poisson for each in drawn]),
        np.array([each.density for each in drawn]),
    )
