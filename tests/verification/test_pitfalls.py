"""The textbook chapter's pitfalls (9.11): each control, a setting of softseam itself, fails beside one that holds.

Six are measured by the atlas, in runs of scenes. The other four are of what scenes cannot set wrong, and are taken from
the code below them: stress that is no derivative here, three where ELSEWHERE says.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam_protocol.scene.materials import MATERIALS, material_spec
from softseam_services.body.materials import build_material, point
from softseam_studies.atlas.pitfalls import PITFALLS

Floats = NDArray[np.float64]
MEASURED = [
    "Locking",
    "Negative Jacobian",
    "Stiffness follows iterations",
    "Mass of the deformed volume",
    "Linear strain in a large turn",
    "Energy drift",
]
ELSEWHERE = {
    "Hourglassing": "unit/test_fem_elements.py::test_a_reduced_hexahedron_without_hourglass_control_has_spurious_modes",
    "Order of constraints": "verification/test_particle_methods.py::"
    "test_the_order_in_which_constraints_are_listed_does_not_matter",
    "Courant's limit": "verification/test_pbd_leapfrog.py::test_it_is_stable_up_to_two_and_not_beyond",
}


def test_every_pitfall_has_its_test() -> None:
    assert {*MEASURED, *ELSEWHERE, "Stress that is no derivative"} == {*PITFALLS}
    for file, _, test in (place.partition("::") for place in ELSEWHERE.values()):
        assert f"def {test}(" in (Path(__file__).parents[1] / file).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", MEASURED)
def test_the_control_fails_and_the_remedy_holds(name: str) -> None:
    control, remedy, holds, _ = PITFALLS[name]()
    assert holds, f"{control}; {remedy}"


def work_of_a_cycle(kind: str, kernel: Callable[..., None]) -> float:
    """|Work| of a stress around a square of stretch and shear, relative to the largest work on the way [1].

    kernel  the stress that is integrated over dF: `point.stress`, which is P = dPsi/dF, or another one
    """
    ratio = {"ratio": 0.3} if kind == "mooney_rivlin" else {}
    law = build_material(material_spec({"kind": kind, "young": 2e4, "poisson": 0.4, "density": 1000, **ratio}))
    n, stress = 200, np.zeros((3, 3))
    work = most = 0.0
    for one, two in pairwise(np.array([(0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3), (0.0, 0.0)])):
        for i in range(n):
            ends = [one + (two - one) * t for t in (i / n, (i + 1) / n)]
            F = [np.array([[1.0 + a, s, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) for a, s in ends]
            kernel(law.number, law.parameters, 0.5 * (F[0] + F[1]), stress)
            work += float(np.sum(stress * (F[1] - F[0])))
            most = max(most, abs(work))
    return abs(work) / most


@pytest.mark.parametrize("kind", [kind for kind in MATERIALS if kind != "linear"])
def test_a_closed_cycle_costs_nothing_but_by_a_stress_that_is_no_derivative(kind: str) -> None:
    """The control is every law's own Cauchy stress, integrated over dF as if it were P; of linear both are one."""
    assert work_of_a_cycle(kind, point.stress) < 1e-5  # of the midpoint rule
    assert work_of_a_cycle(kind, point.cauchy) > 0.01
