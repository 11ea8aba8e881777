"""Which pages are generated, by what, and where they lie."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pages import command_line, python_api, wire

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"
PAGES: dict[str, Callable[[], str]] = {
    "python.md": python_api.page,
    "command-line.md": command_line.page,
    "messages.md": wire.page,
}


def write(folder: Path = REFERENCE) -> list[Path]:
    """Write every generated page; where."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, page in PAGES.items():
        paths.append(folder / name)
        paths[-1].write_text(page(), encoding="utf-8")
    return paths
