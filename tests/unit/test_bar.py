"""The bar of runs and charts on a terminal: what runs, how much is done, how it stands."""

from __future__ import annotations

import io

from rich.console import Console

from softseam.bar import Bar


def drawn(done: float | None, text: str | None) -> str:
    """A bar as it was drawn last, of which `done` out of 4 is shown."""
    stream = io.StringIO()
    bar = Bar(Console(file=stream, force_terminal=True, width=100, color_system=None), "tofu", 4.0, "setting up")
    bar.show(done, "ETA 3 s", text)
    bar.stop()
    return [line for line in stream.getvalue().splitlines() if "tofu" in line or "run" in line][-1]


def test_a_bar_shows_what_runs_how_much_is_done_and_how_it_stands() -> None:
    half = drawn(2.0, None)
    assert "tofu" in half and "ETA 3 s" in half and "setting up" not in half
    assert half.count("━") > 10
    assert "second run" in drawn(3.0, "second run")
    assert drawn(None, None).split("ETA")[0] == drawn(0.0, None).split("ETA")[0], "None keeps what was done"
