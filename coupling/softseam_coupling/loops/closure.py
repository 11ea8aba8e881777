"""One linear solve over all rows: the multipliers that close the gaps, and what moves every part there.

Part p went to x_p under the force f_p. By its linear answer it goes on by

    dx_p = H_p e_p,   e_p = B_p^T lambda - f_p                                                                (1)

and the multipliers lambda are those for which all gaps close, sum_p B_p (x_p + dx_p) = offset. A part that was solved
with the impedance S of the parts beyond its interfaces does not tell H but Y = (H^-1 + S)^-1, its answer with them
behind it. In place of its multipliers the unknown is then the push q that moves it on in that surrounding,

    dx_p = Y q,   e_p = q - S Y q                                                                             (2)

which is well conditioned however freely the part would move alone. Where S is the inverse of what the parts beyond it
yield by, the system of the pushes is W = sum_p B_p H_p B_p^T over those parts alone; W's inverse preconditions GMRES,
which takes one iteration then, and few where S is older than W.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.loops.coupled_part import HARDLY, CoupledPart, gap_of

Floats = NDArray[np.float64]

_MOST = 30
"""iterations of GMRES"""
_REFINEMENTS, _SHRINKS = 6, 0.3
"""times that what is left of the gaps is closed by W's inverse, as long as that leaves no more than this share [1]"""


class Closure:
    """Solves for the multipliers. parts and offset as of `parts_of`."""

    def __init__(self, parts: dict[str, CoupledPart], offset: Floats) -> None:
        self._parts, self._offset = parts, offset
        self._inverse: Floats | None = None  # of W over the parts that are not pushed

    def told(self) -> None:
        """A part told another compliance, or is pushed from now on."""
        self._inverse = None

    def hold(self) -> Floats | None:
        """What of it evolves, to `go_back` to."""
        return self._inverse

    def go_back(self, held: Floats | None) -> None:
        """Be as `hold` found it."""
        self._inverse = held

    def taught(self, name: str, miss: Floats, force: Floats) -> None:
        """A part's nodes moved by a miss (n, 3) [m] beyond H_p times a change of force (n, 3) [N]: H_p takes it up.

        Broyden's update, of H_p and of W's inverse.
        """
        part, length = self._parts[name], float(np.vdot(force, force))
        part.compliance = part.compliance + np.outer(miss.reshape(-1), force.reshape(-1) / length)
        if self._inverse is not None:
            u, v = part.image(miss).reshape(-1), part.rows @ force if not part.sign else part.sign * force
            left, right = self._inverse @ u, v.reshape(-1) / length @ self._inverse
            below = 1.0 + float(v.reshape(-1) @ left) / length
            self._inverse = None if abs(below) < 1e-3 else self._inverse - np.outer(left / below, right)

    def impedance(self, name: str) -> Floats:
        """Of the parts beyond a part's interfaces, on its nodes, which are its rows; symmetric (3n, 3n) [N/m]."""
        self._inverse = self._invert([other for other_name, other in self._parts.items() if other_name != name])
        return self._inverse

    def _invert(self, parts: list[CoupledPart]) -> Floats:
        """Inverse of the symmetric part of what these parts yield by (3c, 3c) [N/m]."""
        w = np.asarray(sum(part.across() for part in parts))
        h = 0.5 * (w + w.T)
        h.flat[:: len(h) + 1] += HARDLY * np.trace(h) / len(h)
        inverse = np.linalg.inv(h)
        return np.asarray(0.5 * (inverse + inverse.T))

    def gap(self, x: dict[str, Floats]) -> Floats:
        """Of all rows, where the parts' nodes are at x (n, 3) [m] (c, 3) [m]."""
        return gap_of(self._parts, x, self._offset)

    def target(self, name: str, x: dict[str, Floats]) -> Floats:
        """Where a part's nodes belong by the places of all others (n, 3) [m]; its rows are the identity."""
        others = (other.image(x[other_name]) for other_name, other in self._parts.items() if other_name != name)
        return np.asarray(self._parts[name].sign * (self._offset - sum(others)))

    def solve(
        self, x: dict[str, Floats], acted: dict[str, Floats], told: Floats, tolerance: float
    ) -> tuple[Floats, dict[str, Floats], dict[str, Floats]]:
        """Multipliers (c, 3) [N], pushes and moves of the parts' nodes (n, 3) [N], [m], to a gap of `tolerance` [m].

        x      where the nodes went (n, 3) [m]
        acted  force that acted on them (n, 3) [N]
        told   multipliers from which the solve begins (c, 3) [N]
        """
        parts = self._parts
        pushed = [part for part in parts.values() if part.pushed]

        def answer(unknown: Floats, change: bool) -> tuple[Floats, Floats, dict[str, Floats], dict[str, Floats]]:
            """What is left of the gaps; the multipliers, pushes and moves. change: of a change of the unknown."""
            push, move = {}, {}
            multipliers = unknown if not pushed else unknown.copy()
            for name, part in parts.items():
                if part.pushed:
                    push[name] = part.sign * unknown
                    move[name] = part.move(push[name])
                    back = (part.impedance @ move[name].reshape(-1)).reshape(-1, 3)
                    multipliers = part.sign * (push[name] - back + (0.0 if change else acted[name]))
            for name, part in parts.items():
                if not part.pushed:
                    push[name] = part.force(multipliers) - (0.0 if change else acted[name])
                    move[name] = part.move(push[name])
            left = sum(part.image(move[name]) for name, part in parts.items())
            return np.asarray(left), multipliers, push, move

        if self._inverse is None:
            self._inverse = self._invert([part for part in parts.values() if not part.pushed])
        inverse = self._inverse
        unknown = np.zeros_like(told) if pushed else told
        rest: list[Any]
        left, *rest = answer(unknown, False)
        left = left + self.gap(x)
        for _ in range(_REFINEMENTS):
            size = _norm(left)
            if not size > tolerance:
                break
            step = -(inverse @ left.reshape(-1)).reshape(-1, 3)
            change, *more = answer(step, True)
            if not _norm(left + change) < _SHRINKS * size:  # the inverse is not near enough
                step = _gmres(lambda u: answer(u, True)[0], inverse, -left, tolerance)
                change, *more = answer(step, True)
            left = left + change
            rest = [_sum(one, other) for one, other in zip(rest, more, strict=True)]
        multipliers, push, move = rest
        return multipliers, push, move


