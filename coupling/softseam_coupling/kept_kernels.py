"""Compiled kernels on disk: a help, never a condition.

Numba ends a run where a file of its cache is damaged, as a loss of power leaves it, or cannot be written, as on a full
disk. Here each file begins with a digest of what follows: where that does not match, there is no such file, and the
kernel is compiled and written anew. What cannot be written stays in memory. Each is reported once in a process.

An entry carries its own key and is written before the index that names it. So what an older source left under that
name, or another process wrote there at the same time for other types, is not taken for it.
"""

import hashlib
import itertools
import logging
import pickle
import shutil
import uuid
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache, UserProvidedCacheLocator
from numba.core.serialize import dumps

_log = logging.getLogger(__name__)
_told: set[str] = set()
_DIGEST = hashlib.sha256().digest_size


def njit(*, cache: bool, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit` with the same options, kept on disk in files that may be damaged or impossible to write."""

    def decorate(function: Callable[..., Any]) -> Any:
        kernel = numba.njit(**options)(function)
        if cache and kernel is not function:  # which it is where numba is set not to compile
            keep(kernel)
        return kernel

    return decorate


def keep(kernel: Any) -> None:
    """Let a kernel load what was compiled from disk and write there what it compiles, where there is a place."""
    try:
        kernel._cache = KernelCache(kernel.py_func)
    except RuntimeError as error:  # neither the source's folder nor the user's can be written
        _tell(_NOT_KEPT, error)


def move(packages: Iterable[Path], to: Path) -> int:
    """Put kernels that are kept beside their sources where a process looks for them whose NUMBA_CACHE_DIR is `to`; how
    many files. packages: folders of those sources, in the places that they have for that process."""
    found = [index for folder in packages for index in folder.rglob("__pycache__/*.nbi")]
    files = [file for index in found for file in (index, *index.parent.glob(f"{index.stem}.*.nbc"))]
    for file in files:
        source = file.parent.with_name(file.name)  # or another there
        there = to / UserProvidedCacheLocator.get_suitable_cache_subpath(str(source))  # type: ignore[no-untyped-call]
        there.mkdir(parents=True, exist_ok=True)
        shutil.move(file, there / file.name)
    return len(files)


class KernelCache(FunctionCache):
    """Numba's cache of one kernel, in files that are checked."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        index = Path(self._cache_path, f"{self._impl.filename_base}.nbi")
        self._cache_file = _Files(index, self._impl.locator.get_source_stamp())  # type: ignore[assignment]

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        except OSError as error:
            _tell(_NOT_KEPT, f"{self._cache_path}: {error}")


class _Files:
    """The entries of a kernel, one for each set of argument types: an index, NAME.nbi, and NAME.1.nbc and so on.

    index   path of the index; one of another source or another numba counts as none
    stamp   says which source the kernel is compiled from
    """

    def __init__(self, index: Path, stamp: object) -> None:
        self._index = index
        self._made_of = numba.__version__, stamp

    def load(self, key: Any) -> Any:
        """What was compiled under this key, or None."""
        name = self._names().get(key)
        entry = None if name is None else _read(self._index.with_name(name))
        return entry[1] if entry is not None and entry[0] == key else None

    def save(self, key: Any, data: Any) -> None:
        """Raises OSError where it cannot be written."""
        names = self._names()
        numbered = (f"{self._index.stem}.{number}.nbc" for number in itertools.count(1))
        name = names.get(key) or next(name for name in numbered if name not in names.values())
        _write(self._index.with_name(name), (key, data))
        self._keep_names(names | {key: name})

    def flush(self) -> None:
        self._keep_names({})

    def _names(self) -> dict[Any, str]:
        """Files by keys. Keys are of numba's own types, which another numba may be unable to read."""
        made_of, names = _read(self._index) or (None, b"")
        return pickle.loads(names) if made_of == self._made_of else {}

    def _keep_names(self, names: dict[Any, str]) -> None:
        _write(self._index, (self._made_of, dumps(names)))  # type: ignore[no-untyped-call]


def _read(path: Path) -> Any:
    """What was written to a file; None where there is none that can be read and is whole."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(content[_DIGEST:]).digest() != content[:_DIGEST]:
        _tell(_DAMAGED, path)
        return None
    return pickle.loads(content[_DIGEST:])


def _write(path: Path, what: object) -> None:
    """All of it or nothing. Others write into the same folder, from other machines too."""
    content: bytes = dumps(what)  # type: ignore[no-untyped-call]
    fresh = path.with_name(f"{path.name}.tmp.{uuid.uuid4().hex[:16]}")
    try:
        fresh.write_bytes(hashlib.sha256(content).digest() + content)
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)


_DAMAGED = "compiled kernels on disk are damaged, and compiled anew: %s"
_NOT_KEPT = "compiled kernels cannot be kept on disk, and the next run compiles them again: %s"


def _tell(what: str, where: object) -> None:
    """Of many files only the first."""
    if what not in _told:
        _told.add(what)
        _log.warning(what, where)
