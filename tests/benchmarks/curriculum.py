"""Is a rule learned sooner where XPBD teaches first? The table of docs/decisions/59, of a rule of four numbers.

The cross-entropy method looks for how fast pads close in air and in touch, until which squeeze, and how fast they rise.
Each way is a number of generations by FEM or by XPBD of some cells; all are judged by FEM on pieces of their own.

By hand: python tests/benchmarks/curriculum.py [--seeds N ...] [--ways NAME ...]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softseam.gym import BatchEnv, TofuLift
from softseam.gym.reward import Lift, StressConcentration, Touch, Way

Floats = NDArray[np.float64]
Judge = Callable[[Floats, int, int], tuple[Floats, Floats]]
"""rules (k, 4), first seed and number of pieces: return of each episode (k, pieces), and whether it lifted"""

REWARD = (Lift(), Way(), Touch(), StressConcentration(0.5))
CANDIDATES, BEST, PIECES = 12, 3, 12
LOW, HIGH = np.array([0.1, 0.05, 0.01, 0.1]), np.array([1.0, 1.0, 0.40, 1.0])
"""of closing in air and in touch [5 cm/s], squeeze [1] and rising [5 cm/s]"""
JUDGED, ACTIONS = (1_000_000, 24), 80
"""first seed and number of the pieces that judge; actions of an episode"""
WAYS: dict[str, tuple[tuple[str, int], ...]] = {
    "FEM": (("fem", 7),),
    "XPBD": (("xpbd 2", 6), ("xpbd 4", 3)),
    "XPBD, one of FEM": (("xpbd 2", 6), ("xpbd 4", 3), ("fem", 1)),
    "XPBD, two of FEM": (("xpbd 2", 6), ("xpbd 4", 3), ("fem", 2)),
    "XPBD of fine cells": (("xpbd 5", 9),),
    "XPBD of fine cells, one of FEM": (("xpbd 5", 8), ("fem", 1)),
    "XPBD of fine cells, two of FEM": (("xpbd 5", 8), ("fem", 2)),
}
"""each a list of who teaches, and for how many generations; xpbd N is of N x N x N cells"""


def action(rules: Floats, force: Floats, squeezed: Floats) -> Floats:
    """Of each rule (k, 2), where its pads press with a force [N] and squeeze by a part."""
    air, touch, squeeze, rise = rules.T
    closing, still = np.where(force > 0.0, touch, air), np.zeros(len(rules))
    close, up = np.stack([closing, still], axis=1), np.stack([still, rise], axis=1)
    return np.asarray(np.where((squeezed < squeeze)[:, None], close, up))


def by_fem() -> Judge:
    """All rules on one piece, then on the next: the same piece again needs no other factor's order."""
    env = TofuLift(reward=REWARD)

    def judge(rules: Floats, first: int, pieces: int) -> tuple[Floats, Floats]:
        returns, lifted = np.zeros((len(rules), pieces)), np.zeros((len(rules), pieces))
        for piece in range(pieces):
            for k, rule in enumerate(rules):
                _, info = env.reset(seed=first + piece)
                while not info["ending"]:
                    now = np.array([info["grip_force"]]), np.array([info["compression"]])
                    _, reward, _, _, info = env.step(action(rule[None], *now)[0])
                    returns[k, piece] += reward
                lifted[k, piece] = info["is_success"]
        return returns, lifted

    return judge


def by_xpbd(cells: int) -> Judge:
    """All rules on all pieces at once."""
    edge = 0.05 / cells
    settings = [f"body.cell=[{edge!r}, {edge!r}, {edge!r}]"]
    envs: dict[int, BatchEnv] = {}

    def judge(rules: Floats, first: int, pieces: int) -> tuple[Floats, Floats]:
        n = len(rules) * pieces
        if n not in envs:
            envs[n] = BatchEnv(n, reward=REWARD, settings=settings)
        each, seeds = np.repeat(rules, pieces, axis=0), [first + piece for _ in rules for piece in range(pieces)]
        _, info = envs[n].reset(seed=seeds)
        going, returns, lifted = np.ones(n, dtype=np.bool_), np.zeros(n), np.zeros(n)
        for _ in range(ACTIONS):
            _, reward, ended, late, info = envs[n].step(action(each, info["grip_force"], info["compression"]))
            returns += np.where(going, reward, 0.0)
            lifted += going & info["is_success"]
            going &= ~(ended | late)
            if not going.any():
                break
        return returns.reshape(len(rules), pieces), lifted.reshape(len(rules), pieces)

    return judge


def learned(way: tuple[tuple[str, int], ...], judges: dict[str, Judge], seed: int) -> Floats:
    """The rule that a way comes to (4,)."""
    random, mean, spread = np.random.default_rng(seed), 0.5 * (LOW + HIGH), 0.3 * (HIGH - LOW)
    generation = 0
    for teacher, generations in way:
        for _ in range(generations):
            rules = np.clip(random.normal(mean, spread, (CANDIDATES, 4)), LOW, HIGH)
            returns, _ = judges[teacher](rules, 1000 * (1 + seed) + PIECES * generation, PIECES)
            best = rules[np.argsort(returns.mean(axis=1))[-BEST:]]
            mean, spread = best.mean(axis=0), best.std(axis=0) + 0.02 * (HIGH - LOW)
            generation += 1
    return np.asarray(mean, np.float64)


def main() -> None:
    """Print a line a way and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1])
    parser.add_argument("--ways", nargs="*", default=list(WAYS), choices=list(WAYS))
    wanted = parser.parse_args()
    teachers = {teacher for name in wanted.ways for teacher, _ in WAYS[name]} | {"fem"}
    judges = {each: by_fem() if each == "fem" else by_xpbd(int(each.split()[1])) for each in sorted(teachers)}
    for each, judge in judges.items():  # compiles, and makes room
        judge(np.tile(0.5 * (LOW + HIGH), (CANDIDATES, 1)), 0, 1 if each == "fem" else PIECES)
    for seed in wanted.seeds:
        for name in wanted.ways:
            began = time.process_time()
            rule = learned(WAYS[name], judges, seed)
            spent = time.process_time() - began
            returns, lifted = judges["fem"](rule[None], *JUDGED)
            print(
                f"seed {seed}, {name}: {spent:.1f} s, return {returns.mean():.3f}, {lifted.mean():.0%} lifted, "
                f"rule {np.array2string(rule, precision=3)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
