"""Pieces in this processor's memory, and threads that step them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from .kernels.group import N_ROWS_OF_BLOCK, N_ROWS_OF_PAIR
from .kernels.processor import LANES, advance
from .pieces import Ints, Singles, Structure, Timing

Indices = NDArray[np.int64]


class OnProcessor:
    """k pieces, in groups of as many lanes as a vector register holds."""

    def __init__(self, structure: Structure, count: int, timing: Timing, threads: int = 1) -> None:
        self._structure, self._timing, self.count = structure, timing, count
        groups = -(-count // LANES)
        self._state: Singles = np.zeros((groups, structure.layout.rows, LANES), np.float32)
        self.room = groups * LANES
        """pieces that there is room for"""
        threads = max(1, min(threads, groups))
        self._parts = [(groups * part // threads, groups * (part + 1) // threads) for part in range(threads)]
        self._rooms = [self._workspaces() for _ in self._parts]
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def _workspaces(self) -> tuple[Singles, Singles, Ints, Ints]:
        shared = self._structure
        return (
            np.zeros(N_ROWS_OF_BLOCK * LANES, np.float32),
            np.zeros(N_ROWS_OF_PAIR * LANES, np.float32),
            np.zeros((len(shared.kind), 1 + len(shared.points)), np.int32),
            np.zeros(1 + len(shared.nodes), np.int32),
        )

    def write(self, which: Indices, numbers: Singles) -> None:
        """All rows of some pieces (k, rows)."""
        self._state[which // LANES, :, which % LANES] = numbers

    def write_rows(self, first: int, numbers: Singles) -> None:
        """Rows from `first` on of all pieces (count, n)."""
        which = np.arange(len(numbers))
        self._state[which // LANES, first : first + numbers.shape[1], which % LANES] = numbers

    def read(self, piece: int) -> Singles:
        """All rows of a piece (rows,)."""
        return self._state[piece // LANES, :, piece % LANES].copy()

    def read_rows(self, first: int, end: int) -> Singles:
        """Of all pieces (count, end - first)."""
        part = self._state[:, first:end].transpose(0, 2, 1)
        return np.ascontiguousarray(part).reshape(-1, end - first)[: self.count]

    def step(self) -> None:
        """Of all pieces."""
        if self._pool is None:
            self._advance(0)
        else:
            list(self._pool.map(self._advance, range(len(self._parts))))

    def _advance(self, part: int) -> None:
        shared, (ws, row, active, held) = self._structure, self._rooms[part]
        first, end = self._parts[part]
        state = self._state.reshape(len(self._state), -1)
        advance(
            *(state, first, end, ws, row, shared.layout, shared.nodes, shared.n_nodes, shared.points, shared.kind),
            *(shared.shape, shared.gravity, self._timing, active, held),
        )

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()
