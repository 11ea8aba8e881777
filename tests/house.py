"""Counts of the house: how often the code below the words body, part, interface and model still knows better.

    python tests/house.py

prints each count beside its budget and its goal. A budget is what the count was when it was last lowered: a change may
lower a count, and its budget with it, but not raise it (tests/unit/test_house.py). Sizes have a little room.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("protocol", "coupling", "services", "clients")
LONG = 400
"""lines that no file has more of, in the end"""
SCENE_AND_VIEW = r"/(scene|view|replay)/|softseam_coupling/regions\.py|orchestrator/cuts\.py"
"""where a region may be called near or far: scene files, pictures, the rule, the cut"""
PUBLIC = ("_replace", "_fields", "_asdict", "_exit")
"""methods of named tuples, and of `os`, which begin so and are no secret"""
BODY_KINDS = r"isinstance\([^)]*(ParticleBody|, Body\)|BodySpec|SheetBody|RopeBody|TetMeshBody)"

Sources = Mapping[str, str]
"""text of each file by its path from the root"""


@dataclass(frozen=True)
class Count:
    """A row of the table."""

    name: str
    count: Callable[[Sources], float]
    budget: float
    """what it may be now"""
    goal: float
    """what it is to be in the end"""


def product() -> Sources:
    """The files of the four packages."""
    paths = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    return {path.relative_to(ROOT).as_posix(): path.read_text() for path in paths}


def lines(sources: Sources, under: str = "") -> int:
    """Of all files whose path begins so."""
    return sum(text.count("\n") for path, text in sources.items() if path.startswith(under))


def matching(pattern: str, outside: str = "^$", inside: str = "") -> Callable[[Sources], float]:
    """Lines with a pattern, in files whose path has `inside` and not `outside`."""

    def count(sources: Sources) -> float:
        texts = [text for path, text in sources.items() if re.search(inside, path) and not re.search(outside, path)]
        return sum(re.search(pattern, line) is not None for text in texts for line in text.splitlines())

    return count


def taking(names: Collection[str], outside: str) -> Callable[[Sources], float]:
    """Attributes of these names that code takes; texts may name keys of scenes and ids of parts as users write them."""

    def count(sources: Sources) -> float:
        trees = (ast.parse(text) for path, text in sources.items() if not re.search(outside, path))
        nodes = (node for tree in trees for node in ast.walk(tree))
        return sum(isinstance(node, ast.Attribute) and node.attr in names for node in nodes)

    return count


def importing(package: str, inside: str) -> Callable[[Sources], float]:
    """Lines of imports of a package in files whose path has `inside`, those for types alone left out."""

    def count(sources: Sources) -> float:
        found = 0
        for path, text in sources.items():
            if re.search(inside, path):
                found += sum(_imports(node, package) for node in _run_time(ast.parse(text)))
        return found

    return count


def modules_importing(package: str, inside: str) -> Callable[[Sources], float]:
    """As `importing`, but files, not lines."""
    lines_of = importing(package, inside)
    return lambda sources: sum(lines_of({path: text}) > 0 for path, text in sources.items())


def constants(sources: Sources) -> float:
    """Tuned numbers at the top of modules: fractions that a name is given."""
    return sum(
        len([each for each in _parts(node.value) if _is_fraction(each)])
        for text in sources.values()
        for node in ast.parse(text).body
        if isinstance(node, ast.Assign)
    )


def import_share(sources: Sources) -> float:
    """Lines of imports, in percent of all."""
    spent = sum(
        (node.end_lineno or node.lineno) - node.lineno + 1
        for text in sources.values()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, (ast.Import, ast.ImportFrom))
    )
    return round(100.0 * spent / lines(sources), 2)


def long_files(sources: Sources) -> float:
    """Files of more than `LONG` lines."""
    return sum(text.count("\n") > LONG for text in sources.values())


def private_in_tests(_: Sources) -> float:
    """Lines of tests that take, patch or import what another file keeps to itself."""
    return _private_in_tests()


@cache
def _private_in_tests() -> int:
    return sum(len(_private(ast.parse(path.read_text()))) for path in (ROOT / "tests").rglob("*.py"))


def _private(tree: ast.Module) -> set[int]:
    nodes = list(ast.walk(tree))
    own = {node.name for node in nodes if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    own |= {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    own |= {node.attr for node in nodes if isinstance(node, ast.Attribute) and _of_self(node)}
    return {
        node.lineno
        for node in nodes
        if isinstance(node, (ast.Attribute, ast.ImportFrom, ast.Call))
        for name in _taken(node)
        if name not in own
    }


def _of_self(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")


def _taken(node: ast.Attribute | ast.ImportFrom | ast.Call) -> list[str]:
    """Private names that a node takes from elsewhere; those of named tuples and of `os` are none."""
    if isinstance(node, ast.ImportFrom):
        names = [alias.name for alias in node.names]
    elif isinstance(node, ast.Attribute):
        names = [] if _of_self(node) else [node.attr]
    else:
        patches = isinstance(node.func, ast.Attribute) and node.func.attr in ("setattr", "delattr", "setitem")
        texts = [each.value for each in node.args if patches and isinstance(each, ast.Constant)]
        names = [text.rpartition(".")[2] for text in texts if isinstance(text, str)]
    return [name for name in names if re.match("_[a-zA-Z]", name) and name not in PUBLIC]


def _run_time(tree: ast.Module) -> list[ast.AST]:
    """Nodes of a module that are not `if TYPE_CHECKING`."""
    types = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    return [node for node in ast.walk(tree) if id(node) not in types]


def _imports(node: ast.AST, package: str) -> bool:
    if isinstance(node, ast.ImportFrom):
        return re.match(package, node.module or "") is not None
    return isinstance(node, ast.Import) and any(re.match(package, alias.name) for alias in node.names)


def _parts(value: ast.expr) -> list[ast.expr]:
    return value.elts if isinstance(value, ast.Tuple) else [value]


def _is_fraction(value: ast.expr) -> bool:
    if isinstance(value, ast.UnaryOp):
        return _is_fraction(value.operand)
    return isinstance(value, ast.Constant) and isinstance(value.value, float)


SOLVERS = r"softseam_services\.(fem|pbd)\b"
COUNTS = (
    Count("lines of the product", lines, 94_600, 66_000),
    Count("lines of the client", lambda sources: lines(sources, "clients/softseam/"), 13_560, 13_500),
    Count("lines that name a model", matching(r'"(fem|pbd)"', r"services/softseam_services/(fem|pbd)/"), 10, 10),
    Count("places that take .near or .far", taking(("near", "far"), SCENE_AND_VIEW), 0, 0),
    Count("lines that ask for a kind of body", matching(BODY_KINDS), 4, 10),
    Count("lines that take the only body", matching(r"scene\.body\b"), 16, 20),
    Count("fields of messages that are called seam", matching(r"^    seam_\w+:", inside="/messages/"), 0, 0),
    Count("imports of solvers in the orchestrator", importing(SOLVERS, "/orchestrator/"), 0, 0),
    Count("client modules that import services", modules_importing("softseam_services", "clients/"), 3, 3),
    Count("tuned constants", constants, 455, 450),
    Count("lines with tell or told", matching(r"\b(tell|tells|telling|told)\b"), 108, 150),
    Count(
        "lines of a participant from outside",
        lambda sources: lines(sources, "clients/softseam/examples/participant/"),
        134,
        150,
    ),
    Count("files that are too long", long_files, 0, 0),
    Count("private names that tests take", private_in_tests, 29, 40),
    Count("imports in percent of lines", import_share, 7.45, 5.0),
)


def main() -> None:
    sources = product()
    print(f"{'':44}{'now':>9}{'budget':>9}{'goal':>9}")
    for row in COUNTS:
        print(f"{row.name:44}{row.count(sources):9,g}{row.budget:9,g}{row.goal:9,g}")


if __name__ == "__main__":
    main()
