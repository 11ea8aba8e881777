"""The documents: every link and path leads somewhere, and the generated pages are what the code says today."""

from __future__ import annotations

import ast
import re
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pages.written import PAGES as GENERATED
from pages.written import REFERENCE

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted(p.relative_to(ROOT).as_posix() for p in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")))
_PATH = re.compile(r"`((?:clients|coupling|deploy|docs|protocol|scenes|services|tests)/[\w./*-]*)(?:::\w+)?`")
_DECISION = re.compile(r"[Dd]ecisions?[ /]\[?(\d\d(?:, \d\d)*)\b")


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


@lru_cache
def _words() -> set[str]:
    """Every word of the sources, the scenes and the settings."""
    folders = ("clients", "coupling", "protocol", "services", "tests", "docs", "deploy", "scenes")
    files = (path for folder in folders for path in (ROOT / folder).rglob("*"))
    texts = [path.read_text(encoding="utf-8") for path in files if path.suffix in (".py", ".yaml", ".json", ".sh")]
    return set(re.findall(r"\w+", " ".join([*texts, (ROOT / "pyproject.toml").read_text(encoding="utf-8")])))


NAMED = [page for page in DOCUMENTS if not re.match(r"CHANGELOG|docs/(results|reference)/", page)]
"""pages written by hand about how things are now"""
_NAME = re.compile(r"`([A-Za-z_][\w.]*)(?:\([^`]*\))?`")
_FILE = re.compile(r"(?<![\w/.-])(\w[\w/-]*\.py)\b")
_STAND_FOR_OTHERS = {"helpers", "my_extension", "MultiInputPolicy", "NAME.py", "springs.py"}
"""names that a page has of what is the reader's own, is not to be, or is of another library"""


@pytest.mark.parametrize("page", NAMED)
def test_names_exist(page: str) -> None:
    """A function, a class, a key, a field or a row of a table in backticks is a word of the code, and a file that is
    named anywhere is there, whatever of its folders stands before it."""
    text = (ROOT / page).read_text(encoding="utf-8")
    prose = re.sub(r"```(?!text).*?```", "", text, flags=re.DOTALL)
    names = [name for name in _NAME.findall(prose) if not re.search(r"\.(py|md|ya?ml|json|mcap|toml)$", name)]
    words = _words()
    missing = [name for name in names if not {*filter(None, name.split("."))} <= words]
    missing += [name for name in _FILE.findall(prose) if not _is_there(name)]
    assert {*missing} <= _STAND_FOR_OTHERS


@lru_cache
def _files() -> dict[str, list[Path]]:
    """Those of Python's by their last names."""
    found: dict[str, list[Path]] = {}
    for folder in ("clients", "coupling", "docs", "protocol", "services", "tests"):
        for path in (ROOT / folder).rglob("*.py"):
            found.setdefault(path.name, []).append(path)
    return found


def _is_there(name: str) -> bool:
    """Whether a file's path ends so."""
    *_, last = name.split("/")
    return last in _STAND_FOR_OTHERS or any(path.as_posix().endswith("/" + name) for path in _files().get(last, ()))


def test_decisions_that_are_cited_exist() -> None:
    """By their number, in code as in pages."""
    there = {page.name[:2] for page in ROOT.glob("docs/decisions/[0-9]*.md")}
    sources = [*(ROOT / page for page in DOCUMENTS), *ROOT.glob("scenes/*.yaml")]
    for package in ("clients", "coupling", "protocol", "services", "tests"):
        sources += (ROOT / package).rglob("*.py")
    for source in sources:
        for cited in _DECISION.findall(source.read_text(encoding="utf-8")):
            assert set(re.findall(r"\d\d", cited)) <= there, f"{source.relative_to(ROOT)}: {cited}"


def programs(text: str) -> list[str]:
    """The Python programs of a page."""
    return re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


WITH_PROGRAMS = [
    page
    for page in DOCUMENTS
    if page != "docs/reference/python.md" and programs((ROOT / page).read_text(encoding="utf-8"))
]
"""but for signatures, which are no programs"""


@pytest.mark.parametrize("page", WITH_PROGRAMS)
def test_what_programs_import_is_there(page: str) -> None:
    """Of softseam: a module that moved takes the examples with it."""
    for program in programs((ROOT / page).read_text(encoding="utf-8")):
        for one in ast.walk(ast.parse(program)):
            if isinstance(one, ast.ImportFrom) and (one.module or "").startswith("softseam"):
                module = import_module(one.module or "")
                missing = [name.name for name in one.names if not hasattr(module, name.name)]
                assert not missing, f"{one.module} has no {missing}"


def test_the_recipe_s_extension_adds_its_rows() -> None:
    """The material law of the page on recipes, run as it is printed: at small strains it is Hooke's."""
    (program,) = programs((ROOT / "docs/contribute/recipes.md").read_text(encoding="utf-8"))
    here: dict[str, Any] = {}
    exec(compile(program, "recipes.md", "exec"), here)
    try:
        assert here["MATERIALS"]["gent"] is here["Gent"]
        strained = here["response"](0.0, 0.0, 0.0, np.array([2.0, 3.0, 0.8]))
        energy, by_i1, _, by_j = strained[:4]
        assert (energy, by_i1, by_j) == (0.0, 1.0, -2.0)  # no energy; mu/2 and -mu, which is no stress
    finally:
        here["MATERIALS"].remove("gent")
        here["LAWS"].remove("gent")


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
