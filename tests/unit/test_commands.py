"""The table by which the client knows its studies: each row leads somewhere."""

from __future__ import annotations

from softseam.app import app
from softseam.commands import COMMANDS, Planner, commands_after, planner
from softseam_studies.study import plan_watch


def test_each_row_is_a_command() -> None:
    """Of its name, with a help that ends in examples, and listed after the client's own."""
    listed = [each.name or getattr(each.callback, "__name__", "") for each in app.registered_commands]
    assert len(set(listed)) == len(listed)
    for own, rows in COMMANDS.items():
        found = commands_after(own)
        assert [each.name for each in found] == [*rows]
        for each in found:
            assert each.function.__doc__ and "softseam" in each.epilog
        at = listed.index(own) + 1
        assert listed[at : at + len(rows)] == [*rows]


def test_the_planner_is_one() -> None:
    """The module that the row names is what the client takes it for; a type checker reads this, too."""
    named: Planner = plan_watch
    assert planner() is named
