"""The table at the end of a run: what came out, how far it can be trusted, and where the time went."""

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.columns import most_telling, shown_unit, spent
from softseam.view.colors import label
from softseam_protocol.messages.outcomes import EventKind

_MOST = 6
"""sentences on what was not done"""
CLAIMED = "±"
"""heading of the claims"""
_COLOR = {"lifted": "green", "set down": "green", "finished": "green"}


def print_closing(console: Console, report: Mapping[str, Any]) -> None:
    """Print a report of `ReportBuilder.build` for people."""
    verdict = report["verdict"]
    console.print()
    console.print(Text(verdict["text"], style=f"bold {_COLOR.get(verdict['outcome'], 'red')}"))
    if report["symmetry"]:
        console.print(Text(f"symmetric {report['symmetry']}", style="dim"))
    if report["uneven_friction"]:
        console.print(Text(f"friction {report['uneven_friction']}", style="dim"))
    claims = report.get("claims")
    measured = most_telling(report["quantities"])
    _print_trust(console, report["estimated_error"], claims)
    _print_not_done(console, report["not_done"])
    claimed = {} if claims is None else claims["quantities"]
    console.print(_quantities(measured, claimed))
    if left := len(report["quantities"]) - len(measured):
        text = f"of each quantity the bodies that have most of it; {left} values more are in a --report"
        console.print(Text(text, style="dim"), soft_wrap=True)
    _print_unclaimed(console, measured, claimed)
    _print_gaps(console, measured, report["steps"])
    _print_condition(console, report["condition"])
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


