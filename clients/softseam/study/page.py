"""The chart as one HTML file: no network, everything inside; pointing at a mark tells all about it."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softseam.study.configurations import METHODS
from softseam.study.palette import ASKED, BAND, RIVAL, TONES
from softseam.view.colors import label

_TEMPLATE = Path(__file__).with_name("page.html")


def write_page(path: Path, title: str, document: Mapping[str, Any]) -> Path:
    """Write the page, all or nothing; returns its path."""
    text = page(title, document)
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        fresh.write_text(text, encoding="utf-8")
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)
    return path


def page(title: str, document: Mapping[str, Any]) -> str:
    """The page's text."""
    reference = document["reference"]
    quantities = {
        name: {key: value for key, value in quantity.items() if key != "values"} | {"label": label(name)}
        for name, quantity in reference["quantities"].items()
    }
    data = {
        "title": title,
        "machine": document["machine"],
        "rows": document["rows"],
        "asked": document["asked"],
        "rivals": document["rivals"],
        "reference": {
            "uncertainty": reference["uncertainty"],
            "complete": reference["complete"] or reference["shipped"],
            "origin": reference["origin"],
            "integrator": reference["integrator"],
            "levels": reference["levels"],
            "quantities": quantities,
        },
        "methods": list(METHODS),
        "tones": TONES | {"asked": ASKED, "rival": RIVAL, "band": BAND},
    }
    # a "</script>" in a scene's text must not end the script
    inside = json.dumps(data, allow_nan=False).replace("</", "<\\/")
    text = _TEMPLATE.read_text(encoding="utf-8")
    return text.replace("{{title}}", html.escape(title)).replace("{{data}}", inside)