def _norm(vectors: Floats) -> float:
    return math.sqrt(float(np.vdot(vectors, vectors)))


def _sum(one: Any, other: Any) -> Any:
    """Of vectors, or of vectors by name."""
    return {name: one[name] + other[name] for name in one} if isinstance(one, dict) else one + other


def _gmres(apply, inverse: Floats, wanted: Floats, tolerance: float) -> Floats:  # type: ignore[no-untyped-def]
    """u with apply(u) = wanted (c, 3) to `tolerance`, preconditioned from the right by `inverse` (Saad and Schultz)."""

    def preconditioned(v: Floats) -> Floats:
        return np.asarray((inverse @ v.reshape(-1)).reshape(-1, 3))

    size = float(np.linalg.norm(wanted))
    if not size > 0.0:
        return np.zeros_like(wanted)
    basis, images = [wanted / size], []
    h = np.zeros((_MOST + 1, _MOST))
    target = np.zeros(_MOST + 1)
    target[0] = size
    for k in range(_MOST):
        images.append(preconditioned(basis[k]))
        v = apply(images[k])
        for i in range(k + 1):
            h[i, k] = float(np.vdot(basis[i], v))
            v = v - h[i, k] * basis[i]
        h[k + 1, k] = float(np.linalg.norm(v))
        weights, *_ = np.linalg.lstsq(h[: k + 2, : k + 1], target[: k + 2], rcond=None)
        left = float(np.linalg.norm(h[: k + 2, : k + 1] @ weights - target[: k + 2]))
        if left <= tolerance or not h[k + 1, k] > 0.0 or not np.isfinite(left):
            break
        basis.append(v / h[k + 1, k])
    return np.asarray(sum(weight * image for weight, image in zip(weights, images, strict=True)))
