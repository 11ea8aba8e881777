"""Learn how gently tofu can be gripped: the cross-entropy method on a rule of three numbers, in half a minute.

The rule closes the plates at some speed until the tofu is squeezed by some part, then rises at some speed. No two
pieces of tofu are alike, and what is found must lift all of them: too gentle a grip slips.

python -m softseam.examples.learn_grip
"""

import numpy as np
from numpy.typing import NDArray

from softseam.gym import TofuLift
from softseam.gym.reward import Lift, StressConcentration

GENERATIONS, CANDIDATES, BEST = 5, 12, 3
PIECES, OTHERS = range(6), range(100, 112)
"""seeds of tofu to learn from, and to try on what was learned"""
LOW, HIGH = np.array([0.1, 0.01, 0.1]), np.array([1.0, 0.40, 1.0])
"""of closing speed [5 cm/s], squeeze [1] and rising speed [5 cm/s]"""

Floats = NDArray[np.float64]


def main() -> None:
    random = np.random.default_rng(0)
    mean, spread = 0.5 * (LOW + HIGH), 0.3 * (HIGH - LOW)
    env = TofuLift(reward=[Lift(), StressConcentration(0.5)])  # from the start: a rule of three numbers needs no hints
    print("generation  return  lifted   closing  squeeze    rising")
    for generation in range(GENERATIONS):
        rules = np.clip(random.normal(mean, spread, (CANDIDATES, 3)), LOW, HIGH)
        # all rules on one piece of tofu, then on the next: the same piece again needs no other simulation
        returns, lifted = np.mean([[episode(env, rule, seed) for rule in rules] for seed in PIECES], axis=0).T
        print(
            f"{generation:10d}  {returns.mean():6.3f}  {lifted.mean():6.0%}  "
            f"{5 * mean[0]:.1f} cm/s  {mean[1]:7.0%}  {5 * mean[2]:.1f} cm/s"
        )
        best = rules[np.argsort(returns)[-BEST:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.02 * (HIGH - LOW)
    returns, lifted = np.mean([episode(env, mean, seed) for seed in OTHERS], axis=0)
    print(
        f"on {len(OTHERS)} other pieces of tofu: return {returns:.3f}, {lifted:.0%} lifted, squeezed by {mean[1]:.1%}"
    )
    env.close()


def episode(env: TofuLift, rule: Floats, seed: int) -> tuple[float, bool]:
    """Sum of the rewards of one episode, and whether the tofu was lifted."""
    closing, squeeze, rising = rule
    total, over = 0.0, False
    _, info = env.reset(seed=seed)
    while not over:
        action = [closing, 0.0] if info["compression"] < squeeze else [0.0, rising]
        _, reward, terminated, truncated, info = env.step(action)
        total, over = total + reward, terminated or truncated
    return total, info["is_success"]


if __name__ == "__main__":
    main()
