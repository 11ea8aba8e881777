"""What a first start compiles: a table of kernels with processor seconds.

By hand: python tests/benchmarks/first_start.py tofu_grasp [--steps 3] [--model pbd]

Compiles in this process alone, into an empty folder, what a session of the scene needs; what a run compiles beside
itself is in it. A kernel's own seconds are without those of the kernels that it calls. `part` is linked into what calls
it, `whole` is what Python enters, `aside` what is compiled when it is first called, `numba` numba's own.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections import defaultdict
from time import process_time
from typing import Any


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--steps", type=int, default=3)
    parser.add_argument("--model")
    parser.add_argument("--rows", type=int, default=40)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as empty:
        os.environ["NUMBA_CACHE_DIR"] = empty
        _measure(options)


def _measure(options: argparse.Namespace) -> None:
    from numba.core.event import Event, Listener, install_listener

    import softseam

    class Kernels(Listener):
        """Seconds of each kernel, and of those that compiled while it did."""

        def __init__(self) -> None:
            self.open: list[list[float]] = []
            self.count: dict[tuple[str, str], int] = defaultdict(int)
            self.own: dict[tuple[str, str], float] = defaultdict(float)
            self.all: dict[tuple[str, str], float] = defaultdict(float)

        def on_start(self, event: Event) -> None:
            self.open.append([process_time(), 0.0])

        def on_end(self, event: Event) -> None:
            began, below = self.open.pop()
            took, kernel = process_time() - began, event.data["dispatcher"]
            if self.open:
                self.open[-1][1] += took
            key = _kind(kernel), f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"
            self.count[key] += 1
            self.own[key] += took - below
            self.all[key] += took

    kernels = Kernels()
    with install_listener("numba:compile", kernels):
        began = process_time()
        with softseam.open(options.scene, model=options.model) as session:
            session.reset()
            for _ in range(options.steps):
                session.step()
        total = process_time() - began
    print(f"{options.scene}: {total:.1f} s of processor time, {sum(kernels.own.values()):.1f} of it in kernels")
    for kind in ("whole", "aside", "part", "numba"):
        keys = [key for key in kernels.own if key[0] == kind]
        own, count = sum(kernels.own[key] for key in keys), sum(kernels.count[key] for key in keys)
        print(f"{kind:6} {own:6.1f} s, {count} of {len(keys)} kernels")
    print("\n   own s   with all s   times  kernel")
    for key in sorted(kernels.own, key=lambda key: -kernels.own[key])[: options.rows]:
        print(f"{kernels.own[key]:8.2f}{kernels.all[key]:13.2f}{kernels.count[key]:8}  {key[0]:6} {key[1]}")


def _kind(kernel: Any) -> str:
    if not type(kernel).__module__.startswith("softseam"):
        return "numba"
    if type(kernel).__name__ == "_Part":
        return "part"
    return "whole" if kernel.aside is None else "aside"


if __name__ == "__main__":
    main()
