"""VTK's legacy files of POLYDATA and UNSTRUCTURED_GRID, in text or big-endian binary.

Cells are lists (until version 4) or OFFSETS and CONNECTIVITY (from 5 on). Fields are left out.
"""

import re

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats
from softseam_services.body.errors import MeshError
from softseam_services.body.formats.mesh_file import Cells, MeshFile
from softseam_services.body.formats.text import list_starts, numbers, quoted
from softseam_services.body.formats.vtk_cells import vtk_cells

_NUMBERS = {"char": ">i1", "unsigned_char": ">u1", "short": ">i2", "unsigned_short": ">u2", "int": ">i4",
            "unsigned_int": ">u4", "long": ">i8", "unsigned_long": ">u8", "float": ">f4", "double": ">f8",
            "vtkidtype": ">i8", "vtktypeint32": ">i4", "vtktypeint64": ">i8"}  # fmt: skip
_POLYDATA = {"VERTICES": 1, "LINES": 4, "POLYGONS": 7, "TRIANGLE_STRIPS": 6}
"""types of the cells of each section"""
_DATASET = re.compile(rb"^\s*DATASET\s+(\w+)", re.M | re.I)


def legacy_dataset(data: bytes) -> str:
    """What a file is a dataset of, in capitals; "" where it does not say so."""
    found = _DATASET.search(data[:4096])
    return found[1].decode().upper() if found else ""


def read_legacy(path: str, data: bytes) -> MeshFile:
    """Points and cells; raises MeshError where the file is not whole."""
    body = _Body(data)
    points: Floats = np.zeros((0, 3))
    found: list[tuple[Cells, Cells, Cells]] = []
    grid: tuple[Cells, Cells] | None = None
    try:
        while (words := body.line()) is not None:
            word = words[0].upper()
            if word == "POINTS":
                points = body.numbers(3 * int(words[1]), words[2]).reshape(-1, 3).astype(np.float64)
            elif word in _POLYDATA:
                nodes, sizes = body.cells(int(words[1]), int(words[2]))
                found.append((np.full(len(sizes), _POLYDATA[word]), nodes, sizes))
            elif word == "CELLS":
                grid = body.cells(int(words[1]), int(words[2]))
            elif word == "CELL_TYPES" and grid is not None:
                found.append((body.numbers(int(words[1]), "int").astype(np.int64), *grid))
            elif word == "FIELD":
                body.skip_field(int(words[2]))
            elif word in ("CELL_DATA", "POINT_DATA"):
                break
        if grid is not None and not found:
            raise ValueError("it has CELLS without CELL_TYPES")
        types, nodes, sizes = (
            (np.concatenate([np.zeros(0, dtype=np.int64), *parts]) for parts in zip(*found, strict=True))
            if found
            else (np.zeros(0, dtype=np.int64),) * 3
        )
        return vtk_cells(points, types, nodes, sizes)
    except (ValueError, KeyError, IndexError) as error:
        reason = str(error)
        if isinstance(error, LookupError):
            reason = "it ends too early" if isinstance(error, IndexError) else f"no type {error} is known"
        raise MeshError(f"{path}: is no whole VTK file ({reason}): save it anew, or as STL") from None


class _Body:
    """A legacy file from its fourth line on: lines of words, and blocks of numbers."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0
        for _ in range(2):
            self._raw()
        self._binary = self._raw().strip().upper() == b"BINARY"

    def _raw(self) -> bytes:
        end = self._data.find(b"\n", self._at)
        end = len(self._data) if end < 0 else end
        line, self._at = self._data[self._at : end], end + 1
        return line

    def line(self) -> list[str] | None:
        """Words of the next line that has any; None at the end."""
        while self._at < len(self._data):
            words = self._raw().decode("latin-1").split()
            if words:
                return words
        return None

    def numbers(self, count: int, kind: str) -> NDArray[np.generic]:
        """So many numbers of a type of VTK. Raises ValueError where there are fewer."""
        dtype = np.dtype(_NUMBERS[kind.lower()])
        if self._binary:
            if self._at + count * dtype.itemsize > len(self._data):
                raise ValueError(f"it ends before {count:,} numbers")
            found = np.frombuffer(self._data, dtype, count, self._at)
            self._at += found.nbytes
            return found.astype(dtype.newbyteorder("="))
        lines, n_words = [], 0
        while n_words < count and self._at < len(self._data):
            lines.append(self._raw())
            n_words += len(lines[-1].split())
        values = numbers(b" ".join(lines))
        if len(values) != count:
            raise ValueError(f"{len(values):,} numbers in place of {count:,}")
        return values.astype(dtype.newbyteorder("="))

    def cells(self, n: int, size: int) -> tuple[Cells, Cells]:
        """Nodes of the cells of a section (k,), and how many each has (m,): n lists with their lengths, `size` numbers
        in all; or n offsets and `size` numbers."""
        here = self._at
        words = self.line()
        if words is not None and words[0].upper() == "OFFSETS":
            offsets = self.numbers(n, words[1]).astype(np.int64)
            kind = self.line()
            if kind is None or kind[0].upper() != "CONNECTIVITY":
                raise ValueError("it has no CONNECTIVITY after OFFSETS")
            return self.numbers(size, kind[1]).astype(np.int64), np.diff(offsets)
        self._at = here
        flat = (self.numbers(size, "int") if self._binary else self._to_next_word()).astype(np.int64)
        starts = list_starts(flat, n)
        return np.delete(flat, starts), flat[starts]

    def _to_next_word(self) -> Floats:
        """Numbers of a text until a line of words; so many files give a wrong count of them that none is asked for."""
        lines = []
        while self._at < len(self._data):
            here, line = self._at, self._raw()
            if line.strip()[:1].isalpha():
                self._at = here
                break
            lines.append(line)
        return numbers(b" ".join(lines))

    def skip_field(self, n: int) -> None:
        """Pass over n arrays; in text their lines are no sections, and are passed over anyway."""
        for _ in range(n if self._binary else 0):
            words = self.line()
            if words is None or words[-1].lower() not in _NUMBERS:
                raise ValueError(f"a FIELD with {quoted(words or [])}")
            self.numbers(int(words[1]) * int(words[2]), words[3])
