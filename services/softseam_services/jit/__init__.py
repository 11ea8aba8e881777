"""Every use of numba's internals, behind two decorators.

`njit` compiles a kernel together with the kernels that it calls; `record` makes a named tuple of arrays one pointer.
"""

from softseam_services.jit.linking import njit
from softseam_services.jit.records import record

__all__ = ["njit", "record"]
