"""A simulation's state as bytes: named arrays and texts, no pickle.

Whoever evolves saves itself as arrays by name; who holds it puts its own name before these.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Arrays = dict[str, NDArray[np.generic]]
G = TypeVar("G", bound=np.generic)


class ArchiveError(ValueError):
    """The bytes are no state of a simulation, or not of this one."""


def under(begin: str, arrays: Mapping[str, NDArray[G]]) -> dict[str, NDArray[G]]:
    """These arrays, whose names begin like this then."""
    return {begin + name: array for name, array in arrays.items()}


def named(arrays: Mapping[str, NDArray[G]], begin: str) -> dict[str, NDArray[G]]:
    """Those whose names begin like this, by the rest of their names."""
    return {name.removeprefix(begin): array for name, array in arrays.items() if name.startswith(begin)}


def floats(arrays: Mapping[str, NDArray[np.generic]]) -> dict[str, NDArray[np.float64]]:
    """The same in double precision."""
    return {name: array.astype(np.float64) for name, array in arrays.items()}


def as_bytes(states: Mapping[str, bytes]) -> Arrays:
    """Snapshots of others, each as an array of bytes (n,)."""
    return {name: np.frombuffer(state, dtype=np.uint8) for name, state in states.items()}


def pack(entries: Mapping[str, NDArray[np.generic] | bytes]) -> bytes:
    """All entries in one NumPy archive; bytes become uint8 arrays."""
    arrays = {k: np.frombuffer(v, dtype=np.uint8) if isinstance(v, bytes) else v for k, v in entries.items()}
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def unpack(data: bytes) -> dict[str, NDArray[np.generic]]:
    """The entries again. Raises ArchiveError."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, OSError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise ArchiveError(f"this is no saved state of softseam ({error}); pass what `snapshot` returned") from error
