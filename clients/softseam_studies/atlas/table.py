"""The atlas as a table: one row a run."""

import csv
import os
from collections.abc import Sequence
from pathlib import Path

from softseam_studies.atlas.atlas import Filled

NOT_COMPUTED = "not computed"
COLUMNS = ("map", "panel", "x", "y", "kind", "silent", "control", "error", "safeguards", "told", "why")


def write_csv(maps: Sequence[Filled], path: Path) -> None:
    """Write all maps, all or nothing; errors relative, not in per cent. One row says that a map was not computed."""
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with fresh.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(COLUMNS)
            for filled in maps:
                if not filled.verdicts:
                    writer.writerow((filled.map.name, "", "", "", NOT_COMPUTED, *[""] * (len(COLUMNS) - 5)))
                for cell, judged in filled.judged:
                    verdict = judged.as_json()
                    panel = filled.map.panels[cell.panel]
                    where = (filled.map.name, panel.title, panel.columns[cell.column], panel.rows[cell.row])
                    flags = (verdict["kind"], str(verdict["silent"]).lower(), str(cell.control).lower())
                    error = "" if verdict["error"] is None else str(verdict["error"])
                    lists = ("; ".join(verdict["safeguards"]), "; ".join(verdict["told"]))
                    writer.writerow((*where, *flags, error, *lists, verdict["why"]))
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)
