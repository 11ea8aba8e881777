"""YAML as plain data plus the place of every entry: the core schema of YAML 1.2 (JSON's types), no duplicate keys."""

import re
from dataclasses import dataclass
from typing import Any

import yaml

from softseam_protocol.scene.written_number import remedy

MAX_ENTRIES = 100_000
MAX_DEPTH = 40

Path = tuple[str | int, ...]

_NULL = re.compile(r"~|null|Null|NULL|")
_BOOL = re.compile(r"true|True|TRUE|false|False|FALSE")
_INT = re.compile(r"[-+]?[0-9]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_AFTER_COMMA = re.compile(r"[0-9]+(\.[0-9]*)?([eE][-+]?[0-9]+)?")
_SPECIAL = re.compile(r"([-+]?)\.(inf|Inf|INF)|\.(nan|NaN|NAN)")


@dataclass(frozen=True)
class Mark:
    """A place in a text, counted from 1."""

    line: int
    column: int


class YamlError(ValueError):
    """Text that is not the YAML it should be."""

    def __init__(self, message: str, mark: Mark, path: Path = ()) -> None:
        super().__init__(message)
        self.mark = mark
        self.path = path


@dataclass(frozen=True)
class Marked:
    """Data of a document, and where its keys (or, in lists, entries) and values stand."""

    data: Any
    keys: dict[Path, Mark]
    values: dict[Path, Mark]
    close: dict[Path, list[str]]
    """of lists: their entries where two whole numbers with nothing but a comma between them are taken for one"""


def parse(text: str) -> Marked:
    """Parse one YAML document. Raises YamlError."""
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise YamlError(f"the character {chr(error.character)!r} is not allowed in YAML", Mark(line, 1)) from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Mark(mark.line + 1, mark.column + 1) if mark else Mark(1, 1)
        raise YamlError(_explain(text, error, place), place) from None
    except RecursionError:
        raise YamlError(f"nested deeper than {MAX_DEPTH} levels", Mark(1, 1)) from None
    if root is None:
        raise YamlError("the file is empty", Mark(1, 1))
    builder = _Builder()
    return Marked(builder.build(root, ()), builder.keys, builder.values, builder.close)


def _explain(text: str, error: yaml.MarkedYAMLError, place: Mark) -> str:
    lines = text.splitlines()
    line = lines[place.line - 1] if place.line <= len(lines) else ""
    if "\t" in line:
        return "a tab where YAML wants spaces: indent with spaces"
    return f"not YAML: {error.problem or error.context}"


class _Builder:
    """Turns nodes into data, remembering places."""

    def __init__(self) -> None:
        self.keys: dict[Path, Mark] = {}
        self.values: dict[Path, Mark] = {}
        self.close: dict[Path, list[str]] = {}

    def build(self, node: yaml.Node, path: Path) -> Any:
        mark = Mark(node.start_mark.line + 1, node.start_mark.column + 1)
        self.values[path] = mark
        # aliases may repeat a node exponentially often, or contain themselves
        if len(self.values) > MAX_ENTRIES:
            raise YamlError(f"more than {MAX_ENTRIES:,} entries", mark, path)
        if len(path) > MAX_DEPTH:
            raise YamlError(f"nested deeper than {MAX_DEPTH} levels, or an alias that contains itself", mark, path[:1])
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        if isinstance(node, yaml.SequenceNode):
            entries = _merged(node.value)
            if len(entries) < len(node.value):
                self.close[path] = entries
            return [self._entry(child, (*path, i)) for i, child in enumerate(node.value)]
        return _scalar(node, mark, path)

    def _entry(self, node: yaml.Node, path: Path) -> Any:
        self.keys[path] = Mark(node.start_mark.line + 1, node.start_mark.column + 1)
        return self.build(node, path)

    def _mapping(self, node: yaml.MappingNode, path: Path) -> dict[str, Any]:
        data: dict[str, Any] = {}
        if node.flow_style:
            self._find_commas(node, path)
        for key_node, value_node in node.value:
            mark = Mark(key_node.start_mark.line + 1, key_node.start_mark.column + 1)
            if not isinstance(key_node, yaml.ScalarNode):
                raise YamlError("a key must be a text", mark, path)
            key = str(key_node.value)
            if key in data:
                first = self.keys[(*path, key)]
                raise YamlError(f"the key {key!r} is given twice (first in line {first.line})", mark, (*path, key))
            self.keys[(*path, key)] = mark
            data[key] = self.build(value_node, (*path, key))
        return data

    def _find_commas(self, node: yaml.MappingNode, path: Path) -> None:
        """Raise YamlError where a number in `{young: 20,000}` has a comma: YAML reads what follows as a key."""
        for i, (key_node, value_node) in enumerate(node.value):
            text, end = value_node.value, value_node.end_mark.index
            for after, nothing in node.value[i + 1 :]:
                if after.start_mark.index != end + 1 or nothing.value or not _AFTER_COMMA.fullmatch(str(after.value)):
                    break
                text, end = f"{text},{after.value}", after.end_mark.index
            if text is not value_node.value and (what := remedy(text)):
                mark = Mark(value_node.start_mark.line + 1, value_node.start_mark.column + 1)
                raise YamlError(f'"{text}" is {what}', mark, (*path, str(key_node.value)))


def _merged(nodes: list[yaml.Node]) -> list[str]:
    """Entries of a list as text, two whole numbers as one where nothing but a comma is between them."""
    entries: list[str] = []
    before: yaml.Node | None = None
    for node in nodes:
        whole = isinstance(node, yaml.ScalarNode) and _INT.fullmatch(node.value)
        if whole and before is not None and before.end_mark.index + 1 == node.start_mark.index and node.value.isdigit():
            entries[-1] += f",{node.value}"
            before = None
        else:
            entries.append(str(node.value))
            before = node if whole else None
    return entries


def _scalar(node: yaml.ScalarNode, mark: Mark, path: Path) -> Any:
    text = node.value
    if node.style in ("'", '"', "|", ">"):
        return text
    # a tag written out (`!!python/object`) is refused; one that the resolver guessed is ignored
    if node.tag not in _GUESSED:
        raise YamlError(f"the tag {node.tag!r} is not allowed", mark, path)
    if _NULL.fullmatch(text):
        return None
    if _BOOL.fullmatch(text):
        return text[0] in "tT"
    if _INT.fullmatch(text):
        return int(text) if len(text) < 19 else float(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    special = _SPECIAL.fullmatch(text)
    if special:
        return float("nan") if special[3] else float(f"{special[1]}inf")
    return text


_GUESSED = {
    f"tag:yaml.org,2002:{kind}" for kind in ("null", "bool", "int", "float", "str", "timestamp", "merge", "value")
}
