"""One linear solve over all rows: the multipliers that close the gaps, and what moves every part there.

Part p went to x_p under the force f_p. By its linear answer it goes on by

    dx_p = H_p e_p,   e_p = B_p^T lambda - f_p                                                                (1)

and the multipliers lambda are those for which all gaps close, sum_p B_p (x_p + dx_p) + C lambda = offset, but for
rows that press (`unilateral`). A part that was solved with the impedance S of the parts beyond its interfaces does not
report H but Y = (H^-1 + S)^-1, its answer with them behind it. In place of its multipliers the unknown is then the push
q that moves it on in that surrounding,

    dx_p = Y q,   e_p = q - S Y q                                                                             (2)

which is well conditioned however freely the part would move alone. Where S is the inverse of the compliance of the
parts beyond it, the system of the pushes is W = sum_p B_p H_p B_p^T over those parts alone; W's inverse preconditions
GMRES, which takes one iteration then, and few where S is older than W.
"""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.kernels import close_gaps as kernel
from softseam_coupling.kernels.close_gaps import close_gaps, gap_at
from softseam_coupling.loops.coupled_part import HARDLY, CoupledPart
from softseam_coupling.loops.unilateral import Unilateral

Floats = NDArray[np.float64]


class Closure:
    """Solves for the multipliers. parts and offset (c, 3) are as of `parts_of`, compliance (c,), normal (c, 3) and
    friction (c,) as of `laws_of`."""

    def __init__(
        self, parts: dict[str, CoupledPart], offset: Floats, compliance: Floats, normal: Floats, friction: Floats
    ) -> None:
        self._parts, self._offset, self._compliance = parts, offset, compliance
        self._unilateral = Unilateral(normal, friction) if len(normal) else None
        self._inverse: Floats | None = None  # of W over the parts that are not pushed
        self._flat = _Flat(parts)

    @property
    def presses(self) -> bool:
        """Whether any row only presses: then no part can be solved with the others behind it."""
        return self._unilateral is not None

    def compliance_changed(self) -> None:
        """A part reported another compliance, or is pushed from now on."""
        self._inverse = None

    def renew(self, offset: Floats, compliance: Floats, normal: Floats, friction: Floats) -> None:
        """The rows of a step begin, with these; the parts may have other weights."""
        if len(offset) != len(self._offset):
            self._flat, changed = _Flat(self._parts), True
        else:
            changed = self._flat.renew(self._parts)
        if changed or not np.array_equal(compliance, self._compliance):
            self._inverse = None
        self._offset, self._compliance = offset, compliance
        self._unilateral = Unilateral(normal, friction) if len(normal) else None

    def save(self) -> Floats | None:
        """What of it evolves, for `restore`."""
        return self._inverse

    def restore(self, saved: Floats | None) -> None:
        """Be as `save` found it."""
        self._inverse = saved

    def update(self, name: str, miss: Floats, force: Floats) -> None:
        """A part's nodes moved by a miss (n, 3) [m] beyond H_p times a change of force (n, 3) [N].

        Broyden's update of H_p and of W's inverse.
        """
        part, length = self._parts[name], float(np.vdot(force, force))
        part.compliance = part.compliance + np.outer(miss.reshape(-1), force.reshape(-1) / length)
        if self._inverse is not None:
            u, v = part.to_rows(miss).reshape(-1), part.rows @ force if not part.sign else part.sign * force
            left, right = self._inverse @ u, v.reshape(-1) / length @ self._inverse
            below = 1.0 + float(v.reshape(-1) @ left) / length
            self._inverse = None if abs(below) < 1e-3 else self._inverse - np.outer(left / below, right)

    def impedance(self, name: str) -> Floats:
        """Of the parts beyond a part's interfaces, on its nodes, which are its rows (3n, 3n) [N/m]: symmetric, and
        positive definite."""
        self._inverse = self._invert([other for other_name, other in self._parts.items() if other_name != name])
        return self._inverse

    def _invert(self, parts: list[CoupledPart]) -> Floats:
        """Inverse of the symmetric part of these parts' compliance (3c, 3c) [N/m].

        XPBD whose sweeps are far from converged may report an indefinite one, as no passive body has. Eigenvalues then
        count by their absolute values (as in Dauphin et al. 2014, saddle-free Newton), none below HARDLY of the
        largest.
        """
        w = np.asarray(sum(part.row_compliance() for part in parts))
        h = 0.5 * (w + w.T)
        h.flat[:: len(h) + 1] += np.repeat(self._compliance, 3)
        h.flat[:: len(h) + 1] += HARDLY * np.trace(h) / len(h)
        try:
            np.linalg.cholesky(h)
        except np.linalg.LinAlgError:
            values, vectors = np.linalg.eigh(h)
            sizes = np.abs(values)
            return np.asarray((vectors / np.maximum(sizes, HARDLY * sizes.max())) @ vectors.T)
        inverse = np.linalg.inv(h)
        return np.asarray(0.5 * (inverse + inverse.T))

    def gap(self, x: dict[str, Floats]) -> Floats:
        """Of all rows, where the parts' nodes are at x (n, 3) [m] (c, 3) [m]."""
        flat, places = self._flat, np.concatenate([x[name] for name in self._parts])
        gap = gap_at(flat.table, flat.rows, places.reshape(-1), self._offset.reshape(-1))
        return np.asarray(gap.reshape(-1, 3))

    def left(self, gap: Floats, multipliers: Floats) -> Floats:
        """What is left of the gaps (c, 3) [m] beside the compliance of rows under these multipliers (c, 3) [N]."""
        left = gap + self._compliance[:, None] * multipliers
        return left if self._unilateral is None else self._unilateral.left(left, multipliers)

    def allowed(self, multipliers: Floats) -> Floats:
        """The multipliers (c, 3) [N] without what rows that press cannot do."""
        return multipliers if self._unilateral is None else self._unilateral.allowed(multipliers)

    def target(self, name: str, x: dict[str, Floats]) -> Floats:
        """Where a part's nodes belong by the places of all others (n, 3) [m]; its rows are the identity."""
        wanted = self._offset
        for other_name, other in self._parts.items():
            if other_name != name:
                wanted = wanted - other.to_rows(x[other_name])
        return np.asarray(self._parts[name].sign * wanted)

    def solve(
        self, gap: Floats, acted: dict[str, Floats], first: Floats, tolerance: float
    ) -> tuple[Floats, dict[str, Floats], dict[str, Floats]]:
        """Multipliers (c, 3) [N], pushes and moves of the parts' nodes (n, 3) [N], [m], to a gap of `tolerance` [m].

        gap    where the nodes went (c, 3) [m]
        acted  force that acted on them (n, 3) [N]
        first  multipliers from which the solve begins (c, 3) [N]
        """
        if not len(gap):
            pushes = {name: -force for name, force in acted.items()}
            return gap, pushes, {name: self._parts[name].move(push) for name, push in pushes.items()}
        if self._unilateral is not None:
            return self._press(self._unilateral, gap, acted, first)
        if self._inverse is None:
            self._inverse = self._invert([part for part in self._parts.values() if not part.pushed])
        flat = self._flat
        flat.copy(self._parts)
        forces = np.concatenate([acted[name] for name in self._parts])
        multipliers, push, move = close_gaps(
            *(flat.table, flat.rows, flat.compliances, flat.impedances, np.repeat(self._compliance, 3)),
            self._inverse.reshape(-1),
            *(gap.reshape(-1), first.reshape(-1), forces.reshape(-1), tolerance),
        )
        return multipliers.reshape(-1, 3), flat.by_part(push), flat.by_part(move)

    def _press(
        self, unilateral: Unilateral, gap: Floats, acted: dict[str, Floats], first: Floats
    ) -> tuple[Floats, dict[str, Floats], dict[str, Floats]]:
        """As `solve`, where some rows press."""
        w = np.diag(np.repeat(self._compliance, 3))
        free = gap
        for name, part in self._parts.items():
            part.add_row_compliance(w)
            free = free - part.to_rows(part.move(acted[name]))
        w.flat[:: len(w) + 1] += HARDLY * np.trace(w) / len(w)
        multipliers = unilateral.solve(w, free, first)
        pushes = {name: part.force(multipliers) - acted[name] for name, part in self._parts.items()}
        return multipliers, pushes, {name: part.move(pushes[name]) for name, part in self._parts.items()}


