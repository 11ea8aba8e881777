"""`group.advance_groups` for a processor: float32, as many lanes as a vector register holds."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from softseam_services.jit import njit
from softseam_services.jit.retarget import Retarget
from softseam_services.pbd.kernels.lanes import lane_kernel

from .group import advance_groups

LANES = 8
"""pieces of a group"""
_VECTOR = ir.VectorType(ir.FloatType(), LANES)


@intrinsic
def _move(typing, to, t, source, s):
    def generate(context, builder, signature, arguments):
        def place(kind, array, index):
            data = context.make_array(kind)(context, builder, array).data
            return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())

        vector = builder.load(place(signature.args[2], arguments[2], arguments[3]), align=4)
        builder.store(vector, place(signature.args[0], arguments[0], arguments[1]), align=4)
        return context.get_dummy_value()

    return types.void(to, t, source, s), generate


@lane_kernel
def logarithm(x):
    """ln x of a normal positive float32, to its last places: `kernels.logarithm` with fewer terms."""
    bits = np.float32(x).view(np.int32)
    e = (bits - np.int32(0x3F3504F3)) >> np.int32(23)
    m = np.int32(bits - (e << np.int32(23))).view(np.float32)
    s = (m - np.float32(1.0)) / (m + np.float32(1.0))
    z = s * s
    low = z * (np.float32(1.0 / 3.0) + z * (np.float32(0.2) + z * (np.float32(1.0 / 7.0) + z * np.float32(1.0 / 9.0))))
    return np.float32(e) * np.float32(0.6931471805599453) + np.float32(2.0) * (s + s * low)


_OF_LOOPS = {f"{__package__}.{name}" for name in ("group", "blocks", "contacts", "rows")}
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}


def _compile(function: Any) -> Any:
    if function.__module__ in _OF_LOOPS:
        return njit(cache=True, apart=True, nogil=True, **_OPTIONS)(function)
    whole = function.__module__.endswith(".lane") or function.__name__.startswith(("project_lane", "_solve"))
    # A loop whose body is nothing but a call would be written out before the compiler sees what is called.
    return njit(cache=True, **_OPTIONS, **({"inline": "always"} if whole else {"forceinline": True}))(function)


_retarget = Retarget(
    np.float32,
    "of_many",
    _compile,
    {"LANES": LANES, "EIGHT": LANES, "WIDE": LANES},
    {"move": _move, "logarithm": logarithm},
)
advance: Any = _retarget(advance_groups)
