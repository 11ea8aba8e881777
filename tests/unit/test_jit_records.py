"""Records that kernels take by reference."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from softseam_services.jit import Rows, record


@record
class Inner(NamedTuple):
    values: NDArray[np.float64]


@record
class Outer(NamedTuple):
    matrix: NDArray[np.float64]
    counts: NDArray[np.int32]
    flags: NDArray[np.bool_]
    inner: Inner
    scale: float
    n: int
    on: bool


def outer(**changes: Any) -> Outer:
    matrix = np.arange(24.0).reshape(4, 6)[:, ::2]  # not contiguous
    counts, flags = np.array([3, 4], dtype=np.int32), np.array([True, False])
    fields: dict[str, Any] = {"matrix": matrix, "counts": counts, "flags": flags, "inner": Inner(np.array([-7.0]))}
    return Outer(**(fields | {"scale": -0.5, "n": -3, "on": True} | changes))


@njit
def _read(o):  # type: ignore[no-untyped-def]
    shape = o.matrix.shape[0] * 100 + o.matrix.shape[1] * 10 + o.counts.size
    return o.matrix[3, 2], o.counts[1], o.flags[0], o.flags[1], o.inner.values[0], o.scale, o.n, o.on, shape


@njit
def _fill(o):  # type: ignore[no-untyped-def]
    for i in range(len(o.matrix)):
        o.matrix[i, 1] = o.scale * o.matrix[i, 0]
    o.inner.values[0] += 1.0
    return o.matrix[2, 1]


@pytest.mark.kernels
def test_a_kernel_reads_what_python_reads() -> None:
    for o in (outer(), outer(on=False, scale=float("inf"), n=2**40)):
        expected = (o.matrix[3, 2], 4, True, False, -7.0, o.scale, o.n, o.on, 432)
        assert _read(o) == expected


@pytest.mark.kernels
def test_a_kernel_writes_into_the_same_arrays() -> None:
    o = outer()
    assert _fill(o) == -0.5 * o.matrix[2, 0] == o.matrix[2, 1]
    assert o.inner.values[0] == -6.0


@pytest.mark.kernels
def test_a_record_is_fixed_but_can_be_replaced() -> None:
    o = outer()
    with pytest.raises(AttributeError, match=r"Outer\.scale is fixed"):
        o.scale = 2.0  # type: ignore[misc]
    other = o._replace(scale=2.0)
    assert (o.scale, other.scale) == (-0.5, 2.0) and other.matrix is o.matrix
    assert _read(other)[5] == 2.0


def test_records_of_other_types_are_other_records_to_a_kernel() -> None:
    """A number in place of an array, or another rank, is seen by the compiler, not read as what it is not."""
    with pytest.raises(TypeError, match="counts is str: records for kernels hold"):
        outer(counts="3")
    flat = outer(matrix=np.zeros(3))
    assert type(flat) is type(outer()) and flat._numba_type_ != outer()._numba_type_  # type: ignore[attr-defined]
    assert outer()._numba_type_ == outer()._numba_type_  # type: ignore[attr-defined]


KERNEL = """
from typing import NamedTuple
import numpy as np
from numba import njit
from softseam_services.jit import Rows, record

@record
class TwoThreads(NamedTuple):
    a: np.ndarray
    b: float

@njit(cache=True)
def total(pair):
    return pair.a.sum() + pair.b

if __name__ == "__main__":
    import total_of
    print(total_of.total(total_of.TwoThreads(np.arange(4.0), 0.5)), sum(total_of.total.stats.cache_hits.values()))
"""


@pytest.mark.kernels
def test_kernels_of_records_come_from_the_cache(tmp_path: Path) -> None:
    (tmp_path / "total_of.py").write_text(KERNEL)
    runs = [
        subprocess.run(
            [sys.executable, "total_of.py"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=120
        ).stdout.split()
        for _ in range(2)
    ]
    assert runs == [["6.5", "0"], ["6.5", "1"]]


@record
class Cell(NamedTuple):
    """One row."""

    x: NDArray[np.float64]
    factor: float


@njit(cache=False, error_model="numpy")
def scaled(rows: Any, which: Any) -> None:
    """x <- factor x of these rows."""
    for row in which:
        for i in range(len(rows[row].x)):
            rows[row].x[i] *= rows[row].factor


@pytest.mark.kernels
def test_rows_of_records_are_taken_by_place() -> None:
    """Kernels change the arrays of the rows that they are to, whatever their lengths; rows of two types are refused."""
    arrays = [np.ones(n + 1) for n in range(3)]
    rows = Rows([Cell(x, 2.0 + n) for n, x in enumerate(arrays)])
    scaled(rows, np.array([2, 0]))
    scaled(rows, np.array([2]))
    assert [x.tolist() for x in arrays] == [[2.0], [1.0, 1.0], [16.0] * 3]
    assert len(rows) == 3 and rows[1].x is arrays[1]
    with pytest.raises(TypeError, match="one type"):
        Rows([Cell(np.ones(1), 1.0), Cell(np.ones((1, 1)), 1.0)])
