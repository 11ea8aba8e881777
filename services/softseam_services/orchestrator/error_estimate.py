"""How far a run can be trusted: what its participants estimate of their errors, said as it ends, unasked.

The fields are looked at as the run ends, and before, at the end of a phase, where the body is well strained and has
four times the energy that it had when it was looked at last: a body that is let go tells nothing of how it was held.
The look at which it was strained most counts, so a run that ends with less than that is not looked at again. With the
energies eta_e of the errors of cells (`mesh_error`, `model_error`) and their strain energy U, over cells that the body
fills with one material, whose estimates hold, of PBD's only boxes,

    e = (sum eta_e / U)^(1/2),     a = sum c eta_e / U                                                            (1)

e is the relative error in the energy norm. The force with which a body resists, and how far it gives way under a load,
err by the square: the work of a load is twice the energy, and for Galerkin's method the energy's error is the error's
energy. How well that holds of an element and of its estimate is c, which was measured (docs/decisions/07).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.outcomes import TOO_FAR_OFF, shorter
from softseam_protocol.messages.participant import Fields
from softseam_protocol.messages.session import ErrorEstimate
from softseam_protocol.models import facts_of
from softseam_protocol.scene.kinds import IN_BLOCKS, IN_MESHES, ElementKind
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import AnyBody
from softseam_services.orchestrator.parts import Parts


class NoAdjoint(ArithmeticError):
    """There is a goal, but the body's stiffness as it stands has no factor that would tell what a force does to it."""


@dataclass(frozen=True, slots=True)
class GoalError:
    """The errors of a goal J [N] or [Pa], each by how much J ought to be larger, in its unit."""

    value: float
    """J > 0"""
    mesh: float
    """eq. (2), of FEM's cells; 0 of a probe"""
    model: float
    """eq. (1), of PBD's"""
    cells: NDArray[np.float64]
    """eq. (3) over J (C,) [1]; empty where nobody asked"""

    @property
    def relative(self) -> float:
        """Both over J [1]."""
        return (self.mesh + self.model) / self.value


Floats = NDArray[np.float64]

MESH: dict[ElementKind, float] = {
    "hex27": 0.6,
    "hex27_full": 1.4,
    "hex27_reduced": 0.35,
    "hex8": 0.65,
    "hex8_bbar": 0.8,
    "hex8_full": 1.5,
    "hex8_reduced": 1.5,
    "tet4": 2.0,
    "tet4_fbar": 1.6,
    "tet10": 1.5,
}
"""c of FEM's elements [1]"""
UNMEASURED = 2.0
"""the largest of these, for elements from outside"""
MODEL = 7.5
"""c of PBD over 1 - 2 nu [1]: its error is measured with full quadrature, to which volume changes are dear"""
MORE = 4.0
"""strain energy over that of the last look at which the end of a phase is looked at [1]"""
_LITTLE = 1e-3
"""of the largest strain energy at phases' ends, below which a look tells nothing, and of shear modulus times volume, a
strain of some 3 % [1]"""
_SLIGHT = 1e-14
"""and over shear modulus times volume: a strain of 1e-7, which rounding makes [1]"""
_ENOUGH = 0.5
"""least share of the strain energy in cells that can be judged [1]"""


