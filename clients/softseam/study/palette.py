"""Colours of the chart, the same in the picture and on the page."""

from __future__ import annotations

from softseam.study.configurations import Method

TONES: dict[Method, str] = {
    "FEM": "#e8794a",
    "FEM, other elements": "#b98bd0",
    "XPBD": "#5f8cc4",
    "hybrid": "#3fb383",
    "as it is": "#23262d",
}
"""the first, third and fourth as replays paint FEM, PBD and the seam"""
ASKED = "#a2a7b0"
RIVAL = "#7a5c3e"
BAND = "#f3f4f1"
