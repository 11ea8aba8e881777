"""What evolves at the seam from step to step, as arrays that a checkpoint keeps; `seam` says what it is for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.accelerations.memory import Memory
from softseam_coupling.kernels.extrapolate import FITTED, INERTIA, N_CLOSING, NAMES

Floats = NDArray[np.float64]


@dataclass(slots=True)
class SeamState:
    """Everything that evolves; n = 3 s unknowns."""

    inverse: Floats
    """approximate inverse of the compliance, with all corrections so far (n, n) [N/m]"""
    history: Floats
    """of the last steps, newest first: 4 multipliers that would have closed the gap, 6 misses of them (10, n) [N]"""
    tried: Floats
    """this step's last and best multiplier, each followed by its residual (4, n)"""
    closing: Floats
    """multiplier that would close the gap, as far as known in this step (n,) [N]"""
    scale: Floats
    """diagonal of the compliance (n,) [m/N]"""
    errors: Floats
    """mean square error of each way to predict (16,) [m^2]"""
    weights: Floats
    """of each way to predict, the last row as fitted so far (16, 10) [1]"""
    moments: Floats
    """of that fit (7, 8) [m^2]"""
    n_history: int = 0
    n_tried: int = 0
    """rounds of this step since the last reset"""
    rank: int = 0
    """independent constraints, at most n; 0 before the first reset"""
    spring: float = 0.0
    """compliance of the seam spring in this step [m/N]"""
    predictor: int = -1
    """row of the way of predicting last used, -1 for none"""
    memory: Memory = field(default_factory=lambda: Memory(np.zeros((0, 0)), np.zeros(0)))
    """of an acceleration, where the sides give no compliance (`accelerated`)"""
    _work: Floats = field(default_factory=lambda: np.zeros((4, 0)), repr=False)

    @property
    def n_nodes(self) -> int:
        return len(self.scale) // 3

    @property
    def multiplier(self) -> Floats:
        """The last committed multiplier, a copy; zero before the first (s, 3) [N]."""
        committed: Floats = self.history[0] + self.history[N_CLOSING]
        return committed.reshape(-1, 3)

    @property
    def predictor_name(self) -> str:
        if self.predictor < 0:
            return "zero"
        return "fitted" if self.predictor == FITTED else NAMES[self.predictor // len(INERTIA)]

    def to_arrays(self) -> dict[str, Floats]:
        """Copies for a checkpoint; `from_arrays` restores them bit for bit."""
        numbers = [self.n_history, self.n_tried, self.rank, self.spring, self.predictor]
        return {
            "inverse": self.inverse.copy(),
            "history": self.history.copy(),
            "tried": self.tried.copy(),
            "closing": self.closing.copy(),
            "scale": self.scale.copy(),
            "errors": self.errors.copy(),
            "weights": self.weights.copy(),
            "moments": self.moments.copy(),
            "numbers": np.array(numbers, dtype=np.float64),
            "memory_vectors": self.memory.vectors.copy(),
            "memory_numbers": self.memory.numbers.copy(),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Floats]) -> SeamState:
        n_history, n_tried, rank, spring, predictor = (float(number) for number in arrays["numbers"])
        n = arrays["inverse"].shape[0]
        return cls(
            inverse=np.array(arrays["inverse"], order="C"),
            history=np.array(arrays["history"], order="C"),
            tried=np.array(arrays["tried"], order="C"),
            closing=np.array(arrays["closing"], order="C"),
            scale=np.array(arrays["scale"], order="C"),
            errors=np.array(arrays["errors"], order="C"),
            weights=np.array(arrays["weights"], order="C"),
            moments=np.array(arrays["moments"], order="C"),
            n_history=int(n_history),
            n_tried=int(n_tried),
            rank=int(rank),
            spring=spring,
            predictor=int(predictor),
            memory=Memory(np.array(arrays["memory_vectors"], order="C"), np.array(arrays["memory_numbers"])),
            _work=np.zeros((4, n)),
        )