class ErrorEstimator:
    """What the looks of a run found."""

    def __init__(self, body: AnyBody, scene: Scene) -> None:
        self._scene = scene
        self._body = body if body.has_cells else None
        self._element = scene.models.fem.element
        if self._body is not None:
            octants = self._body.octant_material
            volume = self._body.total_mass / self._body.mean_density
            stiffness = volume * min(material.mu for material in self._body.materials)
            self._least, self._well = _SLIGHT * stiffness, _LITTLE * stiffness
            self._whole = (self._body.fill > 0.999).all(axis=1) & (octants == octants[:, :1]).all(axis=1)
            self._model = model_shares(self._body)
        self.reset()

    def reset(self) -> None:
        """Nothing was looked at."""
        self._peak = 0.0
        self._found = np.zeros(0)
        """of the look that counts: time [s], strain energy [J], mesh error, model error, answer, judged [1]; the goal
        [N] or [Pa], 0 for none, and its error [1]"""

    def due(self, strain: float, run_ends: bool) -> bool:
        """Whether to look as a phase ends with this strain energy [J], or the run."""
        if self._body is None:
            return False
        self._peak = max(self._peak, strain)
        looked = self._found[1] if len(self._found) else 0.0
        if run_ends:
            return looked == 0.0 or strain > looked
        return strain > max(MORE * looked, self._well)

    def look(self, time: float, parts: Parts, fields: Mapping[str, Fields], goal: GoalError | None = None) -> None:
        """Take over what the parts found at a time [s]; the fields were asked for with their own indicators."""
        found = self._weigh(time, parts, fields, goal)
        if not len(self._found) or found[1] > self._found[1]:
            self._found = found

    def estimate(self) -> ErrorEstimate | None:
        """By the look that counts; None of a body of particles."""
        return self._in_words(self._found) if len(self._found) else None

    def now(
        self, time: float, parts: Parts, fields: Mapping[str, Fields], goal: GoalError | None = None
    ) -> ErrorEstimate:
        """By these fields alone, of a body of cells."""
        return self._in_words(self._weigh(time, parts, fields, goal))

    def _weigh(self, time: float, parts: Parts, fields: Mapping[str, Fields], goal: GoalError | None) -> Floats:
        """Eq. (1) and the goal's error, as in `_found`."""
        aim = [0.0, 0.0] if goal is None else [goal.value, goal.relative]
        return np.array([*self._of_energy(time, parts, fields), *aim])

    def _of_energy(self, time: float, parts: Parts, fields: Mapping[str, Fields]) -> list[float]:
        """Eq. (1)."""
        strain = whole = mesh = model = answer = 0.0
        assert self._body is not None
        for name, side in fields.items():
            cells = parts.cells[name]
            of_model = facts_of(parts.models[name]).errs_by == "model"
            told = side.model_error if of_model else side.mesh_error
            judged = self._whole[cells]
            if not len(told):  # a participant that does not estimate its errors
                told, judged = np.zeros(len(cells)), np.zeros_like(judged)
            if of_model and not (self._body.boxes and self._scene.models.pbd.coarse is None):
                judged = np.zeros_like(judged)
            strain += float(side.cell_energy.sum())
            whole += float(side.cell_energy[judged].sum())
            if of_model:
                model += float(told[judged].sum())
                answer += float((self._model[cells] * told)[judged].sum())
            else:
                energy = float(told[judged].sum())
                mesh += energy
                answer += MESH.get(self._element, UNMEASURED) * energy
        least = max(_LITTLE * self._peak, self._least)
        if not (np.isfinite([strain, mesh, model, answer]).all() and strain > least):
            return [time, 0.0, 0.0, 0.0, 0.0, 0.0]
        if not 0.0 < whole:
            return [time, strain, 0.0, 0.0, 0.0, 0.0]
        return [time, strain, (mesh / whole) ** 0.5, (model / whole) ** 0.5, answer / whole, whole / strain]

    def _in_words(self, found: Floats) -> ErrorEstimate:
        """With what the goal is off by."""
        said = self._without_goal(found)
        goal, (value, error) = self._scene.regions.goal, found[6:].tolist()
        if goal is None:
            return said
        if value == 0.0:
            return replace(said, goal=goal, text=f"{said.text}; {goal}: not known, none yet or no adjoint of it")
        ought = f"{_percent(abs(error))} {'more' if error > 0.0 else 'less'}"
        whose = "" if goal == "grip_force" else ".von_mises by fem on these cells"
        return replace(said, goal=goal, goal_error=error, text=f"{said.text}; {goal}{whose}: some {ought}")

    def _without_goal(self, found: Floats) -> ErrorEstimate:
        time, strain, mesh, model, answer, judged = found[:6].tolist()
        if strain == 0.0:
            text = "not known: the body is hardly strained, or its fields are not numbers"
            return ErrorEstimate(time, 0.0, 0.0, 0.0, 0.0, text, False)
        if self._body is not None and self._body.tetrahedra:
            text = "not known: it is not estimated on a file's tetrahedra; compare with a finer mesh"
            return ErrorEstimate(time, mesh, model, 0.0, judged, text, False)
        if judged < _ENOUGH:
            cells = "cells that one material fills"
            if self._body is not None and not self._body.boxes:
                cells += ", and for pbd are boxes of one size"
            elif self._scene.models.pbd.coarse is not None:
                cells += ", and for pbd are eight blocks (leave out models.pbd.coarse)"
            text = f"not known: only {_percent(judged)} of the strain energy is in {cells}; compare with shorter cells"
            return ErrorEstimate(time, mesh, model, 0.0, judged, text, False)
        parts = [f"{what} {_percent(error)}" for what, error in (("mesh", mesh), ("model", model)) if error > 0.0]
        text = f"{' and '.join(parts) or 'nothing'} in the energy norm of stress"
        too_large = answer > TOO_FAR_OFF
        if too_large:
            of_mesh = MESH.get(self._element, UNMEASURED) * mesh * mesh
            text += f": {self._coarse(answer) if of_mesh > 0.5 * answer else self._otherwise(answer)}"
        return ErrorEstimate(time, mesh, model, answer, judged, text, too_large)

    def _coarse(self, answer: float) -> str:
        other = "" if self._element in (IN_BLOCKS, IN_MESHES) else f"models.fem.element: {IN_BLOCKS}, or "
        return f"too coarse; try {other}{self._shorter(answer)}"

    def _otherwise(self, answer: float) -> str:
        return f"PBD is too far from finite elements; try regions: {{default: fem}}, or {self._shorter(answer)}"

    def _shorter(self, answer: float) -> str:
        """Cells that would do if e falls as their edges, as it does beside edges and clamps."""
        body, factor = self._body, shorter(answer)
        assert body is not None
        if not body.boxes:
            return f"cells {factor:.2g} times as long"
        edges = [float(f"{factor * edge:.2g}") for edge in body.edges.tolist()]
        return (
            f"body.cell: {edges[0]:g}" if len(set(edges)) == 1 else f"body.cell: [{', '.join(f'{e:g}' for e in edges)}]"
        )

    # ---- snapshots

    def to_array(self) -> Floats:
        """What evolves, for a snapshot."""
        return np.array([self._peak, *self._found])

    def take(self, saved: Floats) -> None:
        """Continue from `to_array`; an empty one begins anew. Raises ValueError where these are others."""
        if len(saved) not in (0, 1, 9):
            raise ValueError("it has no looks at the fields")
        self._peak = float(saved[0]) if len(saved) else 0.0
        self._found = saved[1:].copy()


def model_shares(body: Body) -> Floats:
    """c of PBD in each cell, by its first octant's material (C,) [1]."""
    squeeze = [material.mu / (material.lambda_ + material.mu) for material in body.materials]  # 1 - 2 nu
    return np.asarray(MODEL * np.asarray(squeeze)[body.octant_material[:, 0]])


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"
