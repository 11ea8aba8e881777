"""What can be learned at the command line: a row a task, fixed rules that policies are measured against, and stages.

Rules act by what is seen, or by `info`, which no policy sees.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from softseam.errors import BadInput
from softseam.gym import push_gentle, towel_fold
from softseam.gym.batch_env import BatchEnv
from softseam.gym.lift_scene import BY_FEM, BY_XPBD, LiftModel
from softseam.gym.push_gentle import STRESS_LIMIT, PushGentle
from softseam.gym.reward import Heading, Nearness, Ramp, StressConcentration, Touch, Way
from softseam.gym.scene_env import Numbers
from softseam.gym.slice_lift import SliceLift
from softseam.gym.task_env import ACT, TaskEnv
from softseam.gym.tofu_lift import TofuLift
from softseam.gym.towel_fold import TowelFold

Rule = Callable[[Numbers, dict[str, Any]], list[float]]


def pressed(newton: float) -> Rule:
    """Of a lift: close until the pads press with so much, then rise."""
    return lambda seen, info: [0.4, 0.0] if info["grip_force"] < newton else [0.0, 0.6]


def squeezed(share: float) -> Rule:
    """Of a lift: close until the body is squeezed by so much, then rise."""
    return lambda seen, info: [0.4, 0.0] if info["compression"] < share else [0.0, 0.6]


def pushed(speed: float) -> Rule:
    """Of a push: ahead until something is touched, then along the line to the target; speed in parts of full speed."""

    def rule(seen: Numbers, info: dict[str, Any]) -> list[float]:
        now = dict(zip(push_gentle.SEEN, seen.tolist(), strict=True))
        if now["finger in contact"] == 0.0 and now["force ahead"] == 0.0:
            return [speed, 0.0]
        ahead, aside = 0.05 * now["target ahead of the marker"], 0.01 * now["target aside of it"]
        return [speed, 6.0 * speed * min(max(aside / max(ahead, push_gentle.NEAR), -0.5), 0.5)]

    return rule


def folded(actions: int) -> Rule:
    """Of a fold: half of a circle to the other edge in so many actions, then down to where the corners belong."""
    reach = TowelFold.speed * ACT / _EDGE

    def rule(seen: Numbers, info: dict[str, Any]) -> list[float]:
        taken = round(float(seen[-1]) * towel_fold.STEPS) + 1
        ways, to_go = seen[:6].astype(np.float64), seen[12:18].astype(np.float64)
        angle = math.pi * taken / actions
        goal = np.array([0.5 * (math.cos(angle) - 1.0), 0.0, 0.42 * math.sin(angle)] * 2)
        if taken > actions:
            goal = ways + 0.5 * to_go
        found: list[float] = ((goal - ways) / reach).tolist()
        return found

    return rule


_EDGE = 0.5
"""of the towel [m]"""


@dataclass(frozen=True)
class Stage:
    """Pieces of XPBD with cells of one size. The last stage of a training lasts to its end."""

    cell: float
    """edge [m]"""
    part: float = 0.0
    """of the training's actions that must be over before the next stage begins"""
    success: float = 0.0
    """of the last episodes that must succeed, too"""

    @property
    def settings(self) -> tuple[str, ...]:
        """Of the scene, as `softseam run --set` takes them."""
        return (f"body.cell=[{self.cell!r}, {self.cell!r}, {self.cell!r}]",)

    def over(self, part: float, success: float) -> bool:
        """Whether the next stage may begin, after a part of the training's actions."""
        return part >= self.part and success >= self.success

    def __str__(self) -> str:
        return f"cells of {1e3 * self.cell:.3g} mm"


COARSE_TO_FINE = (Stage(0.05 / 3.0, part=2.0 / 3.0, success=0.95), Stage(0.01))
"""of TofuLift: two thirds on pieces of 64 nodes, which take a fourth of the time of the 216 that end it"""


VERSION = 3
"""of what the tasks show and take; a policy of another one cannot be used"""


