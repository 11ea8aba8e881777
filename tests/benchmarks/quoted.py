"""Tables of one page of docs/results/ for another, as they are."""

from __future__ import annotations

from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs" / "results"


def machine_of(page: str) -> str:
    """What a page says of the machine and the code that made it."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return text.partition("Machine: ")[2].partition(".\n")[0]


def table(page: str, section: str, begins: str = "|") -> str:
    """The table of a page's section ('': before the first) that follows a line that begins so, or its first one. Raises
    SystemExit where there is none: a page that is quoted has to be made first."""
    text = (DOCS / page).read_text(encoding="utf-8")
    lines = (text.partition(f"\n## {section}\n")[2] if section else text).splitlines()
    first = next((i for i, line in enumerate(lines) if line.startswith(begins)), None)
    rows = [i for i, line in enumerate(lines) if first is not None and i >= first and line.startswith("|")]
    if not rows or any(line.startswith("## ") for line in lines[: rows[0]]):
        raise SystemExit(f"docs/results/{page} has no table in {section!r} after {begins!r}: make that page first")
    end = next((i for i in range(rows[0], len(lines)) if not lines[i].startswith("|")), len(lines))
    return "\n".join(lines[rows[0] : end])
