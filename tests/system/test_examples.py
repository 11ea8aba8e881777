"""Every example program runs to its end and says something."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

import softseam.examples
import softseam_studies.examples

APART = {"rllib_lift"}
"""of a process of its own: test_rllib.py"""
EXAMPLES = {
    path.stem: package.__name__
    for package in (softseam.examples, softseam_studies.examples)
    for path in sorted(Path(package.__path__[0]).glob("[a-z]*.py"))
    if path.stem not in APART
}
"""by name, the package of each"""


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_example_runs(name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    example = importlib.import_module(f"{EXAMPLES[name]}.{name}")
    if name == "learn_grip":
        for size, small in (("GENERATIONS", 2), ("CANDIDATES", 6), ("PIECES", range(2)), ("OTHERS", range(100, 102))):
            monkeypatch.setattr(example, size, small)  # learning it takes half a minute
    if name == "gentlest_lift":
        monkeypatch.setattr(example, "RUNS", 40)
    example.main()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) >= 2
    if name == "gentlest_lift":  # a plan that did not lift became one that does, with less stress
        told = {line[:20].strip(): (line[20:28].strip(), float(line[28:39])) for line in lines if "kPa" in line}
        assert told["begun with"][0] == "no" and told["found by gradient"][0] == "yes"
        assert told["found by gradient"][1] < 0.8 * told["begun with"][1]


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 3
