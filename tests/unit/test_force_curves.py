"""Files of measured forces: what is read, what is refused in which words, and how a run is read off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from softseam.errors import BadInput
from softseam.losses import Run
from softseam_studies.fit.curve import Curve, check_times, read_curve, read_off

TOOLS = ["ground", "left"]


def _file(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "curve.csv"
    path.write_text(text)
    return path


def test_columns_are_read_by_name_in_any_order(tmp_path: Path) -> None:
    curve = read_curve(_file(tmp_path, "left.x, time ,left\n\n-1,0.1,2\n-3,0.2,4\n"), TOOLS)
    assert curve.columns == ("left.x", "left")
    np.testing.assert_array_equal(curve.time, [0.1, 0.2])
    np.testing.assert_array_equal(curve.force, [[-1.0, 2.0], [-3.0, 4.0]])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty: begin with a line of names"),
        ("time,lefft\n0,1\n", r"curve.csv:1: no column is called 'lefft'; did you mean 'left'\?"),
        ("left\n1\n", "name each column once: time"),
        ("time,time,left\n1,1,1\n", "name each column once"),
        ("time,left\n0.1,nan\n", r"curve.csv:2: left is 'nan': give a finite number"),
        ("time,left\n0.1,1\n0.2,soft\n", r"curve.csv:3: left is 'soft'"),
        ("time,left\n0.1,1,3\n", r"curve.csv:2: 3 cells, where 2 columns are named"),
        ("time,left\n0.2,1\n0.1,1\n", r"curve.csv:3: the time 0.1 s does not follow 0.2 s"),
        ("time,left\n-0.2,1\n", r"curve.csv:2: the time -0.2 s is before the run begins"),
        ("\x00\x01", "curve.csv"),
    ],
)
def test_bad_files_are_refused_with_line_and_remedy(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        read_curve(_file(tmp_path, text), TOOLS)


def test_times_beyond_the_run_are_refused(tmp_path: Path) -> None:
    curve = read_curve(_file(tmp_path, "time,left\n0.1,1\n0.9,1\n"), TOOLS)
    check_times(curve, tmp_path, 0.9, 0.01)
    with pytest.raises(BadInput, match=r"go to 0.9 s, and the scene's run ends at 0.5 s"):
        check_times(curve, tmp_path, 0.5, 0.01)


def test_a_run_is_read_off_between_steps_with_its_slopes() -> None:
    """Two steps of 0.1 s: sizes and parts of forces, straight from 0 at the start; slopes are differences of it."""
    force = np.array([[3.0, 4.0, 0.0], [6.0, 8.0, 0.0]])
    way = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, -1.0]])

    def run(by: float) -> Run:
        moved = {"ground": np.zeros((2, 3)), "left": force + by * way}
        return Run(np.array([0.1, 0.2]), moved, np.zeros((2, 1, 3)), np.zeros((1, 3)), {})

    slopes = np.zeros((1, 2, 2, 3))
    slopes[0, :, 1] = way
    curve = Curve(np.array([0.05, 0.15]), ("left", "left.y"), np.zeros((2, 2)))
    found, by = read_off(curve, run(0.0), slopes)
    np.testing.assert_allclose(found, [2.5, 2.0, 7.5, 6.0])
    apart = 1e-6
    differences = (read_off(curve, run(apart), slopes)[0] - read_off(curve, run(-apart), slopes)[0]) / (2 * apart)
    np.testing.assert_allclose(by[:, 0], differences, rtol=1e-8)
