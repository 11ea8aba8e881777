"""Tables name what is missing; extensions that cannot be imported are told of."""

from __future__ import annotations

import pytest

from softseam_protocol.extensions import VARIABLE, ExtensionError, load_extensions
from softseam_protocol.table import MissingRow, Table


@pytest.fixture
def laws() -> Table[int]:
    return Table("material laws", {"linear": 1, "neo_hookean": 2})


def test_rows_are_read_by_name_in_their_order(laws: Table[int]) -> None:
    laws.add("yeoh", 3)
    assert laws["yeoh"] == 3
    assert list(laws) == ["linear", "neo_hookean", "yeoh"]


def test_a_missing_row_names_the_table_the_nearest_and_all(laws: Table[int]) -> None:
    with pytest.raises(MissingRow, match=r"material laws: no row 'neo_hooke'; did you mean 'neo_hookean'\? there are"):
        laws["neo_hooke"]
    assert "neo_hooke" not in laws


def test_a_row_is_not_replaced_in_silence(laws: Table[int]) -> None:
    with pytest.raises(MissingRow, match="'linear' is there already"):
        laws.add("linear", 4)
    assert laws["linear"] == 1


def test_what_another_table_names_is_required_at_start(laws: Table[int]) -> None:
    laws.require(["linear"], "the scene's schema")
    with pytest.raises(MissingRow, match="material laws: no row 'yeoh', 'ogden', which the scene's schema names"):
        laws.require(["linear", "yeoh", "ogden"], "the scene's schema")


def test_a_row_that_was_taken_out_is_missing(laws: Table[int]) -> None:
    laws.remove("linear")
    with pytest.raises(MissingRow):
        laws["linear"]
    with pytest.raises(MissingRow):
        laws.remove("linear")


def test_extensions_are_modules_named_by_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "json, decimal")
    assert load_extensions() == ("json", "decimal")
    monkeypatch.delenv(VARIABLE)
    assert load_extensions() == ()


def test_an_extension_that_cannot_be_imported_is_named_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "no_such_module_of_mine")
    with pytest.raises(ExtensionError, match=r"no_such_module_of_mine.*PYTHONPATH"):
        load_extensions()
