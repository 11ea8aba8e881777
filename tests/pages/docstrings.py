"""What a module's source says of its classes and functions: signatures as written, docstrings of fields too."""

from __future__ import annotations

import ast
import inspect
import textwrap
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules


@dataclass
class Attribute:
    """A field, class attribute or property: its name, its annotation as it is written, what it is."""

    name: str
    annotation: str
    text: str
    default: str = ""


@dataclass
class Callable:
    """A function or method: its name, its signature as it is written, its docstring."""

    name: str
    signature: str
    text: str


@dataclass
class Class:
    """A class: its docstring, what it is made with, its fields and properties, and its public methods."""

    name: str
    text: str
    bases: list[str]
    attributes: list[Attribute] = field(default_factory=list)
    methods: list[Callable] = field(default_factory=list)


def _text(node: ast.AST) -> str:
    return ast.get_docstring(node) or "" if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module) else ""


def _signature(node: ast.FunctionDef) -> str:
    """Arguments but `self` and `cls`, and what is returned, as they are written."""
    arguments = ast.unparse(node.args)
    first = node.args.args[0].arg if node.args.args else ""
    if first in ("self", "cls"):
        arguments = arguments.removeprefix(first).removeprefix(", ")
    returned = f" -> {ast.unparse(node.returns)}" if node.returns is not None else ""
    return f"{node.name}({arguments}){returned}"


def _decorators(node: ast.FunctionDef) -> set[str]:
    return {ast.unparse(one).rpartition(".")[2] for one in node.decorator_list}


def _text_after(node: ast.ClassDef, place: int) -> str:
    """The docstring that follows a field."""
    after = node.body[place + 1] if place + 1 < len(node.body) else None
    said = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
    return " ".join(str(after.value.value).split()) if said else ""  # type: ignore[union-attr]


def _is_enum(found: Class) -> bool:
    return any(base.endswith("Enum") for base in found.bases)


def _class(node: ast.ClassDef) -> Class:
    found = Class(node.name, _text(node), [ast.unparse(base) for base in node.bases])
    for place, one in enumerate(node.body):
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name) and not one.target.id.startswith("_"):
            default = "" if one.value is None else ast.unparse(one.value)
            annotation = ast.unparse(one.annotation)
            found.attributes.append(Attribute(one.target.id, annotation, _text_after(node, place), default))
        elif isinstance(one, ast.Assign) and isinstance(one.targets[0], ast.Name) and _is_enum(found):
            found.attributes.append(Attribute(one.targets[0].id, ast.unparse(one.value), _text_after(node, place)))
        elif isinstance(one, ast.FunctionDef) and not one.name.startswith("_"):
            if _decorators(one) & {"property", "cached_property"}:
                annotation = ast.unparse(one.returns) if one.returns is not None else ""
                found.attributes.append(Attribute(one.name, annotation, " ".join(_text(one).split())))
            elif not any(name == "setter" for name in _decorators(one)):
                found.methods.append(Callable(one.name, _signature(one), _text(one)))
    return found


def tree_of(module: str) -> ast.Module:
    """The syntax tree of a module, which is not imported."""
    found = find_spec(module)
    assert found is not None and found.origin is not None, module
    return ast.parse(Path(found.origin).read_text(encoding="utf-8"))


def class_of(module: str, name: str) -> Class:
    """A class of a module. Raises StopIteration where there is none."""
    return _class(next(one for one in tree_of(module).body if isinstance(one, ast.ClassDef) and one.name == name))


def modules_of(name: str) -> list[str]:
    """A module, or a package and its modules in the order of the alphabet."""
    found = find_spec(name)
    assert found is not None, name
    inside = sorted(one.name for one in iter_modules(found.submodule_search_locations or []))
    return [name, *(f"{name}.{one}" for one in inside)]


def classes_of(module: str) -> list[Class]:
    """The public classes of a module, or of a package's modules, in their order."""
    bodies = (one for name in modules_of(module) for one in tree_of(name).body)
    return [_class(one) for one in bodies if isinstance(one, ast.ClassDef) and not one.name.startswith("_")]


def function_of(module: str, name: str) -> Callable:
    """A function of a module. Raises StopIteration where there is none."""
    found = next(one for one in tree_of(module).body if isinstance(one, ast.FunctionDef) and one.name == name)
    return Callable(name, _signature(found), _text(found))


def as_markdown(text: str) -> str:
    """A docstring as paragraphs: indented blocks, as lists of arguments are, stay as they are written."""
    blocks = []
    for block in inspect.cleandoc(text).split("\n\n"):
        lines = block.splitlines()
        listed = len(lines) > 1 and any("  " in line.strip() for line in lines)
        blocks.append(f"```text\n{textwrap.dedent(block)}\n```" if listed else " ".join(lines))
    return "\n\n".join(blocks)


def cell(text: str) -> str:
    """Text for a cell of a table."""
    return text.replace("|", "\\|")
