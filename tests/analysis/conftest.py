"""Every test of the study has its loops in the tables, and leaves none there."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from analysis.rows import added


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    with added():
        yield
