"""How far the tractions on the two sides of a seam are apart.

Each cell's stress is known at eight samples, at +-s in each local coordinate. The trilinear polynomial through them
gives it on a face, and with the face's unit normal n, as it stands,

    t = sigma n,   jump = (mean over the face of |t_near - t_far|^2)^(1/2)                                        (1)

Displacements are tied and forces balanced by the multipliers whatever the jump; it shows that one side, or both, cannot
follow the stress there.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

__all__ = ["face_normals", "face_tractions", "traction_jump"]

_SIGNS = np.array([(o & 1, o >> 1 & 1, o >> 2 & 1) for o in range(8)]) * 2 - 1
_QUARTERS = np.array([(i, j) for j in (-0.5, 0.5) for i in (-0.5, 0.5)])


def face_normals(corners: Floats) -> Floats:
    """Unit normals (f, 3) of faces with corners (f, 4, 3) in the order (0, 0), (1, 0), (0, 1), (1, 1)."""
    normal = np.cross(corners[:, 3] - corners[:, 0], corners[:, 2] - corners[:, 1])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def face_tractions(cauchy: Floats, face: int, sample: float, normal: Floats) -> Floats:
    """sigma n at the middles of the four quarters of a face -x +x -y +y -z +z of cells (f, 4, 3) [Pa].

    cauchy (f, 8, 6) xx yy zz yz xz xy [Pa]; sample: local coordinate s; normal (f, 3)
    """
    axis, last = divmod(face, 2)
    points = np.empty((4, 3))
    points[:, axis] = 2 * last - 1
    points[:, [i for i in range(3) if i != axis]] = _QUARTERS
    weight = (0.5 * (1.0 + points[:, None] * _SIGNS / sample)).prod(axis=2)
    xx, yy, zz, yz, xz, xy = np.moveaxis(weight @ cauchy, -1, 0)
    x, y, z = (normal[:, i : i + 1] for i in range(3))
    return np.stack([xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z], axis=-1)


def traction_jump(near: Floats, far: Floats) -> Floats:
    """Eq. (1) (f,) [Pa] of the tractions (f, 4, 3) on the two sides of each face."""
    return np.asarray(np.sqrt(((near - far) ** 2).sum(axis=2).mean(axis=1)))
