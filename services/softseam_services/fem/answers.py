"""How nodes of a region answer to forces on them, as the factor at hand has it."""

import numpy as np

from softseam_services.body.body import Floats, Ints

from .kernels.answers import descend_units
from .kernels.fronts import seam_root
from .model import FemModel
from .work import Work


def root_of_all(model: FemModel, work: Work) -> Floats:
    """R (3s, 3s) with d(seam_x)/d(seam_force) = R R^T [(m/N)^(1/2)]; the seam is eliminated last."""
    root = np.empty((3 * len(model.seam), 3 * len(model.seam)))
    seam_root(model.tree, work.values, work.seam_block, root, work.ints)
    return root


def root_of(model: FemModel, work: Work, asked: Ints) -> Floats:
    """The same (3a, r) of nodes at these places among the seam's (a,), which may be eliminated whenever."""
    places = model.order[model.seam[asked]]
    order = np.argsort(places)
    across = descend_units(model.tree, work.values, places[order], work.ints)
    filled = across[:, np.flatnonzero(across.any(axis=0))]
    root = np.empty((3 * len(asked), min(filled.shape)))
    root.reshape(len(asked), 3, -1)[order] = _shorter(filled).reshape(len(asked), 3, -1)
    return root


def _shorter(root: Floats) -> Floats:
    """R' (n, min(n, r)) with R' R'^T = R R^T, for R (n, r)."""
    if root.shape[0] >= root.shape[1]:
        return root
    return np.asarray(np.linalg.cholesky(root @ root.T))
