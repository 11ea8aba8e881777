"""Rows of pieces into the memory of a graphics card, and back."""

from .card import LANES, cuda


@cuda.jit
def write_lanes(state, which, numbers):
    """All rows of some pieces: numbers (k, rows) of the pieces which (k,), into state (groups * rows * LANES,)."""
    k, row = cuda.grid(2)
    if k < numbers.shape[0] and row < numbers.shape[1]:
        group, lane = which[k] // LANES, which[k] % LANES
        state[LANES * (group * numbers.shape[1] + row) + lane] = numbers[k, row]


@cuda.jit
def read_lanes(state, which, numbers):
    """The way back of `write_lanes`."""
    k, row = cuda.grid(2)
    if k < numbers.shape[0] and row < numbers.shape[1]:
        group, lane = which[k] // LANES, which[k] % LANES
        numbers[k, row] = state[LANES * (group * numbers.shape[1] + row) + lane]


@cuda.jit
def write_rows(state, rows, first, numbers):
    """Some of `rows` rows of all pieces: numbers (k, count), from the row `first` on."""
    k, row = cuda.grid(2)
    if k < numbers.shape[0] and row < numbers.shape[1]:
        state[LANES * (k // LANES * rows + first + row) + k % LANES] = numbers[k, row]


@cuda.jit
def read_rows(state, rows, first, numbers):
    """The way back of `write_rows`."""
    k, row = cuda.grid(2)
    if k < numbers.shape[0] and row < numbers.shape[1]:
        numbers[k, row] = state[LANES * (k // LANES * rows + first + row) + k % LANES]
