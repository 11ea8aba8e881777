"""Blocks that remember, with their nodes held."""

from __future__ import annotations

import numpy as np
from pbd_run import PbdRun

from softseam_services.pbd.kernels.block import new_workspace
from softseam_services.pbd.kernels.block_rows import FOLD, LOST, N_STRESS
from softseam_services.pbd.kernels.lanes import LANES, aligned
from softseam_services.pbd.kernels.renew import renew
from softseam_services.pbd.kernels.sweep import batch_energies, block_forces, exact_stress, strain_energy


class Held:
    """Blocks of a run's body whose nodes are where they are put."""

    def __init__(self, run: PbdRun) -> None:
        model, self.numbers = run.solver.model, run.solver.parameters.blocks
        self.nodes, self.rest, self.ws = model.blocks.nodes, run.solver.parameters.arrays.x_rest, new_workspace()
        self.law, n = self.numbers.law, len(self.nodes)
        self.xw = aligned(len(self.rest) + 8, 4)
        self.xw[len(self.rest) :, :3] = self.numbers.padding_x
        self.memory = run.solver.committed.memory.copy()
        self.stress, self.figures, self.dissipated, self.n = np.zeros((n, N_STRESS)), np.zeros((n, 5)), 0.0, n

    def go(self, x: np.ndarray, dt: float, ahead: float | None = None, middle: float = 0.0) -> None:
        """To x (n, 3) in dt, and as long again if nothing else is said."""
        ahead = dt if ahead is None else ahead
        self.xw[: len(x), :3] = x
        constants = self.numbers.constants
        renew(self.ws, self.xw, self.nodes, constants, self.memory, dt, ahead, middle, 0, self.n)
        lost = constants.fold[:, LOST - FOLD]
        assert (lost >= 0.0).all()
        self.dissipated = float(np.vdot(self.numbers.volume, lost))

    @property
    def P(self) -> np.ndarray:
        """Of the first block, mean stress over its volume [Pa]."""
        volume, constants = self.numbers.volume, self.numbers.constants
        exact_stress(self.ws, self.xw, self.nodes, volume, self.stress, constants, self.law)
        mean: np.ndarray = self.stress[0, : 9 * LANES].reshape(3, 3, LANES)[..., 0] / volume[0, 0]
        return mean

    @property
    def stored(self) -> float:
        """[J]"""
        volume, constants = self.numbers.volume, self.numbers.constants
        batch_energies(self.ws, self.xw, self.nodes, volume, constants, self.law, 0, self.n, self.figures)
        return float(strain_energy(self.figures)[0])

    def force(self) -> np.ndarray:
        """Of all blocks on their nodes, by the shapes that they have (n, 3) [N]."""
        volume, constants, found = self.numbers.volume, self.numbers.constants, np.zeros((len(self.xw), 4))
        exact_stress(self.ws, self.xw, self.nodes, volume, self.stress, constants, self.law)
        block_forces(self.ws, self.nodes, self.stress, constants, found, 0, self.n)
        return found[: len(self.rest), :3]
