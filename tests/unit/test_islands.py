"""Islands are what pairs join, however they are told."""

from __future__ import annotations

from itertools import permutations

import pytest

from softseam_coupling.islands import islands_of


def test_islands_are_what_pairs_join_in_the_order_of_the_names() -> None:
    pairs = [("d", "b"), ("e", "f"), ("b", "a")]
    for told in permutations(pairs):
        assert islands_of("abcdef", told) == [("a", "b", "d"), ("c",), ("e", "f")]
    assert islands_of("abc", []) == [("a",), ("b",), ("c",)]
    assert islands_of("", []) == []


def test_a_long_chain_is_one_island() -> None:
    names = [f"b{i}" for i in range(2000)]
    assert islands_of(names, zip(names[1:], names[:-1], strict=True)) == [tuple(names)]


def test_a_pair_with_a_name_that_is_not_there_is_an_error() -> None:
    with pytest.raises(KeyError, match="z"):
        islands_of("ab", [("a", "z")])
