"""What the chart's picture shows, and whether it can be read: every name is its mark's, every mark is explained."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from softseam.study import draw
from softseam.study.configurations import Configuration
from softseam.study.errors import Error, Truth
from softseam.study.landmarks import ASKED, Landmark
from softseam.study.measure import Outcome, Status
from softseam.study.reference import Part, Reference
from softseam.study.table import Row

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


def drawn(rows: list[Row], rivals: list[Landmark], path: Path, patch: pytest.MonkeyPatch) -> Figure:
    """The figure, as it is written."""
    kept: list[Figure] = []

    def keep(figure: Figure, where: Path) -> Path:
        kept.append(figure)
        return where

    patch.setattr(draw, "write", keep)
    draw.draw_chart(path, "a test", "a machine", rows, REFERENCE, ASKED, rivals)
    kept[0].draw_without_rendering()
    return kept[0]


def explained(figure: Figure) -> list[str]:
    """What the legends say."""
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def markers(figure: Figure) -> list[tuple[float, float]]:
    """Where marks are."""
    found = [tuple(map(float, at)) for marks in figure.axes[0].collections for at in np.asarray(marks.get_offsets())]
    return [(at[0], at[1]) for at in found]


def test_what_was_stopped_is_not_drawn_as_failed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [row("good", 10.0, 0.1, front=True), row("slow", 2.0, 0.0, status="stopped")]
    figure = drawn(rows, [], tmp_path / "chart.png", monkeypatch)
    assert not any("failed" in text for text in explained(figure))
    assert draw.placed(rows[1]) is None and (2.0, 1.0) not in markers(figure)
    figure = drawn([*rows, row("bad", 3.0, 0.0, status="failed")], [], tmp_path / "chart.png", monkeypatch)
    assert any("failed" in text for text in explained(figure)) and (3.0, 1.0) in markers(figure)


def test_rivals_beyond_the_edge_are_marked_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [row("good", 10.0, 0.1, front=True)]
    near, far = Landmark("near", 0.5, 0.9, "me"), Landmark("far", 0.7, 1.48, "me")
    assert not any("100 %" in text for text in explained(drawn(rows, [near], tmp_path / "chart.png", monkeypatch)))
    figure = drawn(rows, [near, far], tmp_path / "chart.png", monkeypatch)
    assert any("100 %" in text for text in explained(figure))
    shapes = {
        (float(at[0]), float(at[1])): len(np.asarray(marks.get_paths()[0].vertices))
        for marks in figure.axes[0].collections
        for at in np.asarray(marks.get_offsets())
    }
    assert shapes[0.5, 0.9] != shapes[0.7, 1.0]


def test_the_legend_explains_outlined_marks_and_thin_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figure = drawn([row("good", 10.0, 0.1, front=True)], [], tmp_path / "chart.png", monkeypatch)
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


def test_every_name_is_its_mark_s(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a crowded front, too: a name covers no other and no mark, and either its own mark is the nearest one or a line
    leads to it; marks that cover each other share a name."""
    rows = [row(f"hex27_reduced 3x1x2, {s} ms", s, e / 100, front=True) for s, e in FRONT.items()]
    rows += [row(f"other {s}", s, e / 100) for s, e in OTHERS.items()]
    rivals = [Landmark("rival 1", 0.33, 0.28, "me"), Landmark("rival 2", 0.335, 0.279, "me")]
    figure = drawn(rows, rivals, tmp_path / "chart.png", monkeypatch)
    axes = figure.axes[0]
    marks = axes.transData.transform(np.array(markers(figure)))
    lines = [line.get_window_extent() for line in axes.lines if line.get_linewidth() < 0.8]
    lines += [line.get_window_extent() for line in axes.artists if isinstance(line, Line2D)]
    at = {r.configuration.label: axes.transData.transform((r.outcome.rtf, r.error.value)) for r in rows if r.error}
    at |= {mark.label: axes.transData.transform((mark.rtf, mark.error)) for mark in (*ASKED, *rivals)}
    names = [text for text in axes.texts if text.get_text().split("\n")[0] in at]
    told = [name for text in names for name in text.get_text().split("\n")]
    unnamed = {f"hex27_reduced 3x1x2, {s} ms" for s in (193, 168, 127)} | {f"other {s}" for s in OTHERS}
    assert sorted(told) == sorted(set(at) - unnamed), "nothing else is left out"
    boxes = [text.get_window_extent() for text in names]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    for text, box in zip(names, boxes, strict=True):
        own = at[text.get_text().split("\n")[0]]
        gaps = np.hypot(*np.maximum(np.maximum(box.min - marks, marks - box.max), 0.0).T)
        assert gaps.min() > 5.0, f"{text.get_text()} covers a mark"
        same = np.hypot(*(marks - own).T) < 0.1 * figure.dpi
        led = any(line.padded(15.0).contains(*own) and line.padded(2.0).overlaps(box) for line in lines)
        assert led or gaps[same].min() < gaps[~same].min(), f"{text.get_text()} reads as another's"


def test_a_picture_without_a_front_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figure = drawn([row("bad", 3.0, 0.0, status="failed")], [], tmp_path / "chart.png", monkeypatch)
    assert {text.get_text() for text in figure.axes[0].texts if isinstance(text, Text)} >= {m.label for m in ASKED}
