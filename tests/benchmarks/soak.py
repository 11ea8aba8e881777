"""A million random actions on many pieces of tofu, and some thousand on each environment: no number that is none, every
refusal by name, and the same bits again.

By hand: PYTHONPATH=tests python tests/benchmarks/soak.py [--actions N] [--single N] [--pieces N] [--threads N]
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

from episodes import bits, soak, soak_many

from softseam.gym import BatchEnv, PushGentle, SliceLift, TofuLift, TowelFold


def main() -> None:
    """Print a line an environment: how episodes ended, and how long it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--actions", type=int, default=1_000_000)
    parser.add_argument("--single", type=int, default=3000)
    parser.add_argument("--pieces", type=int, default=256)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    wanted = parser.parse_args()
    for make in (TofuLift, SliceLift, PushGentle, TowelFold):
        env, fresh, began = make(), make(), time.perf_counter()
        words = soak(env, wanted.single, wanted.seed)
        same = all(bits(env, seed, 30) == bits(fresh, seed, 30) for seed in range(3))
        env.close()
        fresh.close()
        _say(make.__name__, wanted.single, words, time.perf_counter() - began)
        print(
            f"  episodes after all of that have the bits of a fresh environment: {'yes' if same else 'NO'}", flush=True
        )
    envs, began = BatchEnv(wanted.pieces, threads=wanted.threads), time.perf_counter()
    words = soak_many(envs, wanted.actions, wanted.seed)
    envs.close()
    _say(f"BatchEnv, {wanted.pieces} pieces", wanted.actions, words, time.perf_counter() - began)


def _say(name: str, actions: int, words: Counter[str], seconds: float) -> None:
    ended = ", ".join(f"{count} {word}" for word, count in sorted(words.items()))
    print(f"{name}: {actions:,} actions in {seconds:.0f} s, all finite; episodes: {ended}", flush=True)


if __name__ == "__main__":
    main()
