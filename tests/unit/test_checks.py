"""Checks: every file in a folder of those of scenes has its row, and rows are asked when they are to be."""

from __future__ import annotations

import pytest

from softseam import checks as of_scenes
from softseam_protocol.checks import Check, When, anything, look, require_files
from softseam_protocol.table import MissingRow, Table


def test_a_file_without_a_row_is_named() -> None:
    with pytest.raises(MissingRow, match="no row 'idle', 'swings', 'together', 'unmet'"):
        require_files(of_scenes.__path__, of_scenes.SCENE)


def test_rows_are_asked_when_they_apply_and_say_a_thing_once() -> None:
    checks: Table[Check[int]] = Table(
        "checks of numbers",
        {
            "odd": Check(When.BEFORE, anything, lambda n: ["odd"] if n % 2 else []),
            "again": Check(When.BEFORE, anything, lambda n: ["odd"] if n % 2 else []),
            "large": Check(When.BEFORE, lambda n: n > 9, lambda n: [f"large: {n}"]),
            "after": Check(When.AFTER, anything, lambda n: ["over"]),
        },
    )
    assert look(checks, 3) == ["odd"]
    assert look(checks, 11) == ["odd", "large: 11"]
    assert look(checks, 10, When.AFTER) == ["over"]
