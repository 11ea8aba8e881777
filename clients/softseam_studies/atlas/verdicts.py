"""What may become of a run, and how that is judged by what the run showed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from softseam_studies.atlas.trace import Trace

Kind = Literal["accurate", "recovered", "inaccurate", "unstable", "refused"]
KINDS: tuple[Kind, ...] = ("accurate", "recovered", "inaccurate", "unstable", "refused")
MEANING: dict[Kind, str] = {
    "accurate": "within the bound, no safeguard needed",
    "recovered": "within the bound; a safeguard acted",
    "inaccurate": "finite, but wrong",
    "unstable": "not a number, energy gained without work, torn, given up",
    "refused": "not run: the error says why",
}

CREATED = 0.05
"""energy from nowhere above which a run is unstable, relative to the largest energy in it [1]"""
TORN = 0.5
"""gap at the seam above which a run is unstable, in cell edges [1]"""


@dataclass(frozen=True)
class Verdict:
    """What became of one run."""

    kind: Kind
    why: str
    """one sentence; never empty"""
    error: float | None = None
    """relative to what is true [1]; None where there is none"""
    safeguards: tuple[str, ...] = ()
    warned: tuple[str, ...] = ()
    """the run's own indicators that warned"""

    def __post_init__(self) -> None:
        if not self.why:
            raise ValueError("a verdict without an explanation")

    @property
    def silent(self) -> bool:
        """Whether it is wrong or blew up, and no indicator of its own said so."""
        return self.kind in ("inaccurate", "unstable") and not self.warned

    def as_json(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "why": self.why,
            "error": None if self.error is None else float(f"{self.error:.4g}"),
            "safeguards": list(self.safeguards),
            "told": list(self.warned),
            "silent": self.silent,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Verdict:
        """Raises KeyError, TypeError or ValueError where the data are not a verdict."""
        if data["kind"] not in get_args(Kind):
            raise ValueError(f"no verdict is called {data['kind']!r}")
        error = None if data["error"] is None else float(data["error"])
        return cls(data["kind"], data["why"], error, tuple(data["safeguards"]), tuple(data["told"]))


def judge(trace: Trace, truth: float, bound: float, what: str, source: str = "the closed form") -> Verdict:
    """Judge a run by its value's distance from what is true.

    truth   what the value ought to be, in its own unit
    bound   largest relative error of an accurate run [1]
    what    the value in words, e.g. "force"
    source  where the truth is from
    """
    if trace.refused:
        return Verdict("refused", trace.refused)
    guards = tuple(trace.safeguards)
    if trace.failed:
        return Verdict("unstable", trace.failed, None, guards, ("the run was given up by name",))
    warned = trace.warned
    if not math.isfinite(trace.value) or not trace.finite:
        return Verdict("unstable", f"the {what} is not a number from {trace.broke:g} s on", None, guards, warned)
    error = abs(trace.value - truth) / abs(truth)
    off = f"{what} off {source} by {percent(error)}"
    if trace.gap > TORN:
        return Verdict("unstable", f"the seam tore: a gap of {trace.gap:.2g} cell edges; {off}", error, guards, warned)
    if trace.created > CREATED:
        text = f"energy from nowhere: {percent(trace.created)} of the largest; {off}"
        return Verdict("unstable", text, error, guards, warned)
    if error > bound:
        return Verdict("inaccurate", off, error, guards, warned)
    if guards:
        acted = ", ".join(f"{name} ({n} x)" if n > 1 else name for name, n in trace.safeguards.items())
        return Verdict("recovered", f"{acted}; {off}", error, guards, warned)
    return Verdict("accurate", off, error, guards, warned)


def percent(share: float) -> str:
    """Two digits, and never a power of ten where there is room: '0.0089 %', '5000 %'."""
    shown = 100.0 * share
    return f"{shown:.2g} %" if shown < 99.5 else f"{float(f'{shown:.2g}'):.0f} %" if shown < 1e6 else f"{shown:.0e} %"
