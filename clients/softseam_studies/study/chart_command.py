"""`softseam chart`: from a scene to a picture, a page, and tables of accuracy against speed."""

import io
import os
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

from rich.console import Console

from softseam.errors import BadInput, SoftseamError, missing_extra, require_extra
from softseam.outputs import check_outputs
from softseam.report import write_json
from softseam.scenes import inputs_of
from softseam.view.colors import label
from softseam_studies.cli_studies import Chart
from softseam_studies.cluster import reach
from softseam_studies.study.classic import classic_configurations
from softseam_studies.study.configurations import METHODS, configurations
from softseam_studies.study.errors import not_counted
from softseam_studies.study.landmarks import Landmark, asked_of, read_rivals
from softseam_studies.study.progress import ChartProgress
from softseam_studies.study.reference import Reference, described, origin
from softseam_studies.study.store import Store
from softseam_studies.study.study import Study, reference_of, study_of
from softseam_studies.study.sweep import finished, sweep
from softseam_studies.study.table import Row, busy, row_json, rows_of, write_csv

CHART_VERSION = 1
LEFT = ("chart.png", "chart.html", "chart.csv", "chart.json")
"""files that a chart consists of"""
REFERENCE_SHARE = 0.5
"""of the budget, for the reference"""


def chart(wishes: Chart, console: Console) -> tuple[list[Row], Reference]:
    """Compute the reference, sweep the methods, write chart.png, .html, .csv and .json; returns rows and reference.

    Raises SoftseamError where no configuration could be run to its end, and what was drawn before stays as it is.
    """
    if not 0.0 < wishes.minutes < 1e5:
        raise BadInput(f"--minutes {wishes.minutes:g}: give a number above zero")
    require_extra("view", "drawing a chart")
    if wishes.ray is not None:
        reach(wishes.ray)  # before a reference is made, which may take minutes
    study = study_of(wishes.scene, wishes.settings)
    names = study.names()
    rivals = read_rivals(wishes.rivals, study.scene.name) if wishes.rivals is not None else []
    folder = wishes.out or Path("out") / f"chart-{study.scene.name}"
    read = {} if wishes.rivals is None else {"the file of --rivals": wishes.rivals}
    check_outputs([("--out", folder / name) for name in LEFT], inputs=inputs_of(wishes.scene) | read)
    began = perf_counter()
    store = Store(folder / "runs" / study.identity.folder, study.identity, "start anew with --fresh")
    if wishes.fresh:
        store.clear()
    wanted = [*configurations(study.frame), *classic_configurations(study.frame)]
    wanted.sort(key=lambda one: (one.seconds, one.key))
    finished(store, wanted)  # what is spoilt is named before a reference is made
    levels = study.levels(names, fresh=wishes.fresh)
    budget = 60.0 * wishes.minutes
    with ChartProgress(console) as progress:
        reference = reference_of(levels, REFERENCE_SHARE * budget, progress.reference)
        progress.known(reference)
        left = max(REFERENCE_SHARE * budget, budget - (perf_counter() - began))
        progress.expect(wanted, left)
        outcomes = sweep(
            study,
            wanted,
            store,
            left,
            progress.configuration,
            jobs=wishes.jobs or os.cpu_count() or 1,
            ray=wishes.ray,
            lost=progress.lost,
        )
    rows = rows_of(wanted, outcomes, reference)
    if all(row.error is None for row in rows):
        least = min(rows, key=lambda row: row.configuration.seconds)
        reason = f"{least.configuration.label}: {least.outcome.reason}"
        raise SoftseamError(f"none of {len(rows)} configurations ran to its end, there is nothing to draw ({reason})")
    here = study.identity.machine if wishes.ray is None else f"processors of the Ray cluster at {wishes.ray}"
    _write(folder, study, here, rows, reference, rivals)
    _tell(console, folder, rows, reference, perf_counter() - began)
    return rows, reference


def _write(
    folder: Path, study: Study, here: str, rows: Sequence[Row], reference: Reference, rivals: Sequence[Landmark]
) -> None:
    try:
        from softseam_studies.study.draw import draw_chart
    except ImportError as error:
        raise missing_extra(error, "drawing a chart") from error
    from softseam.view.paper import write
    from softseam_studies.study.page import write_page

    title, asked = study.scene.name.replace("_", " "), asked_of(study.scene.name)
    document = {
        "chart_version": CHART_VERSION,
        "scene": {"name": study.scene.name, "hash": study.identity.scene},
        "code": study.identity.code[:16],
        "machine": here + busy(rows),
        "reference": described(reference),
        "rows": [row_json(row) for row in rows],
        "asked": [vars(mark) for mark in asked],
        "rivals": [vars(mark) for mark in rivals],
    }
    try:
        write_json(document, folder / "chart.json")
        write_csv(rows, list(reference.truth), folder / "chart.csv")
        figure, picture = draw_chart(title, here, rows, reference, asked, rivals), io.StringIO()
        figure.savefig(picture, format="svg")
        write(figure, folder / "chart.png")
        write_page(folder / "chart.html", title, document, picture.getvalue())
    except OSError as error:
        raise SoftseamError(f"cannot write {error.filename or folder}: {error.strerror}") from error


def _tell(console: Console, folder: Path, rows: Sequence[Row], reference: Reference, seconds: float) -> None:
    """The front, what failed, what the reference is worth, and the files."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, 2), title="nothing is both faster and more accurate than", title_justify="left")
    for name, side in (
        ("configuration", "left"),
        ("real-time factor", "right"),
        ("error", "right"),
        ("decided by", "left"),
    ):
        table.add_column(name, justify="left" if side == "left" else "right")
    for row in sorted((row for row in rows if row.front), key=lambda row: -row.outcome.rtf):
        assert row.error is not None
        decisive = next(n for n, e in row.errors.items() if n in reference.counted and e == row.error)
        sign = "<= " if row.error.bound else ""
        error = f"{sign}{100 * row.error.value:.2g} %"
        table.add_row(row.configuration.label, f"{row.outcome.rtf:.3g}", error, label(decisive))
    console.print(table)
    for text in ("failed", "refused", "stopped", "left out"):
        these = [row for row in rows if row.outcome.status == text]
        for row in these[:4]:
            line = f"{text}: {row.configuration.label}: {row.outcome.reason}"
            console.print(Text(line, style="yellow"), soft_wrap=True)
        if len(these) > 4:
            console.print(Text(f"{text}: {len(these) - 4} more, see chart.csv", style="yellow"))
    if left_out := not_counted(reference.truth):
        console.print(Text(f"not counted: {left_out}", style="dim"), soft_wrap=True)
    known = f"the reference {origin(reference)}"
    if not reference.complete and not reference.bundled:
        known += "; the budget ended before every quantity was known to 1 % (give more --minutes)"
    console.print(Text(known, style="dim" if reference.complete or reference.bundled else "yellow"))
    n_done = sum(row.error is not None for row in rows)
    text = f"{n_done} of {len(rows)} configurations of {len(METHODS)} methods in {seconds:.0f} s"
    console.print(Text(text, style="dim"))
    for name in LEFT:
        console.print(f"{folder / name}", highlight=False, soft_wrap=True)
