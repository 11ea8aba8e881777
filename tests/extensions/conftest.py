"""Rows of an extension are in the tables while the tests of its module run."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from extended_services import added


@pytest.fixture(autouse=True, scope="module")
def rows(request: pytest.FixtureRequest) -> Iterator[None]:
    """Those that the module names as ROWS: table, name, row."""
    with added(request.module):
        yield
