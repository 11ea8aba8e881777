"""The multipliers of all rows, predicted by what rows were before that have the same name.

A row's name is the number of its interface and its id there. Rows that were not there before begin with nothing.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interface import Interface
from softseam_coupling.prediction import Prediction

Floats = NDArray[np.float64]
Ids = NDArray[np.int64]

__all__ = ["Multipliers"]


class Multipliers(Prediction):
    """Of the rows of these interfaces. first (c, 3) [N]; None: nothing."""

    def __init__(self, interfaces: tuple[Interface, ...], first: Floats | None = None) -> None:
        self._names = _names_of(interfaces)
        super().__init__(len(self._names), np.zeros((len(self._names), 3)) if first is None else first)

    def renew(self, interfaces: tuple[Interface, ...]) -> None:
        """These are the rows of the step to come."""
        names = _names_of(interfaces)
        if not np.array_equal(names, self._names):
            self.follow(_places_among(names, self._names))
            self._names = names

    def to_arrays(self) -> dict[str, Floats]:
        return {**super().to_arrays(), "names": self._names.astype(np.float64)}

    def take(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `to_arrays`, whatever rows were there. Raises KeyError or ValueError where it is none."""
        names, kept = arrays["names"].astype(np.int64), arrays["kept"]
        if names.shape != (kept.shape[1], 2):
            raise ValueError(f"the saved multipliers are of {kept.shape[1]} rows, with {len(names)} names")
        self.follow(np.full(len(names), -1, dtype=np.int64))
        super().take(arrays)
        self._names = names


def _names_of(interfaces: tuple[Interface, ...]) -> Ids:
    """Of all rows: the number of the interface and the id there, or the row's number where it has none (c, 2)."""
    ids = [np.arange(one.n_rows, dtype=np.int64) if one.ids is None else one.ids for one in interfaces]
    numbers = np.repeat(np.arange(len(ids), dtype=np.int64), [len(each) for each in ids])
    return np.stack([numbers, np.concatenate(ids)], axis=1)


def _places_among(names: Ids, others: Ids) -> Ids:
    """Where each of the names (c, 2) is among others (d, 2); -1: nowhere (c,)."""
    if not len(others):
        return np.full(len(names), -1, dtype=np.int64)
    base = 1 + max(int(each[:, 1].max(initial=0)) for each in (names, others))
    keys, known = (each[:, 0] * base + each[:, 1] for each in (names, others))
    order = np.argsort(known)
    at = order[np.minimum(np.searchsorted(known, keys, sorter=order), len(known) - 1)]
    return np.asarray(np.where(known[at] == keys, at, -1))
