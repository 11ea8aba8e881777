"""How kernels call the signed distance of a shape from outside."""

from softseam_services.jit import Prototype

DISTANCE = Prototype(
    "signed distance of a tool's shape",
    {"size": int, "numbers": ("size",), "x": float, "y": float, "z": float},
    returns=4,
    lengths=("size",),
)
