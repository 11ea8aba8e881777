"""What stress beside tools' edges takes: `python tests/benchmarks/cells_by_axis.py [SCENE [CELLS ...]]`.

FEM alone on cells to tools' edges, counted and graded along each axis by itself: 16x2x8/8x1x8/20 is about 16, 2 and 8
cells along x, y and z, eight times thinner at edges and faces along x and z, in steps of 20 ms. Errors are those of a
chart, against the run that is given last, which is to be the finest; docs/decisions/16 has the table.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from softseam.columns import rms
from softseam.scenes import load_scene
from softseam.variants import AS_GIVEN, with_settings
from softseam_studies.study.configurations import Fem
from softseam_studies.study.errors import scale_of
from softseam_studies.study.frame import Frame, frame_of
from softseam_studies.study.measure import Outcome, measure, quantity_names

TRIED = (
    "4x4x1/1/80", "6x6x2/4x1x1/80", "6x2x4/4x1x4/80", "8x2x3/8x1x8/80", "12x2x4/8x1x8/80", "8x2x3/8x1x8/10",
    "16x2x6/4x1x4/20", "24x2x8/4x1x4/20", "16x2x8/8x1x8/20", "16x2x8/8x1x8/10", "24x2x12/8x1x8/40", "32x2x16/8x1x8/40",
    "16x8x12/8x1x8/40", "16x2x12/8x1x8/40", "16x2x12/8x1x8/10", "16x2x12/8x1x8/2.5",
)  # fmt: skip


@dataclass(frozen=True)
class Cells:
    """What is asked for: numbers of cells and how many times thinner they are along x, y and z, and the step [s]."""

    counts: tuple[int, int, int]
    grading: tuple[float, float, float]
    step: float

    @classmethod
    def parse(cls, text: str) -> Cells:
        """Raises ArgumentTypeError where the text says anything else."""
        try:
            counts, grading, step = text.split("/")
            x, y, z = map(int, counts.split("x"))
            along = tuple(map(float, grading.split("x")))
            a, b, c = along * 3 if len(along) == 1 else along
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r}: say e.g. 16x2x8/8x1x8/20: cells/grading/step in ms") from None
        return cls((x, y, z), (a, b, c), 1e-3 * float(step))

    def fem(self, frame: Frame) -> Fem:
        """The configuration that has them."""
        towards = frame.edged
        counts = frame.folding(self.counts, towards)
        return Fem(frame, counts, self.step, grading=self.grading, towards=towards)


def errors(run: Outcome, finest: Outcome, names: tuple[str, ...]) -> list[float]:
    """Of each quantity, as in a chart, at the longer of both runs' steps [1]."""
    assert run.series is not None and finest.series is not None
    true, found = finest.series, []
    time = max(run.series.time, true.time, key=lambda t: t[1])
    time = time[time <= min(run.series.time[-1], true.time[-1]) + 1e-9]
    for name in names:
        values = true.at(name, time)
        scale = scale_of(name, values, np.interp(time, true.time, true.travel), time)
        found.append(rms(run.series.at(name, time) - values, time) / scale)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", default="tofu_slab")
    parser.add_argument("cells", nargs="*", type=Cells.parse, default=list(map(Cells.parse, TRIED)))
    asked = parser.parse_args()
    scene = with_settings(load_scene(asked.scene), AS_GIVEN)
    frame, console = frame_of(scene, asked.scene, AS_GIVEN), Console()
    names = tuple(name for name in quantity_names(scene) if name not in ("peak_von_mises", "compression"))
    tried = [each.fem(frame).configuration() for each in asked.cells]
    runs: list[Outcome] = []
    for each in tried:
        with console.status(each.label):
            runs.append(measure(asked.scene, each.settings, quantity_names(scene), runs=1, limit=3600.0))
        console.print(f"{each.label}: {runs[-1].reason or f'{runs[-1].seconds:.3g} s'}", highlight=False)
    table = Table("cells, step", "real-time factor", *names)
    for each, run in zip(tried, runs, strict=True):
        if run.series is not None and runs[-1].series is not None:
            off = (f"{100 * error:.1f}" for error in errors(run, runs[-1], names))
            table.add_row(each.label.removeprefix("FEM "), f"{run.rtf:.2g}", *off)
    console.print("errors [%], against the last:", table)


if __name__ == "__main__":
    main()
