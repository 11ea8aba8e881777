"""FEM on cases that independent codes have solved: `python tests/benchmarks/references.py [CASE ...]`.

Each case on ever finer cells, every level in a process of its own: error of each quantity against the reference, CPU
seconds of one thread with the compiler's left out (the coarsest level runs twice), peak memory of the process; then the
order that the errors fit, and the value that the two finest levels point to with it. Prints a table in Markdown.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from reference_beams import bar, hanging, swing
from reference_cases import bonded, indentation, pad
from reference_structures import AXIAL, COOK, FREQUENCIES, TORQUE, cook, frequencies, twist
from reference_values import BONDED, HANGING, INDENTATION, PAD, SWING, Found, errors, fitted_order

ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
NAMES = ("bending", "bending across", "torsion", "second bending", "second across", "stretching")


def _swing(n: int) -> Found:
    found = swing(n, 0.002 / n)
    return errors(found, SWING) | {"farthest off": found["farthest off"]}


CASES: dict[str, tuple[str, tuple[int, ...], Callable[[int], Found]]] = {
    "hanging": ("5n x n x n", (1, 2, 4), lambda n: errors(hanging(n), HANGING)),
    "cook": ("n x n x 1", (2, 4, 8, 16), lambda n: {"tip": cook("hex27", n) / COOK - 1.0}),
    "swing": ("5n x n x n", (1, 2, 3), _swing),
    "frequencies": (
        "4n x n x n",
        (1, 2, 4),
        lambda n: dict(zip(NAMES, frequencies("hex27", n) / np.array(FREQUENCIES) - 1.0, strict=True)),
    ),
    "bonded": ("n x n x n, an eighth", (2, 4, 6), lambda n: errors(bonded(n), BONDED)),
    "indentation": ("n x n x 4n/5", (6, 8, 10, 12), lambda n: errors(indentation(n), INDENTATION)),
    "torsion": (
        "n x n x 4n",
        (1, 2, 3, 4),
        lambda n: dict(
            zip(("torque", "axial force"), np.array(twist("hex27", n)) / [TORQUE, AXIAL] - 1.0, strict=True)
        ),
    ),
    "bar": ("n x 1 x 1", (20, 40, 80, 160), bar),
    "pad": ("n x n x n", (5, 10, 15), lambda n: errors(pad(n), PAD)),
}


def measure(case: str, n: int, again: bool) -> None:
    """One level in this process, as a line of JSON."""
    run = CASES[case][2]
    if again:
        run(CASES[case][1][0])
    began = time.process_time()
    found = run(n)
    seconds = time.process_time() - began
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(json.dumps({"found": found, "seconds": seconds, "memory": memory}))


def table(case: str) -> None:
    """The levels of a case, one after another."""
    cells, levels, _ = CASES[case]
    done = []
    for n in levels:
        command = [sys.executable, __file__, case, "--level", str(n)]
        text = subprocess.run(
            command, check=True, stdout=subprocess.PIPE, text=True, env={**os.environ, **ONE_THREAD}
        ).stdout
        done.append(json.loads(text.splitlines()[-1]))
    columns = " | ".join(f"n = {n}" for n in levels)
    print(f"\n**{case}**, {cells} cells, error [%]\n\n| | {columns} | order |\n|---|{'---|' * (len(levels) + 1)}")
    for name in done[0]["found"]:
        wrong = [each["found"][name] for each in done]
        order = fitted_order([1.0 / n for n in levels], wrong)
        print(f"| {name} | {' | '.join(f'{100.0 * value:.2f}' for value in wrong)} | {order:.1f} |")
    for title, key in (("CPU [s]", "seconds"), ("memory [MB]", "memory")):
        print(f"| {title} | {' | '.join(f'{each[key]:.1f}' for each in done)} | |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", help=f"of {', '.join(CASES)}; all where none is named")
    parser.add_argument("--level", type=int, help="this level alone, as JSON")
    given = parser.parse_args()
    if given.level is not None:
        measure(given.cases[0], given.level, True)
        return
    for case in given.cases or CASES:
        table(case)


if __name__ == "__main__":
    main()
