"""One thread for the linear algebra of this process.

With several, OpenBLAS splits a factorisation by the number of cores, so the last bits of a result depend on the
machine; and the models already run side by side. Fronts and seams are small: more threads gain nothing.
"""

import ctypes
import importlib.util
from pathlib import Path

_SETTERS = (
    "scipy_openblas_set_num_threads64_",
    "scipy_openblas_set_num_threads",
    "openblas_set_num_threads64_",
    "openblas_set_num_threads",
)


def use_one_thread() -> int:
    """Have every OpenBLAS that numpy and scipy bring along use one thread; the number of these libraries."""
    count = 0
    for package in ("numpy", "scipy"):
        spec = importlib.util.find_spec(package)
        if spec is None or spec.origin is None:
            continue
        home = Path(spec.origin).parent
        for library in sorted([*home.parent.glob(f"{package}.libs/*openblas*"), *home.glob(".dylibs/*openblas*")]):
            count += _tell(library)
    return count


def _tell(library: Path) -> int:
    try:
        loaded = ctypes.CDLL(str(library))
    except OSError:
        return 0  # not for this machine; then nobody uses it
    for name in _SETTERS:
        setter = getattr(loaded, name, None)
        if setter is not None:
            setter(ctypes.c_int(1))
            return 1
    return 0
