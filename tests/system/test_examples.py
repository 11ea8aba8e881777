"""Every example program runs to its end and says something."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

import softseam.examples

EXAMPLES = sorted(p.stem for p in Path(softseam.examples.__path__[0]).glob("[a-z]*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_example_runs(name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    example = importlib.import_module(f"softseam.examples.{name}")
    if name == "learn_grip":
        for size, small in (("GENERATIONS", 2), ("CANDIDATES", 6), ("PIECES", range(2)), ("OTHERS", range(100, 102))):
            monkeypatch.setattr(example, size, small)  # learning it takes half a minute
    example.main()
    assert len(capsys.readouterr().out.splitlines()) >= 2


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 3
