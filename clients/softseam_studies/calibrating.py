"""`softseam calibrate`: what XPBD really shows of a body at each count of substeps and sweeps, and which to take."""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.embedded import calibration, solver_digest
from softseam.errors import BadInput
from softseam.outputs import check_ending, check_outputs
from softseam.report import write_report
from softseam.scenes import bundle_of, bundle_with, inputs_of
from softseam.variants import with_settings
from softseam_protocol.facts import machine
from softseam_protocol.scene.file import scene_hash
from softseam_protocol.scene.scene import Scene
from softseam_studies.cli_studies import Calibrate
from softseam_studies.study.store import Identity, Store, cache_folder

if TYPE_CHECKING:
    from softseam.embedded import Calibration


def calibrate(wishes: Calibrate, console: Console) -> None:
    """Measure, or read from the cache, and print. Raises BadInput and SceneRefused."""
    if not 0.0 < wishes.tolerance < 1.0:
        raise BadInput(f"--tolerance {wishes.tolerance}: a share between 0 and 1, e.g. 0.05")
    loaded, bundle = bundle_of(wishes.scene)
    if wishes.report is not None:
        check_ending("--report", wishes.report, ".json", "a report")
        check_outputs([("--report", wishes.report)], inputs=inputs_of(wishes.scene))
    scene = with_settings(loaded, wishes.settings)
    if scene is not loaded:
        bundle = bundle_with(scene, bundle, wishes.scene, wishes.settings)
    key, code, here = scene_hash(bundle), solver_digest(), machine()
    short = hashlib.sha256(f"{key}{code}{here}{wishes.tolerance}".encode()).hexdigest()[:16]
    store = Store(
        cache_folder().with_name("calibrations") / f"{scene.name}-{short}",
        Identity(key, code, here),
        "calibrate anew with --fresh",
    )
    if wishes.fresh:
        store.clear()
    kept = store.read("calibration")
    found = wanted, shown, chosen = calibration(scene, bundle, wishes.tolerance, kept)
    figures = {"wanted": asdict(wanted), "shown": [asdict(each) for each in shown]}
    if kept is None:
        store.write("calibration", figures)
    _print(console, scene, found, wishes.tolerance)
    if wishes.report is not None:
        document = {
            "scene": {"name": scene.name, "hash": key, "step": scene.step},
            "machine": here,
            "tolerance": wishes.tolerance,
            "units": {"young": "Pa", "frequency": "Hz", "loss": "of the amplitude a period", "seconds": "s a step"},
            **figures,
            "recommended": None if chosen is None else {"substeps": chosen.substeps, "sweeps": chosen.sweeps},
        }
        write_report(document, wishes.report)


def _print(console: Console, scene: Scene, found: Calibration, tolerance: float) -> None:
    wanted, shown, chosen = found
    table = Table(
        title=f"slowest oscillation of {scene.name}: frequency, Young's modulus, loss a period", title_justify="left"
    )
    for name in ("substeps", "sweeps", "", "f [Hz]", "E [kPa]", "loss [%]", "ms a step"):
        table.add_column(name, justify="right", no_wrap=True)
    row = ["", "", "wanted", f"{wanted.frequency:.4g}", f"{1e-3 * wanted.young:.4g}", f"{1e2 * wanted.loss:.2g}", ""]
    table.add_row(*row, style="bold", end_section=True)
    for each in sorted(shown, key=lambda s: (s.sweeps, s.substeps)):
        remark = "recommended" if each is chosen else "auto" if each.auto else ""
        row = [str(each.substeps), str(each.sweeps), remark if each.stable else "unstable"]
        row += [f"{each.frequency:.4g}", f"{1e-3 * each.young:.4g}", f"{1e2 * each.loss:.2g}"]
        style = "green" if each is chosen else "" if each.within(tolerance) else "dim"
        table.add_row(*row, f"{1e3 * each.seconds:.3g}", style=style)
    console.print(table)
    cells = (wanted.blocks / wanted.frequency) ** 2 - 1.0
    console.print(
        Text(
            f"Of Young's modulus {1e2 * cells:+.1f} % are the blocks' own, however short the substep: "
            "smaller cells mend it. The loss goes with the substep; in a grip at rest it costs nothing.",
            style="dim",
        )
    )
    share = f"{1e2 * tolerance:.3g} %"
    if chosen is None:
        console.print(Text(f"nothing that was tried is within {share}: allow more with --tolerance", style="yellow"))
    else:
        setting = f"models: {{pbd: {{substeps: {chosen.substeps}, sweeps: {chosen.sweeps}}}}}"
        console.print(Text(f"cheapest within {share}:  {setting}", style="green"))
