"""Keeps numba's disk cache honest.

Numba keys a compiled kernel by the source of its own file alone, but the machine code holds the kernels that it calls
from other files, too: after an edit or an upgrade of one file, callers in unchanged files would go on with the old
code. So the cache of all packages is dropped whenever any source in them changed. And services that start together
would each compile the kernels that they share: one compiles, the others wait for it.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import importlib.util
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

_STAMP = "kernels.sha256"


def kernel_packages() -> list[Path]:
    """Folders of the packages that hold kernels which may call each other."""
    names = ("softseam_services", "softseam_coupling")
    specs = (importlib.util.find_spec(name) for name in names)
    return [Path(spec.origin).parent for spec in specs if spec is not None and spec.origin is not None]


def drop_stale_kernels(packages: Iterable[Path]) -> int:
    """Forget compiled kernels where a source of these packages changed since the last call; how many were forgotten.

    On a file system that cannot be written nothing is done: nothing can change there either.
    """
    folders = list(packages)
    digest = hashlib.sha256()
    for folder in folders:
        for source in sorted(folder.rglob("*.py")):
            text = source.read_bytes()
            if b"njit" in text:
                digest.update(str(source.relative_to(folder)).encode() + b"\0" + text)
    stamp = folders[0] / "__pycache__" / _STAMP
    dropped = 0
    with contextlib.suppress(OSError):
        if stamp.exists() and stamp.read_text() == digest.hexdigest():
            return 0
        for folder in folders:
            for index in folder.rglob("__pycache__/*.nbi"):
                index.unlink(missing_ok=True)
                dropped += 1
        stamp.parent.mkdir(exist_ok=True)
        fresh = stamp.with_suffix(f".{os.getpid()}")
        fresh.write_text(digest.hexdigest())
        fresh.replace(stamp)
    return dropped


@contextlib.contextmanager
def compiling(model: str) -> Iterator[None]:
    """One process of a machine at a time compiles the kernels of `model`; those that waited load them from the cache.

    The lock goes with its process, however that ends. Without a place for the lock there is none.
    """
    lock = kernel_packages()[0] / "__pycache__" / f"{model}.lock"
    with contextlib.ExitStack() as held:
        with contextlib.suppress(OSError):
            fcntl.flock(held.enter_context(lock.open("w")), fcntl.LOCK_EX)
        yield
