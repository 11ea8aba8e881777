"""Numbers by which kernels know softseam's own shapes; others are called by the address of their distance."""

from softseam_services.jit import Prototype

PLANE, BOX, SPHERE, CAPSULE, CYLINDER, MESH = 1, 2, 3, 4, 5, 6
BRANCHES = frozenset({PLANE, BOX, SPHERE, CAPSULE, CYLINDER, MESH})


DISTANCE = Prototype(
    "signed distance of a tool's shape",
    {"size": int, "numbers": ("size",), "x": float, "y": float, "z": float},
    returns=4,
    lengths=("size",),
)
