"""Colours of the atlas: a kind has a colour and a letter, so that it is read without colours too."""

from softseam_studies.atlas.verdicts import Kind

TONES: dict[Kind, str] = {
    "accurate": "#3fb383",
    "recovered": "#a9d8b8",
    "inaccurate": "#f2b84b",
    "unstable": "#d0503f",
    "refused": "#c9ccd2",
}
LETTER: dict[Kind, str] = {"accurate": "", "recovered": "R", "inaccurate": "", "unstable": "U", "refused": "-"}
"""drawn in a cell that has no error to show"""
SILENT = "#23262d"
