"""An element from outside: linear hexahedra of one point, held by a twentieth of the stiffness that 2^3 points add.

Belytschko & Bindeman (Comput. Meth. Appl. Mech. Eng. 88, 1991) call such an element underintegrated; its sums of
gradients are exact, so that it passes the patch test whatever holds its hourglass modes.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import softseam
from softseam_protocol.scene import kinds
from softseam_protocol.scene.scene import Scene
from softseam_services.fem.elements import ELEMENTS, ElementTable
from softseam_services.fem.elements.hexahedra import linear
from softseam_services.fem.elements.table import split


def build(x, poisson: float) -> ElementTable:  # type: ignore[no-untyped-def]
    table = split(linear(2), linear(1), x)
    return table._replace(stabilisation=0.05 * table.stabilisation)


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    kinds.ELEMENTS.add("hex8_soft", kinds.ElementFacts("hex8"))
    ELEMENTS.add("hex8_soft", build)
    yield
    kinds.ELEMENTS.remove("hex8_soft")
    ELEMENTS.remove("hex8_soft")


EDGE, YOUNG = 0.05, 20e3
PLATE = {"kind": "box", "size": [0.01, 0.2, 0.2], "friction": 0.0}


def scene(element: str) -> Scene:
    """A cube between smooth plates, squeezed by a hundredth."""
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "element",
            "gravity": [0, 0, 0],
            "body": {
                "shape": {"kind": "block", "size": [EDGE] * 3},
                "cell": EDGE / 2,
                "material": {"kind": "linear", "young": YOUNG, "poisson": 0.3, "density": 1050},
            },
            "tools": {
                "left": PLATE | {"position": [-0.0301, 0, 0.025]},
                "right": PLATE | {"position": [0.0301, 0, 0.025]},
            },
            "motion": [{"tools": ["left", "right"], "close": 0.01, "until": {"compression": 0.01}}, {"hold": 0.5}],
            "regions": {"default": "fem"},
            "models": {"fem": {"element": element}},
            "quantities": ["grip_force", "compression"],
        }
    )


def test_an_element_from_outside_passes_a_patch_test() -> None:
    """Uniaxial stress of Hooke's law: F = E A e. The plates' penalty and the motion that is left take 2 %."""
    with softseam.open(scene("hex8_soft")) as sim:
        sim.reset(seed=0)
        while not sim.done:
            seen = sim.step()
    assert seen.grip_force == pytest.approx(YOUNG * EDGE**2 * seen.quantities["compression"], rel=0.02)


def test_an_element_without_a_builder_fails_at_start() -> None:
    kinds.ELEMENTS.add("forgotten", kinds.ElementFacts("hex8"))
    try:
        with pytest.raises(softseam.BadInput, match="table of builders of elements: no row 'forgotten'"):
            softseam.open(scene("hex27"))
    finally:
        kinds.ELEMENTS.remove("forgotten")
