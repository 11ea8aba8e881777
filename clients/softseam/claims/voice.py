"""What a run says of its errors in a sentence and in its event, by the claims that its table shows."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from softseam.claims.claim import NEXT_TO_NOTHING
from softseam.columns import shown_unit
from softseam.view.colors import label
from softseam_protocol.messages.outcomes import TOO_FAR_OFF, EventKind, shorter


def sentence(report: Mapping[str, Any], claims: Mapping[str, Any]) -> str:
    """What is claimed of the quantities that the scene asks for and of more than `TOO_FAR_OFF`, with a remedy; '' where
    all are known better, or nothing is claimed.

    Of each the worse of its end and its peak counts, but no end that is next to nothing beside its peak. Stress has
    a sentence of its own, in the energy norm.
    """
    if claims["settled"] is None:
        return ""
    texts, largest = [], 0.0
    for name, claim in claims["quantities"].items():
        entry = report["quantities"][name]
        if not entry["asked"] or entry["unit"] == "Pa":
            continue
        end, peak = ((claim[reading]["value"] or 0.0) for reading in ("end", "peak"))
        readings = ("end", "peak") if abs(end) > NEXT_TO_NOTHING * abs(peak) else ("peak",)
        share, text = max((_told(name, each, claim[each]) for each in readings), key=lambda pair: pair[0])
        if share > TOO_FAR_OFF:
            texts.append(text)
            largest = max(largest, share)
    if not texts:
        return ""
    return f"{', '.join(texts)}: make body.cell and step {shorter(largest):.2g} times as long"


def _told(name: str, reading: str, claim: Mapping[str, Any]) -> tuple[float, str]:
    """Share of a claim, infinite where it is not settled and 0 where there is none, and what to say of it."""
    where = "at the end" if reading == "end" else "at its peak"
    if claim["share"] is None:
        unsettled = claim["why"].startswith("not settled")
        return (np.inf if unsettled else 0.0), f"{label(name)} {where} {claim['why']}"
    unit, factor = shown_unit(name)
    share = f"{100.0 * claim['share']:.2g} %"
    return claim["share"], f"{label(name)} {where} ± {factor * claim['absolute']:.2g} {unit} ({share})"


def speak(report: dict[str, Any], claims: Mapping[str, Any]) -> None:
    """Put claims into a report, which is updated in place: its event `accuracy` then speaks of them, and of nothing
    else."""
    report["claims"] = claims
    if claims["settled"] is None:
        return
    others = [event for event in report["events"] if event["kind"] != EventKind.ACCURACY]
    if text := sentence(report, claims):
        time = report["energy"]["time"]
        others.append(
            {"time": time[-1] if time else 0.0, "step": report["steps"], "kind": EventKind.ACCURACY, "message": text}
        )
    report["events"] = others
