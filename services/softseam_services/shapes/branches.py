"""Numbers by which kernels know softseam's own shapes; a shape from outside goes by the address of its distance."""

PLANE, BOX, SPHERE, CAPSULE, CYLINDER, MESH = 1, 2, 3, 4, 5, 6
BRANCHES = frozenset({PLANE, BOX, SPHERE, CAPSULE, CYLINDER, MESH})
