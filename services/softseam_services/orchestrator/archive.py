"""A simulation's state as bytes: named arrays and texts, no pickle."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray


class ArchiveError(ValueError):
    """The bytes are no state of a simulation, or not of this one."""


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
