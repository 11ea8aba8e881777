"""What the chart's picture shows, and whether it can be read: every name is its mark's, every mark is explained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from softseam_studies.study import draw
from softseam_studies.study.configurations import METHODS, Configuration
from softseam_studies.study.errors import Error, Truth
from softseam_studies.study.landmarks import ASKED, Landmark
from softseam_studies.study.measure import Outcome, Status
from softseam_studies.study.reference import Part, Reference
from softseam_studies.study.table import Row

REFERENCE = Reference(
    np.array([0.1, 0.2]),
    {"sag": Truth(np.ones(2), 1.0, 0.01)},
    {"sag": Part(0.005, 0.005, 1.0, float("nan"), 0.01)},
    (),
    "bdf2",
    True,
)
FRONT = {
    423: 26,
    406: 6.4,
    249: 2.9,
    203: 2.85,
    193: 2.6,
    188: 2.4,
    168: 2.3,
    127: 2.1,
    109: 2,
    88: 1.8,
    53: 1.6,
    2: 1.5,
}
"""of tofu_grasp: real-time factors and errors [%]"""
OTHERS = {126: 3, 81: 2.8, 105: 2.2, 112: 2.15, 245: 6.2, 246: 5, 1.2: 26, 40: 25, 95: 24, 140: 25.5, 250: 25, 3: 2.3}


def row(name: str, rtf: float, error: float, *, front: bool = False, status: Status = "done") -> Row:
    """A run of three, the slowest half as fast; its error [1] counts where it is done."""
    walls = (1.0 / rtf, 1.0 / rtf, 2.0 / rtf)
    outcome = Outcome(status, "for a reason", walls=walls, simulated=1.0)
    off = Error(error, False, error) if status == "done" else None
    return Row(Configuration(name, "XPBD", name, (), 1.0), outcome, {"sag": off} if off else {}, off, front)


def drawn(rows: list[Row], rivals: list[Landmark]) -> Figure:
    figure = draw.draw_chart("a test", "a machine", rows, REFERENCE, ASKED, rivals)
    figure.draw_without_rendering()
    return figure


def explained(figure: Figure) -> list[str]:
    """What the legends say."""
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def markers(figure: Figure) -> list[tuple[float, float]]:
    """Where marks are."""
    found = [tuple(map(float, at)) for marks in figure.axes[0].collections for at in np.asarray(marks.get_offsets())]
    return [(at[0], at[1]) for at in found]


def test_what_was_stopped_is_not_drawn_as_failed() -> None:
    rows = [row("good", 10.0, 0.1, front=True), row("slow", 2.0, 0.0, status="stopped")]
    figure = drawn(rows, [])
    assert not any("failed" in text for text in explained(figure))
    assert draw.placed(rows[1]) is None and (2.0, 1.0) not in markers(figure)
    figure = drawn([*rows, row("bad", 3.0, 0.0, status="failed")], [])
    assert any("failed" in text for text in explained(figure)) and (3.0, 1.0) in markers(figure)


def test_rivals_beyond_the_edge_are_marked_so() -> None:
    rows = [row("good", 10.0, 0.1, front=True)]
    near, far = Landmark("near", 0.5, 0.9, "me"), Landmark("far", 0.7, 1.48, "me")
    assert not any("100 %" in text for text in explained(drawn(rows, [near])))
    figure = drawn(rows, [near, far])
    assert any("100 %" in text for text in explained(figure))
    shapes = {
        (float(at[0]), float(at[1])): len(np.asarray(marks.get_paths()[0].vertices))
        for marks in figure.axes[0].collections
        for at in np.asarray(marks.get_offsets())
    }
    assert shapes[0.5, 0.9] != shapes[0.7, 1.0]


def test_the_legend_explains_outlined_marks_and_thin_lines() -> None:
    figure = drawn([row("good", 10.0, 0.1, front=True)], [])
    handles = {
        text.get_text(): handle
        for legend in figure.legends
        for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True)
    }
    front = handles["nothing is both faster and more accurate"]
    assert isinstance(front, Line2D) and front.get_marker() == "o" and front.get_linestyle() == "-"
    assert "slowest to fastest run" in handles
    box = [legend.get_window_extent() for legend in figure.legends]
    assert all(each.x1 < figure.bbox.x1 for each in box)


def test_classic_pbd_has_a_mark_and_a_colour_of_its_own() -> None:
    """A cross in the picture and in the legend; XPBD's, the control, has a circle of another colour."""
    one = row("one", 10.0, 0.3)
    classic = replace(one, configuration=Configuration("two", "PBD", "PBD 2x2x2", (), 1.0))
    figure = drawn([one, classic], [])
    marks = {
        str(line.get_label()): line for legend in figure.legends for line in legend.legend_handles
        if isinstance(line, Line2D)
    }  # fmt: skip
    assert marks["PBD"].get_marker() == "P" and marks["XPBD"].get_marker() == "o"
    assert marks["PBD"].get_color() != marks["XPBD"].get_color()
    note = "stiffness follows from step and iterations"
    notes = ["\n".join(text.get_text() for text in each.texts) for each in (figure, drawn([one], []))]
    assert note in notes[0] and note not in notes[1]
    assert len(set(draw.TONES.values())) == len(draw.TONES) == len(METHODS)
    drawn_as = {each.get_gid(): each for each in figure.axes[0].collections if str(each.get_gid()).startswith("run-")}
    paths = [drawn_as[f"run-{key}"].get_paths()[0].vertices for key in ("one", "two")]
    assert np.shape(paths[0]) != np.shape(paths[1])


def test_a_picture_without_a_front_is_drawn() -> None:
    figure = drawn([row("bad", 3.0, 0.0, status="failed")], [])
    assert all(mark.label in figure.texts[-1].get_text() for mark in ASKED)


def test_marks_of_the_front_have_numbers_and_the_list_says_what_they_are() -> None:
    """On a crowded front, too: a number stands on its mark, none on another number, and the list has all."""
    rows = [row(f"hex27_reduced 3x1x2, {s} ms", s, e / 100, front=True) for s, e in FRONT.items()]
    rows += [row(f"other {s}", s, e / 100) for s, e in OTHERS.items()]
    figure = drawn(rows, [Landmark("rival 1", 0.33, 0.28, "me")])
    axes = figure.axes[0]
    texts = [text for text in axes.texts if text.get_text().isdigit()]
    boxes = [text.get_window_extent() for text in texts]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    speeds = sorted(FRONT, reverse=True)
    for text in texts:
        speed = speeds[int(text.get_text()) - 1]
        assert text.get_position() == pytest.approx((speed, FRONT[speed] / 100))
    listed = " ".join(figure.texts[-1].get_text().split())
    for number, speed in enumerate(speeds, 1):
        assert f"{number} hex27_reduced 3x1x2, {speed} ms: {speed:.3g}x, {FRONT[speed]:.2g} %" in listed
    assert "other" not in listed and "rival 1: 0.33x, 28 %" in listed
    box = figure.texts[-1].get_window_extent()
    assert box.x0 > axes.get_window_extent().x1 and box.x1 < figure.bbox.x1 and box.y0 > 0.0
