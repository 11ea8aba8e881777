"""Every use of numba's internals, behind two decorators and a class.

`njit` compiles a kernel together with the kernels that it calls; `record` makes a named tuple of arrays one pointer,
`Rows` several of these;
`Prototype` lets a kernel call, by its address, a function that was added from outside.
"""

from softseam_services.jit.linking import njit
from softseam_services.jit.pointer import Prototype, PrototypeError
from softseam_services.jit.records import Rows, n_bytes, record

__all__ = ["Prototype", "PrototypeError", "Rows", "n_bytes", "njit", "record"]