class _Flat:
    """All parts' matrices in the buffers that the kernel reads."""

    def __init__(self, parts: Mapping[str, CoupledPart]) -> None:
        n_nodes = [part.rows.shape[1] for part in parts.values()]
        squares = np.cumsum([0, *(9 * n * n for n in n_nodes)])
        shares = np.cumsum([0, *(part.rows.size for part in parts.values())])
        firsts = np.cumsum([0, *n_nodes])
        self.rows = np.concatenate([part.rows.ravel() for part in parts.values()])
        self.compliances, self.impedances = np.zeros(squares[-1]), np.zeros(squares[-1])
        self.table = np.zeros((len(parts), len(kernel.PARTS)), dtype=np.int64)
        self.table[:, kernel.FIRST], self.table[:, kernel.N_NODES] = firsts[:-1], n_nodes
        self.table[:, kernel.SIGN] = [int(part.sign) for part in parts.values()]
        self.table[:, kernel.ROWS_AT] = shares[:-1]
        self.table[:, kernel.COMPLIANCE_AT] = self.table[:, kernel.IMPEDANCE_AT] = squares[:-1]
        self._own = {name: slice(*ends) for name, ends in zip(parts, pairwise(firsts.tolist()), strict=True)}
        self._squares = squares.tolist()
        self._copied: list[Floats] = [np.zeros(0)] * (2 * len(parts))

    def renew(self, parts: Mapping[str, CoupledPart]) -> bool:
        """Take the parts' weights over; whether they are others. Their sizes stay."""
        self.table[:, kernel.SIGN] = [int(part.sign) for part in parts.values()]
        rows = np.concatenate([part.rows.ravel() for part in parts.values()])
        changed, self.rows = not np.array_equal(rows, self.rows), rows
        return changed

    def copy(self, parts: Mapping[str, CoupledPart]) -> None:
        """Copy what became another array since the last time; none is written in place."""
        for place, part in enumerate(parts.values()):
            at, compliance = self._squares[place], part.root if part.root.size else part.compliance
            if compliance is not self._copied[2 * place]:
                self._copied[2 * place] = compliance
                self.compliances[at : at + compliance.size] = compliance.ravel()
                self.table[place, kernel.RANK] = part.root.shape[1] if part.root.size else 0
            if part.impedance is not self._copied[2 * place + 1]:
                self._copied[2 * place + 1] = part.impedance
                self.impedances[at : at + part.impedance.size] = part.impedance.ravel()
            self.table[place, kernel.PUSHED] = part.pushed

    def by_part(self, vectors: Floats) -> dict[str, Floats]:
        """Of the nodes of all parts (3N,), each part's own (n, 3)."""
        nodes = vectors.reshape(-1, 3)
        return {name: nodes[own] for name, own in self._own.items()}
