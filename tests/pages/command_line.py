"""docs/reference/command-line.md, from the commands as they are declared."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from softseam.app import app

HEAD = """# Command line

Made from the commands by `make pages`; `softseam COMMAND --help` says the same in a terminal. Exit codes: 0 done,
1 failed, 2 bad input. `SOFTSEAM_TRACEBACK=1` shows where an internal error comes from.
"""
_MARKUP = re.compile(r"\[/?(?:bold|dim|italic)\]")


def _plain(text: str | None) -> str:
    return " ".join(_MARKUP.sub("", text or "").split())


def _epilog(text: str) -> list[str]:
    """An epilog as paragraphs; the commands among them as code."""
    lines: list[str] = []
    for block in _MARKUP.sub("**", text).split("\n\n"):
        said = " ".join(block.split()).replace("\\[", "[")  # that marks nothing up
        if said.startswith("softseam "):
            lines.append(f"    {said}")
        elif said:
            lines += ["", said, ""]
    return lines


def _choices(kind: Any) -> str:
    """What a parameter without a metavar may be: the words of a Literal, else its type's name."""
    for one in (kind, *get_args(kind)):
        if get_origin(one) is Literal:
            return " or ".join(map(str, get_args(one)))
    named = next((one for one in (kind, *get_args(kind)) if one is not type(None) and isinstance(one, type)), str)
    return str(named.__name__).upper()


def _row(name: str, kind: Any, info: Any, default: Any) -> str:
    if type(info).__name__ == "ArgumentInfo":
        called = info.metavar or name.upper()
    else:
        said = (info.default, *(info.param_decls or ()))  # within Annotated typer takes the first name for a default
        option = next((one for one in said if str(one).startswith("--")), f"--{name.replace('_', '-')}")
        called = option if kind is bool else f"{option} {info.metavar or _choices(kind)}"
    told = _plain(info.help)
    if default not in (None, False, inspect.Parameter.empty) and "default" not in told:
        told = f"{told} Default: {default}."
    return f"| `{called.replace('|', ' or ')}` | {told.replace('|', chr(92) + '|')} |"


def _rows(command: Callable[..., Any]) -> list[str]:
    hints = get_type_hints(command, include_extras=True)
    rows = []
    for name, parameter in inspect.signature(command).parameters.items():
        hint = hints[name]
        kind, info = get_args(hint)[:2] if get_origin(hint) is Annotated else (hint, None)
        if info is not None:
            rows.append(_row(name, kind, info, parameter.default))
    return rows


def page() -> str:
    """docs/reference/command-line.md."""
    commands = [(one.name or one.callback.__name__, one) for one in app.registered_commands if one.callback is not None]
    lines = [HEAD, "| command | |", "|---|---|"]
    for name, one in commands:
        lines.append(f"| [`{name}`](#softseam-{name}) | {_plain(one.help or inspect.getdoc(one.callback))} |")
    for name, one in commands:
        assert one.callback is not None
        lines += [f"\n## softseam {name}\n", _plain(one.help or inspect.getdoc(one.callback)), ""]
        rows = _rows(one.callback)
        if rows:
            lines += ["| | |", "|---|---|", *rows]
        lines += _epilog(one.epilog if isinstance(one.epilog, str) else "")
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines).rstrip() + "\n")
