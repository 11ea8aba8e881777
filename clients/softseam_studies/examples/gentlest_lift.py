"""Find the gentlest lift of one piece of tofu by gradients, in half a minute, and hold it against rules.

A plan is how fast the pads close and rise, 36 times .04 s. Its loss is the largest force of a pad (a p-norm over the
run, which has a slope everywhere) and what lacks of the lift; `Session.gradient` says what both owe to each tool's way
in each step, and L-BFGS goes down from there. Where pads begin to slip the loss has an edge, and the gentlest plan lies
on it. So the plan is made for less friction than the tofu has, and judged by FEM with what it has, at a quarter of the
step.

A learned policy must lift pieces that it has not seen: on this one it cannot be gentler than what is found here.

python -m softseam_studies.examples.gentlest_lift [FOLDER OF A POLICY]
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from softseam.errors import BadInput
from softseam.gym import TofuLift
from softseam.losses import Run, Slope
from softseam_studies.learn.evaluate import episode, learned
from softseam_studies.learn.policy import POLICY, read_training
from softseam_studies.learn.tasks import TASKS, Rule

Floats = NDArray[np.float64]

ACTIONS, RUNS = 36, 120
MARGIN = 0.75
"""friction that the plan is made for, of what the tofu has [1]"""
HEIGHT = 0.031
"""to lift by, 1 mm more than is asked for [m]"""
NORM, WORTH = 16.0, 200.0
"""exponent of the norm, and newtons that the whole of the lift is worth"""


def main(policy: Path | None = None) -> None:
    first = squeeze_and_rise()
    plan = found(first)
    print("                     lifted  largest stress")
    show("begun with", along(first))
    show("found by gradient", along(plan))
    for name, rule in TASKS["TofuLift"].rules.items():
        show(name, rule)
    if policy is not None:
        env = TofuLift()
        show("learned", learned((policy / POLICY).read_bytes(), read_training(policy).algorithm, env))
        env.close()


def squeeze_and_rise() -> Floats:
    """Close until the pads hold for certain, then rise; of each action the parts of 5 cm/s (ACTIONS, 2)."""
    plan = np.zeros((ACTIONS, 2))
    plan[:12, 0], plan[13:30, 1] = 0.85, 0.9
    return plan


def found(plan: Floats) -> Floats:
    """The best plan of some RUNS runs, from this one on."""
    env = TofuLift(randomise=None)
    friction = env.scene.tools["left"].friction
    env.close()
    env = TofuLift(randomise=None, settings=[f"tools.{pad}.friction={MARGIN * friction}" for pad in ("left", "right")])
    env.reset(seed=0)
    best, runs, printed = (np.inf, plan), 0, np.inf

    def loss(numbers: Floats) -> tuple[float, Floats]:
        nonlocal best, runs, printed
        plan, runs = numbers.reshape(ACTIONS, 2), runs + 1
        speed = env.speed * plan
        commands = [{"left": [close, 0.0, rise], "right": [-close, 0.0, rise]} for close, rise in speed]
        try:
            gradient = env.session.gradient(hard_to_hold, ["way.left", "way.right"], commands=commands)
        except BadInput:  # a step that is taken in parts: go less far
            return WORTH, np.zeros(2 * ACTIONS)
        if gradient.value < 0.95 * printed:
            printed = gradient.value
            print(f"run {runs:3d}: {printed:6.2f} N")
        if gradient.value < best[0]:
            best = (gradient.value, plan.copy())
        left, right = np.asarray(gradient["way.left"]), np.asarray(gradient["way.right"])
        way = np.stack([left[:, 0] - right[:, 0], left[:, 2] + right[:, 2]], axis=1)
        return gradient.value, (env.speed * env.session.scene.step * way).ravel()

    bounds = [(-1.0, 1.0), (0.0, 1.0)] * ACTIONS
    while runs < RUNS:  # over an edge L-BFGS loses its way: begin again from the best
        before = runs
        minimize(loss, best[1].ravel(), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxfun": RUNS - runs})
        if runs - before < 3:
            break
    env.close()
    return best[1]


def hard_to_hold(run: Run) -> tuple[float, Slope]:
    """The p-norm of the pads' forces [N], and what the square of the missing lift is worth."""
    push = {pad: run.force[pad][:, 0] for pad in ("left", "right")}
    most = max(1e-6, *(float(np.abs(force).max()) for force in push.values()))
    norm = most * float(sum(np.sum((np.abs(force) / most) ** NORM) for force in push.values())) ** (1.0 / NORM)
    by_force = {}
    for pad, force in push.items():
        by_force[pad] = np.zeros((len(force), 3))
        by_force[pad][:, 0] = np.sign(force) * (np.abs(force) / max(norm, most)) ** (NORM - 1.0)
    rise = float(run.positions[-1, :, 2].mean() - run.start[:, 2].mean())
    lacks = max(0.0, 1.0 - rise / HEIGHT)
    by_position = np.zeros_like(run.positions)
    by_position[-1, :, 2] = -2.0 * WORTH * lacks / HEIGHT / run.positions.shape[1]
    return norm + WORTH * lacks * lacks, Slope(by_force, by_position)


def along(plan: Floats) -> Rule:
    """Take a plan's actions, one after the other, and stand still when they are over."""
    left = iter([*plan.tolist(), *np.zeros((200, 2)).tolist()])
    return lambda seen, info: next(left)


def show(name: str, act: Rule) -> None:
    """Lift the piece at steps of 10 ms, and print what came of it."""
    env = TofuLift(randomise=None, step=0.01)
    info = episode(env, act, 0)
    env.close()
    print(f"{name:20s} {'yes' if info['is_success'] else 'no':>6s}  {1e-3 * info['stress']:10.2f} kPa")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
