"""Tables of what a scene can name: one row a name, and a name that misses its row is named at once.

A table is an extension point. What softseam brings is in it from the start; an extension adds its row with `add`, from
outside, before the first scene is read. `softseam_protocol.extensions` says how services learn of one.
"""

from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from typing import Generic, TypeVar

Row = TypeVar("Row")


class MissingRow(LookupError):
    """A table lacks a row, or would have it twice; the text names the table, the row and the nearest."""


class Table(Mapping[str, Row], Generic[Row]):
    """Rows by name, in the order in which they were added.

    title  what a row is, in the plural: "material laws"; messages name the table by it
    rows   that the table begins with
    """

    def __init__(self, title: str, rows: Mapping[str, Row] | None = None) -> None:
        self.title = title
        self._rows: dict[str, Row] = dict(rows or {})

    def add(self, name: str, row: Row) -> Row:
        """Add a row and return it. Raises MissingRow where the name is taken."""
        if name in self._rows:
            raise MissingRow(f"table of {self.title}: {name!r} is there already; choose another name")
        self._rows[name] = row
        return row

    def remove(self, name: str) -> None:
        """Take a row out again, as a test of an extension does. Raises MissingRow where there is none."""
        self[name]
        del self._rows[name]

    def __getitem__(self, name: str) -> Row:
        try:
            return self._rows[name]
        except KeyError:
            raise MissingRow(self.problem(name)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    @property
    def described(self) -> str:
        """How messages call the table."""
        return f"the table of {self.title}"

    def problem(self, name: str) -> str:
        """What to say of a name that is no row: the nearest one, and all that there are."""
        near = get_close_matches(name, self._rows, n=1)
        meant = f"; did you mean {near[0]!r}?" if near else ";"
        return f"table of {self.title}: no row {name!r}{meant} there are {', '.join(self._rows) or 'none'}"

    def require(self, names: Iterable[str], asked_by: str) -> None:
        """At start: every one of these names has a row. Raises MissingRow, which names those that have none."""
        missing = [name for name in names if name not in self._rows]
        if missing:
            raise MissingRow(f"table of {self.title}: no row {', '.join(map(repr, missing))}, which {asked_by} names")