class Hardship(NamedTuple):
    """What a body suffers in an episode, beside how that ends: the less, the better."""

    name: str
    """in `info`, the largest so far"""
    title: str
    unit: str
    scale: float
    """of the unit in that of `info`"""

    def text(self, value: float) -> str:
        """With its unit."""
        return f"{value / self.scale:.2f} {self.unit}"


STRESS = Hardship("stress", "largest stress", "kPa", 1e3)
STRETCH = Hardship("stretch", "largest stretch", "%", 1e-2)


@dataclass(frozen=True)
class Task:
    """An environment, how it is learned, and the rules that a policy is measured against."""

    make: type[TaskEnv[Any]]
    models: tuple[LiftModel, ...]
    """that it can be learned in, the default first"""
    rules: Mapping[str, Rule]
    """by name"""
    steps: int
    """that learning takes by default"""
    environments: int
    """at a time, by default"""
    spread: tuple[float, float]
    """logarithm of the spread of PPO's actions at the beginning of a training, and at its end"""
    rollout: int = 2048
    """actions in all environments between PPO's updates: few where they are dear"""
    gamma: float = 0.998
    """what PPO discounts rewards by, an action: the less, the more haste pays"""
    deadline: bool = False
    """whether an episode that runs out of time is worth no more to the learner: who may put off the job for ever, and
    is rewarded as if, does"""
    hardship: Hardship = STRESS
    batch: type[BatchEnv] | None = None
    """many of it in one call, by XPBD"""
    stages: tuple[Stage, ...] = ()
    """of a training in such batches"""
    learning: Mapping[str, Any] = field(default_factory=dict)
    """what the environment is given while it is learned, and not where it is judged"""
    shaped: bool = False
    """whether its body is a shape of the user's"""

    def environment(self, **given: Any) -> TaskEnv[Any]:
        """As its constructor takes what is given."""
        make: Callable[..., TaskEnv[Any]] = self.make
        return make(**given)


_LIFTS = {"close to 1 N": pressed(1.0), "close to 2 N": pressed(2.0), "squeeze by 15 %": squeezed(0.15)}
_SMALL_LIFTS = {"close to 0.25 N": pressed(0.25), "close to 0.5 N": pressed(0.5), "squeeze by 15 %": squeezed(0.15)}

_FIRST_PUSH = (Nearness(), Heading(), Way(), Touch(), StressConcentration(Ramp(30e3, 80e3, 1.0)))

TASKS = {
    "TofuLift": Task(
        TofuLift,
        models=(BY_XPBD, BY_FEM),
        rules=_LIFTS,
        steps=300_000,
        environments=64,
        # an action of 1 squeezes by a twelfth: who explores widely to the end cannot learn to be gentle
        spread=(-0.5, -3.0),
        batch=BatchEnv,
        stages=COARSE_TO_FINE,
    ),
    "SliceLift": Task(
        SliceLift,
        models=(BY_FEM,),
        rules=_SMALL_LIFTS,
        steps=100_000,
        environments=16,
        spread=(-0.5, -3.0),
        shaped=True,
    ),
    "PushGentle": Task(
        PushGentle,
        models=(BY_FEM,),
        rules={"ahead at 12 % of full speed": pushed(0.12), "at full speed": pushed(1.0)},
        steps=100_000,
        environments=16,
        spread=(-0.7, -3.5),
        rollout=1024,
        gamma=0.99,
        deadline=True,
        # noise alone bruises: so first a piece bears more, then it is pushed gently
        learning={"stress_limit": Ramp(20e3, 70e3, end=STRESS_LIMIT, start=4e3), "reward": _FIRST_PUSH},
    ),
    "TowelFold": Task(
        TowelFold,
        models=("xpbd",),
        rules={"half of a circle": folded(60)},
        steps=200_000,
        environments=16,
        spread=(-1.0, -3.0),
        hardship=STRETCH,
    ),
}


def task_of(name: str) -> Task:
    """The row. Raises BadInput where there is none."""
    if name not in TASKS:
        raise BadInput(f"no task is called {name!r} (there are: {', '.join(TASKS)})")
    return TASKS[name]
