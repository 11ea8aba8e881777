"""How wrong the PBD participant is, against substeps and cells.

By hand: PYTHONPATH=tests python tests/benchmarks/pbd_errors.py. Half a minute on one core; the cases: `pbd_cases.py`.
"""

from __future__ import annotations

from pbd_cases import BONDED, bar_wave, beam_at_rest, beam_falls, bonded_cube, order
from rich.console import Console
from rich.table import Table


def main() -> None:
    console = Console()
    across = [2, 4, 6, 8]
    rest = [beam_at_rest(a) for a in across]
    cubes = {squeeze: [bonded_cube(a, squeeze) for a in across] for squeeze in BONDED}
    table = Table("blocks across", *map(str, across), "order")
    table.add_row("beam at rest, tip", *[f"{e:+.2%}" for e in rest], f"{order([1 / a for a in across], rest):.1f}")
    for squeeze, errors in cubes.items():
        cells = [f"{e:+.2%}" for e in errors]
        table.add_row(f"bonded cube, force at {squeeze:.0%}", *cells, f"{order([1 / a for a in across], errors):.1f}")
    console.print(table)
    shares = [1, 2, 4, 8, 16]
    table = Table("fall; across", "substeps", *[f"x {s}" for s in shares], "order in h")
    for a in (2, 4, 6):
        planned = beam_falls(a, "auto")[1]
        errors = [beam_falls(a, s * planned)[0] for s in shares]
        limit = 2.0 * errors[-1] - errors[-2]
        slope = order([1.0 / s for s in shares[:-1]], [e - limit for e in errors[:-1]])
        table.add_row(str(a), str(planned), *[f"{e:+.2%}" for e in errors], f"{slope:.1f}")
    console.print(table)
    table = Table("pulse; along", *[f"{s}: peak, tail" for s in ("auto", 4, 16)])
    for n in (40, 80, 160):
        row = [bar_wave(n, s) for s in ("auto", 4, 16)]
        table.add_row(str(n), *[f"{peak:+.1%}, {tail:.1%}" for peak, tail in row])
    console.print(table)


if __name__ == "__main__":
    main()
