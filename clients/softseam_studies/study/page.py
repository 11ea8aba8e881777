"""The chart as one HTML file: no network, no script; pointing at a mark shows what it is, and a table has every run."""

import html
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from softseam.outputs import write_whole
from softseam.view.colors import label

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"/><title>{title}</title><style>
body {{ font: 14px/1.5 system-ui, sans-serif; margin: 1.5em; color: #23262d }}
svg {{ max-width: 100%; height: auto }} svg g[id^="run-"]:hover {{ stroke: #23262d; stroke-width: 2 }}
table {{ border-collapse: collapse }} td, th {{ padding: .1em .8em; text-align: right }}
td:first-child, th:first-child {{ text-align: left }} tr.front {{ font-weight: bold }} tr.other {{ color: #8a8f98 }}
</style></head><body>
{picture}
<p>The reference {origin}.</p>
<table><thead><tr>{head}</tr></thead><tbody>
{rows}
</tbody></table>
</body></html>
"""


def write_page(path: Path, title: str, document: Mapping[str, Any], picture: str) -> Path:
    """Write the page, all or nothing, of a chart's document and its picture as SVG; returns its path."""
    rows = sorted(document["rows"], key=lambda row: -(row["rtf"] or 0.0))
    for row in rows:
        group = f'<g id="run-{html.escape(row["key"])}">'
        picture = picture.replace(group, f"{group}<title>{html.escape(chr(10).join(_told(row)))}</title>")
    names = list(document["reference"]["quantities"])
    head = ["configuration", "real-time factor", "error [%]", *map(label, names), "cells", "steps"]
    text = PAGE.format(
        title=html.escape(title),
        picture=picture[picture.index("<svg") :],
        origin=html.escape(document["reference"]["origin"]),
        head="".join(f"<th>{html.escape(text)}</th>" for text in head),
        rows="\n".join(_row(row, names) for row in rows),
    )
    return write_whole(path, text)


def _told(row: Mapping[str, Any]) -> Iterator[str]:
    """Lines of what there is to say of a run."""
    yield row["label"]
    if row["rtf"]:
        spread = f"{row['rtf_least']:.3g} to {row['rtf_greatest']:.3g} in {row['runs']} runs"
        yield f"real-time factor {row['rtf']:.3g} ({spread})"
    if row["error"] is None:
        yield f"{row['status']}: {row['reason']}"
    for name, error in row["errors"].items():
        yield f"{label(name)}: {_error(error)} %"
    yield f"{row['n_cells']} cells, {row['steps']} steps"
    yield " ".join(f"--set '{setting}'" for setting in row["settings"])


def _row(row: Mapping[str, Any], names: list[str]) -> str:
    kind = "front" if row["pareto"] else "other" if row["error"] is None else ""
    worst = row["reason"] or row["status"] if row["error"] is None else _error({"value": row["error"], **row})
    cells = [row["label"], f"{row['rtf']:.3g}" if row["rtf"] else "", worst]
    cells += [_error(row["errors"][name]) if name in row["errors"] else "" for name in names]
    cells += [str(row["n_cells"]), str(row["steps"])]
    return f'<tr class="{kind}">{"".join(f"<td>{html.escape(cell)}</td>" for cell in cells)}</tr>'


def _error(error: Mapping[str, Any]) -> str:
    """In per cent."""
    sign = "<= " if error["at_most"] else ""
    return "?" if error["value"] is None else f"{sign}{100 * error['value']:.2g}"
