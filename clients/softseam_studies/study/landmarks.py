"""Marks that were not measured here: the table that the project was asked to beat, and rivals from a file."""

import json
from dataclasses import dataclass
from pathlib import Path

from softseam.errors import BadInput


@dataclass(frozen=True)
class Landmark:
    """A mark of the chart that the sweep did not make."""

    label: str
    rtf: float
    error: float
    source: str


ASKED = tuple(
    Landmark(label, rtf, error, "the table that the project began with; estimates, not measured here")
    for label, rtf, error in (
        ("FEM fine", 0.01, 0.05),
        ("FEM coarse", 0.5, 0.20),
        ("PBD", 10.0, 0.30),
        ("XPBD", 4.0, 0.15),
        ("surrogate", 100.0, 0.25),
    )
)
"""real-time factors and errors that the project set out to beat"""
HELD_AGAINST = "tofu_grasp"
"""the scene that they are held against: to any other they say nothing"""


def asked_of(scene: str) -> tuple[Landmark, ...]:
    """Marks of what was asked for, for the chart of a scene of this name."""
    return ASKED if scene == HELD_AGAINST else ()


def read_rivals(path: Path, scene: str) -> list[Landmark]:
    """Measured rows of other simulators for a scene of this name. Raises BadInput.

    The file: {"rivals": [{"scene", "label", "rtf", "error", "source"}, ...]}, errors relative to the reference [1].
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(f"--rivals {path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise BadInput(f"--rivals {path}: is not JSON: {error}") from None
    rows = document.get("rivals") if isinstance(document, dict) else None
    if not isinstance(rows, list):
        raise BadInput(f'--rivals {path}: expected {{"rivals": [...]}} with scene, label, rtf, error and source each')
    return [_landmark(row, f"--rivals {path}: row {i}") for i, row in enumerate(rows, 1) if _is_of(row, scene)]


def _is_of(row: object, scene: str) -> bool:
    return not isinstance(row, dict) or row.get("scene", scene) == scene


def _landmark(row: object, where: str) -> Landmark:
    if not isinstance(row, dict):
        raise BadInput(f"{where} is not an object with scene, label, rtf, error and source")
    missing = [key for key in ("label", "rtf", "error", "source") if key not in row]
    if missing:
        raise BadInput(f"{where} lacks {', '.join(missing)}")
    for key in ("rtf", "error"):
        value = row[key]
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < 1e12:
            raise BadInput(f"{where}: {key} is {value!r}: give a number above zero")
    return Landmark(str(row["label"]), float(row["rtf"]), float(row["error"]), str(row["source"]))
