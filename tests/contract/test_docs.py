"""The documents: every link and path leads somewhere, and the generated pages are what the code says today."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pages.written import PAGES as GENERATED
from pages.written import REFERENCE

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted(p.relative_to(ROOT).as_posix() for p in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")))
_PATH = re.compile(r"`((?:clients|coupling|deploy|docs|protocol|scenes|services|tests)/[\w./*-]*)(?:::\w+)?`")


def links(text: str) -> list[str]:
    """Targets of the links of a page, but for those in code."""
    prose = re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.DOTALL)
    return [target for target in re.findall(r"\]\(([^)\s]+)\)", prose) if "://" not in target]


def anchor(heading: str) -> str:
    """What a heading is called in a link, as GitHub has it."""
    said = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", said).replace(" ", "-")


def anchors(page: Path) -> set[str]:
    prose = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return {anchor(heading) for heading in re.findall(r"^#+ (.*)$", prose, re.MULTILINE)}


@pytest.mark.parametrize("page", DOCUMENTS)
def test_links_lead_somewhere(page: str) -> None:
    for target in links((ROOT / page).read_text(encoding="utf-8")):
        path, _, part = target.partition("#")
        found = (ROOT / page).parent / path if path else ROOT / page
        assert found.exists(), target
        assert not part or part in anchors(found), f"{target}: no such heading"


@pytest.mark.parametrize("page", DOCUMENTS)
def test_paths_exist(page: str) -> None:
    """A path in backticks that begins with a folder of the repository; NAME, *, {x} and <x> stand for others."""
    text = (ROOT / page).read_text(encoding="utf-8")
    missing = [path for path in _PATH.findall(text) if "NAME" not in path and not any(ROOT.glob(path.rstrip("/")))]
    assert not missing


@pytest.mark.parametrize("name", GENERATED)
def test_generated_pages_are_of_today(name: str) -> None:
    written = (REFERENCE / name).read_text(encoding="utf-8")
    assert GENERATED[name]() == written, f"docs/reference/{name} is of another day: make pages"


def test_every_page_is_listed() -> None:
    """A page that docs/README.md does not lead to is found by nobody; decisions have an index of their own."""
    for index, pages in (("docs/README.md", "docs/*/*.md"), ("docs/decisions/README.md", "docs/decisions/*.md")):
        folder = (ROOT / index).parent
        listed = {(folder / target.partition("#")[0]).resolve() for target in links((ROOT / index).read_text("utf-8"))}
        found = {page for page in ROOT.glob(pages) if page.name != "README.md"}
        if index == "docs/README.md":
            found = {page for page in found if page.parent.name != "decisions"}
        assert not {page.relative_to(ROOT).as_posix() for page in found if page.resolve() not in listed}
