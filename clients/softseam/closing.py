"""The table at the end of a run: what came out, how far it can be trusted, and where the time went."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

_SHOWN = {
    "grip_force": ("grip force", "N", 1.0),
    "lift_height": ("lift height", "mm", 1e3),
    "slip": ("slip", "mm", 1e3),
    "sag": ("sag", "mm", 1e3),
    "compression": ("compression", "%", 1e2),
    "peak_von_mises": ("peak von Mises", "kPa", 1e-3),
    "tip_deflection": ("tip deflection", "mm", 1e3),
    "worst_stretch": ("worst stretch", "%", 1e2),
    "stretch_violation": ("violation, stretch", "%", 1e2),
    "bending_violation": ("violation, bending", "%", 1e2),
    "held": ("particles held", "", 1.0),
}
_PROBED = {"von_mises": ("kPa", 1e-3), "displacement": ("mm", 1e3)}
_COLOR = {"lifted": "green", "held": "green", "finished": "green"}


def print_closing(console: Console, report: Mapping[str, Any]) -> None:
    """Print a report of `ReportBuilder.build` for people."""
    verdict = report["verdict"]
    console.print()
    console.print(Text(verdict["text"], style=f"bold {_COLOR.get(verdict['outcome'], 'red')}"))
    table = Table(box=None, pad_edge=False, show_header=True, header_style="dim")
    table.add_column("")
    for heading in ("at the end", "largest"):
        table.add_column(heading, justify="right")
    probes = {
        name: (name.replace("_", " ").replace(".", ": ").replace("mises", "Mises"), *_PROBED[what])
        for name, what in _probes(report)
    }
    for name, (label, unit, factor) in (_SHOWN | probes).items():
        found = report["quantities"].get(name)
        if found is not None and found["max"] is not None:
            table.add_row(label, _figure(found["final"], factor, unit), _figure(found["max"], factor, unit))
    console.print(table)
    for title, rows in (("error indicators", _indicators(report)), ("where the time went", _times(report))):
        console.print(Text(f"\n{title}", style="dim"))
        grid = Table.grid(padding=(0, 2))
        grid.add_column()
        grid.add_column(justify="right")
        grid.add_column(style="dim")
        for row in rows:
            grid.add_row(*row)
        console.print(grid)
    _print_events(console, report["events"])


def _probes(report: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Names of what probes reported, and what it is."""
    for name in report["quantities"]:
        what = name.rpartition(".")[2]
        if what in _PROBED and name not in _SHOWN:
            yield name, what


def _indicators(report: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    if report["model"] == "hybrid":
        exchanges = report["exchanges"]
        yield "worst gap at the seam", _figure(report["seam"]["worst_gap"]["value"], 1e6, "um"), ""
        yield "exchanges a step", f"{exchanges['mean']:.2f}", f"at most {exchanges['max']:.0f}"
    yield "deepest penetration", _figure(report["penetration"]["worst"], 1e6, "um"), ""
    yield "energy from nowhere", _figure(report["energy"]["balance_error"], 1e6, "uJ"), "dissipation below zero, summed"


def _times(report: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    wall = report["wall"]
    total = wall["total"]
    for name in ("fem", "pbd", "coupling", "bus", "record"):
        if wall[name] > 0.0 and total > 0.0:
            yield name, _duration(wall[name]), f"{100.0 * wall[name] / total:.0f} %"
    yield "all steps", _duration(total), "solvers run at the same time"
    yield "set-up and compiling", _duration(wall["setup"]), "not part of the RTF"
    if wall["rtf"] is not None:
        yield "real-time factor", f"{wall['rtf']:.1f}", f"{wall['rtf_median_step']:.1f} at the median step"


def _print_events(console: Console, events: list[Mapping[str, Any]]) -> None:
    """Count the events by kind, and spell out the last one of each."""
    by_kind: dict[str, list[Mapping[str, Any]]] = {}
    for event in events:
        by_kind.setdefault(event["kind"], []).append(event)
    if not by_kind:
        return
    console.print(Text("\nevents", style="dim"))
    grid = Table.grid(padding=(0, 2))
    for kind, found in by_kind.items():
        grid.add_row(kind, f"{len(found)} x", Text(f"last at {found[-1]['time']:.2f} s: {found[-1]['message']}"))
    console.print(grid)


def _figure(value: float | None, factor: float, unit: str) -> str:
    """A value in the unit shown; what is below a millionth of that unit is noise."""
    if value is None:
        return "-"
    shown = value * factor
    return f"{0.0 if abs(shown) < 1e-6 else shown:.4g} {unit}"


def _duration(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds >= 1.0 else f"{1e3 * seconds:.0f} ms"