def _shown(found: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """What the scene asks for, then what else was reported and was not nothing throughout."""
    for asked in (True, False):
        for name, entry in found.items():
            something = asked or entry["min"] or entry["max"]
            if entry["asked"] == asked and entry["max"] is not None and something:
                yield name, entry


def _quantities(found: Mapping[str, Mapping[str, Any]], claims: Mapping[str, Mapping[str, Any]]) -> Table:
    """Each with the claim of what stands before it: of the end, and of the peak, which is least or most, whichever is
    farther from 0."""
    table = Table(box=None, pad_edge=False, show_header=True, header_style="dim")
    table.add_column("")
    of_end, of_peak = ([CLAIMED], [f"{CLAIMED} of the peak"]) if claims else ([], [])
    for heading in ("at the end", *of_end, "least", "most", *of_peak):
        table.add_column(heading, justify="right")
    for name, entry in _shown(found):
        unit, factor = shown_unit(name)
        figures = [_value(entry[each], factor, unit) for each in ("final", "min", "max")]
        if name in claims:
            figures.insert(1, _claim(claims[name]["end"], factor, unit))
            figures.append(_claim(claims[name]["peak"], factor, unit))
        table.add_row(label(name), *figures, style="" if entry["asked"] else "dim")
    return table


def _claim(claim: Mapping[str, Any], factor: float, unit: str) -> str:
    """In the unit shown; of none, the word that its reason begins with."""
    if claim["absolute"] is None:
        return str(claim["why"]).partition(":")[0]
    return f"{CLAIMED} {factor * claim['absolute']:.2g} {unit}"


def _print_unclaimed(
    console: Console, found: Mapping[str, Mapping[str, Any]], claims: Mapping[str, Mapping[str, Any]]
) -> None:
    """Why something has no claim: at the end, or else at its peak; what has the same reason together."""
    names: dict[str, list[str]] = {}
    for name, _ in _shown(found):
        if name in claims and (why := claims[name]["end"]["why"] or claims[name]["peak"]["why"]):
            names.setdefault(why, []).append(label(name))
    for why, some in names.items():
        console.print(Text(f"{', '.join(some)}: {why}", "dim"), soft_wrap=True)


def _print_gaps(console: Console, found: Mapping[str, Mapping[str, Any]], steps: int) -> None:
    """That least and most are of some steps only."""
    some = {name: entry["measured"] for name, entry in found.items() if entry["asked"] and entry["measured"] < steps}
    if some:
        names, least = ", ".join(map(label, some)), min(some.values())
        console.print(Text(f"measured in {least} of {steps} steps: {names}", style="dim"), soft_wrap=True)


def _print_condition(console: Console, found: Mapping[str, Mapping[str, Any]] | None) -> None:
    """Condition numbers, where somebody asked for them."""
    if found is None:
        return
    if not found:
        text = "no condition number: XPBD moves no body, or one with too many unknowns for it"
        console.print(Text(text, "dim"), soft_wrap=True)
    for name, condition in found.items():
        text = f"{name}: {condition['text']}" if len(found) > 1 else condition["text"]
        console.print(Text(text, "dim"), soft_wrap=True)


def _print_trust(console: Console, estimate: Mapping[str, Any] | None, claims: Mapping[str, Any] | None) -> None:
    """How far the run can be trusted; where nobody looked for claims, what it estimates of itself."""
    if claims is None:
        if estimate is not None:
            style = "bold yellow" if estimate["too_large"] else "dim"
            console.print(Text(f"estimated error: {estimate['text']}", style=style), soft_wrap=True)
        return
    console.print(Text(claims["text"], style="bold yellow" if claims["settled"] is False else "dim"), soft_wrap=True)
    if estimate is not None and estimate["goal"]:
        console.print(Text(f"estimated error: {estimate['text']}", style="dim"), soft_wrap=True)
    elif estimate is not None:
        parts = [
            f"{what} {100.0 * estimate[f'{what}_error']:.2g} %"
            for what in ("mesh", "model")
            if estimate[f"{what}_error"] > 0.0
        ]
        if parts:
            text = f"stress over the whole body is off by: {' and '.join(parts)}, in the energy norm"
            console.print(Text(text, style="dim"), soft_wrap=True)


def _print_not_done(console: Console, texts: list[str]) -> None:
    """What the scene asks for and the run did not do."""
    for text in texts[:_MOST]:
        console.print(Text(f"not done: {text}", "bold yellow"), soft_wrap=True)
    if len(texts) > _MOST:
        console.print(Text(f"not done: {len(texts) - _MOST} more, see not_done in a --report", "bold yellow"))


def _indicators(report: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    if report["model"] == "hybrid":
        exchanges = report["exchanges"]
        yield "worst gap at the seam", _figure(report["seam"]["worst_gap"]["value"], 1e6, "um"), ""
        yield "exchanges a step", f"{exchanges['mean']:.2f}", f"at most {exchanges['max']:.0f}"
    yield "deepest penetration", _figure(report["penetration"]["worst"], 1e6, "um"), ""
    energy = report["energy"]
    yield "energy balance error", _figure(energy["balance_error"], 1e6, "uJ"), "created by single steps, summed"
    if energy["largest"] > 0.0:
        share = f"{100.0 * energy['damped'] / energy['largest']:.0f} % of the most that moved or was strained"
        yield "damped by the steps", _figure(energy["damped"], 1e6, "uJ"), share


def _times(report: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    wall = report["wall"]
    total = wall["total"]
    for name in spent():
        if wall[name] > 0.0 and total > 0.0:
            yield name, _duration(wall[name]), f"{100.0 * wall[name] / total:.0f} %"
    yield "all steps", _duration(total), "solvers run at the same time"
    yield "set-up and compiling", _duration(wall["setup"]), "not part of the real-time factor"
    if wall["rtf"] is not None:
        yield "real-time factor", f"{wall['rtf']:.3g}", f"{wall['rtf_median_step']:.3g} at the median step"


def _print_events(console: Console, events: list[Mapping[str, Any]]) -> None:
    """Count the events by kind, and spell out the last one of each; what was not done is said above."""
    by_kind: dict[str, list[Mapping[str, Any]]] = {}
    for event in events:
        if event["kind"] == EventKind.NOT_DONE:
            continue
        by_kind.setdefault(event["kind"], []).append(event)
    if not by_kind:
        return
    console.print(Text("\nevents", style="dim"))
    grid = Table.grid(padding=(0, 2))
    for kind, found in by_kind.items():
        grid.add_row(kind, f"{len(found)} x", Text(f"last at {found[-1]['time']:.2f} s: {found[-1]['message']}"))
    console.print(grid)


def _value(value: float | None, factor: float, unit: str) -> str:
    """A value in the unit shown."""
    return "-" if value is None else f"{value * factor:.4g} {unit}"


def _figure(value: float, factor: float, unit: str) -> str:
    """An indicator in the unit shown; what is below a millionth of that unit is noise."""
    shown = value * factor
    return f"{0.0 if abs(shown) < 1e-6 else shown:.4g} {unit}"


def _duration(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds >= 1.0 else f"{1e3 * seconds:.0f} ms"
