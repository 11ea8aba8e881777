"""Pieces in the memory of a graphics card, which steps them: CUDA, by numba-cuda."""

from typing import Any

import numpy as np

from softseam_services.body.errors import SettingError

from .on_processor import Indices
from .pieces import Singles, Structure, Timing

_THREADS = (1, 128)
"""of a block that copies: pieces and rows"""


class OnCard:
    """k pieces, in groups of as many lanes as a warp has. Raises SettingError where there is no such card."""

    def __init__(self, structure: Structure, count: int, timing: Timing) -> None:
        try:
            import numba.cuda

            cuda: Any = numba.cuda
            there = bool(cuda.is_available())
        except ImportError:
            there = False
        if not there:
            raise SettingError(
                "device cuda: there is no graphics card here that numba-cuda can use; leave device out, or "
                "pip install 'softseam[cuda]' on a machine with one"
            )
        from .kernels import card, card_rows

        self._cuda, self._card, self._copy = cuda, card, card_rows
        self._structure, self._timing = structure, timing
        self.count = count
        groups = -(-count // card.LANES)
        self.room = groups * card.LANES
        self._groups, self._rows = groups, structure.layout.rows
        self._state = self._to_card(np.zeros(groups * self._rows * card.LANES, np.float32))
        self._flags = self._to_card(np.zeros((groups, len(structure.kind), len(structure.points)), np.int32))
        shared = structure.nodes, structure.colours, structure.points
        self._nodes, self._colours, self._points = (self._to_card(each) for each in shared)
        self._tools = [self._to_card(each) for each in (structure.kind, structure.shape, structure.gravity)]

    def _to_card(self, numbers: Any) -> Any:
        return self._cuda.to_device(np.ascontiguousarray(numbers))

    def _grid(self, count: int, n: int) -> tuple[tuple[int, int], tuple[int, int]]:
        return (count, -(-n // _THREADS[1])), _THREADS

    def write(self, which: Indices, numbers: Singles) -> None:
        """All rows of some pieces (k, rows)."""
        self._copy.write_lanes[self._grid(*numbers.shape)](
            self._state, self._to_card(which.astype(np.int64)), self._to_card(numbers)
        )

    def write_rows(self, first: int, numbers: Singles) -> None:
        """Rows from `first` on of all pieces (count, n)."""
        grid = self._grid(*numbers.shape)
        self._copy.write_rows[grid](self._state, self._rows, first, self._to_card(numbers))

    def read(self, piece: int) -> Singles:
        """All rows of a piece (rows,)."""
        found = self._cuda.device_array((1, self._rows), np.float32)
        which = self._to_card(np.array([piece], dtype=np.int64))
        self._copy.read_lanes[self._grid(*found.shape)](self._state, which, found)
        return self._to_host(found).reshape(-1)

    def read_rows(self, first: int, end: int) -> Singles:
        """Of all pieces (count, end - first)."""
        found = self._cuda.device_array((self.count, end - first), np.float32)
        self._copy.read_rows[self._grid(*found.shape)](self._state, self._rows, first, found)
        return self._to_host(found)

    @staticmethod
    def _to_host(found: Any) -> Singles:
        numbers: Singles = np.empty(tuple(found.shape), np.float32)
        found.copy_to_host(numbers)
        return numbers

    def step(self) -> None:
        """Of all pieces."""
        now, threads = self._timing, self._card.LANES * self._card.WARPS
        self._card.advance[self._groups, threads](
            *(self._state, tuple(self._structure.layout), self._nodes, self._colours, self._structure.n_nodes),
            *(self._points, *self._tools, now.kappa, now.keep, now.h, now.substeps, now.step, now.share, now.margin),
            self._flags,
        )

    def close(self) -> None:
        """Free its memory."""
        del self._state, self._flags
