"""Checks of a scene, of a body that is built, of a run: each looks at one thing and says what is doubtful about it.

A check is a row of a table, and has a file of its own beside it: sentences that begin with their key and end with their
remedy. `look` asks all rows that apply.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from pkgutil import iter_modules
from typing import Any, Generic, TypeVar

from softseam_protocol.table import Table

Seen = TypeVar("Seen")


class When(Enum):
    """When a check is asked, and for whom."""

    BEFORE = "before the first step"
    NOTE = "before the first step, for those who ask for a check alone"
    AFTER = "after the last step"


@dataclass(frozen=True)
class Check(Generic[Seen]):
    """A row: when it is asked, what has to be there for it, and the sentences that it finds."""

    when: When
    needs: Callable[[Seen], bool]
    look: Callable[[Seen], Iterable[str]]


def anything(seen: object) -> bool:
    """The need of a check that always applies."""
    return True


def look(checks: Mapping[str, Check[Seen]], seen: Seen, when: When = When.BEFORE) -> list[str]:
    """What the rows of a table find, in its order, each sentence once."""
    rows = (row for row in checks.values() if row.when is when and row.needs(seen))
    return list(dict.fromkeys(text for row in rows for text in row.look(seen)))


def require_files(folder: Iterable[str], first: Table[Any], *others: Table[Any]) -> None:
    """At start: each file of a folder of checks has a row in one of these tables. Raises MissingRow."""
    elsewhere = {name for table in others for name in table}
    first.require((module.name for module in iter_modules(folder) if module.name not in elsewhere), "its folder")
