"""What cells that follow a sphere change: `python tests/benchmarks/round_core.py [--step 0.02]`.

stiff_inclusion by one model alone, on equal cells, whose octants make up the core, and on cells that follow it. Values
are of the end of the last hold; CPU seconds without compiling.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Literal

from softseam.variants import with_model
from softseam_protocol.scene.file import load_scene
from softseam_studies.study.measure import measure

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "stiff_inclusion.yaml"
EDGE = 0.05
"""of the block [m]"""
QUANTITIES = ("grip_force", "sag", "core.von_mises", "beside.von_mises")
RUNS: tuple[tuple[Literal["fem", "pbd"], str, int], ...] = (
    *(("fem", "even", across) for across in (2, 4, 6, 8)),
    *(("fem", "materials", across) for across in (1, 2, 4, 5, 7)),
    *(("pbd", "even", across) for across in (4, 8)),
    *(("pbd", "materials", across) for across in (1, 2, 4)),
)
"""model, where cells end, and wanted cells along the block's edge"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--step", type=float, default=0.02, help="[s]")
    given = parser.parse_args()
    print("| cells | grip [N] | sag [mm] | core [kPa] | beside [kPa] | CPU [s] |\n|---|---|---|---|---|---|")
    for model, borders, across in RUNS:
        scene = with_model(load_scene(SCENE).scene, model)
        cells = [f"body.cell={EDGE / across}", f"body.shape.borders={borders}", f"step={given.step}"]
        outcome = measure(scene, cells, QUANTITIES, runs=0, limit=600.0)
        if outcome.series is None:
            raise SystemExit(f"{model}, {borders}, {across} across: {outcome.reason}")
        grip, sag, core, beside = (float(outcome.series.values[name][-1]) for name in QUANTITIES)
        label = f"{model}, {outcome.n_cells} {'equal' if borders == 'even' else 'round'}"
        facts = f"{grip:.2f} | {1e3 * sag:.2f} | {1e-3 * core:.2f} | {1e-3 * beside:.2f} | {outcome.cpu:.1f}"
        print(f"| {label} | {facts} |", flush=True)


if __name__ == "__main__":
    main()
