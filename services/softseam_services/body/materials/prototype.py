"""How kernels call a law by its address: what a response takes and returns."""

from __future__ import annotations

from softseam_services.jit import Prototype

MAX_PARAMETERS = 8
"""numbers of a law, at most; every layout that holds a material's parameters has room for as many"""
RESPONSE = Prototype(
    "response of a material law",
    {"i1": float, "i2": float, "j": float, "parameters": (MAX_PARAMETERS,)},
    returns=10,
)
