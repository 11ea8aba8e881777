"""FEM bodies that keep a dent: beside a point on the same way, in every element, with every joule found."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from relaxing import POISSON, YOUNG, Point

import softseam
from softseam.checks import doubts
from softseam_protocol.scene.kinds import ELEMENTS
from softseam_protocol.scene.scene import Scene

EDGE = 0.05
SLIDER = {"yield_stress": 2500.0, "share": 0.9, "hardening": 3000.0}
"""of a modulus of 26 kPa"""
RAMP, SQUEEZE = 0.2, 0.2


def material(**own: Any) -> dict[str, Any]:
    return {"young": YOUNG, "poisson": POISSON, "density": 10.0, "plasticity": SLIDER} | own


def plates(friction: float) -> dict[str, Any]:
    plate = {"kind": "box", "size": (0.01, 0.2, 0.2), "friction": friction}
    left, right = ({"position": (side * (0.5 * EDGE + 0.005), 0.0, 0.025)} for side in (-1.0, 1.0))
    return {"left": plate | left, "right": plate | right}


def scene(cell: float = EDGE, friction: float = 0.0, step: float = 0.01, regions: Any = None, **own: Any) -> Scene:
    """A cube squeezed by a fifth between plates, and let go."""
    body = {"shape": {"kind": "block", "size": [EDGE] * 3}, "cell": cell, "material": material(**own)}
    motion = [
        {"tools": ["left", "right"], "close": 0.5 * SQUEEZE * EDGE / RAMP, "until": {"compression": SQUEEZE}},
        {"tools": ["left", "right"], "open": 0.5 * SQUEEZE * EDGE / RAMP},
        {"hold": 0.2},
    ]
    data = {"softseam": 1, "name": "dented", "gravity": [0, 0, 0], "step": step, "body": body, "motion": motion}
    data |= {"tools": plates(friction), "quantities": ["grip_force"], "models": {"fem": {"tolerance": 1e-8}}}
    return Scene.model_validate(data | {"regions": regions or {"default": "fem"}})


def taken(sim: softseam.Session) -> list[softseam.Observation]:
    sim.reset(seed=0)
    seen = []
    while not sim.done:
        seen.append(sim.step())
    return seen


def squeezed(element: str, friction: float = 0.0, cell: float = EDGE, back: int = 30) -> tuple[FemRun, Any, Any]:
    """A cube on its way between plates, a fifth in 40 steps and so many back: its force [N] a step; and a point on the
    same way, its nominal stress [Pa] a step."""
    body = {"shape": {"kind": "block", "size": (EDGE,) * 3}, "cell": cell, "material": material()}
    of = {"fem": {"element": element, "tolerance": 1e-8}}
    models = Scene.model_validate(scene().model_dump() | {"models": of}).models
    run = FemRun(
        block(body=body, tools=plates(friction), gravity=(0, 0, 0), step=0.005).model_copy(update={"models": models})
    )
    point, forces, stresses, speed = Point((), plasticity=SLIDER), [], [], 0.5 * SQUEEZE * EDGE / RAMP
    for side in (1.0,) * 40 + (-1.0,) * back:
        reply = run.step({"left": (side * speed, 0.0, 0.0), "right": (-side * speed, 0.0, 0.0)}, dt=0.005)
        forces.append(float(abs(reply.wrench[0, 0])))
        if friction == 0.0:
            stresses.append(point.pull(float(np.ptp(run.x[:, 0])) / EDGE, 0.005))
    return run, forces, (point, stresses)


@pytest.mark.parametrize("element", [one for one in ELEMENTS if one not in ("hex8", "hex8_reduced")])
def test_every_element_does_what_the_point_does(element: str) -> None:
    """Squeezed by a fifth between slick plates and let go, on the way that they give it: the same plastic strain, to
    what plates yield by in the beginning, and a dent that stays."""
    run, forces, (point, stresses) = squeezed(element)
    slipped = run.committed.material[..., -1]
    np.testing.assert_allclose(slipped, point.slipped, rtol=2e-3)
    assert point.slipped > 0.09
    assert forces[39] == pytest.approx(max(forces), rel=1e-9)
    assert forces[-1] == 0.0
    assert abs(stresses[-1]) < 0.02 * max(map(abs, stresses))
    assert 0.90 < float(np.ptp(run.x[:, 0])) / EDGE < 0.91


def test_the_peak_is_that_of_the_bar() -> None:
    """Nominal stress of the point at the same stretch, .1 %."""
    run, forces, _ = squeezed("hex27", back=0)
    point = Point((), plasticity=SLIDER)
    for n in range(1, 41):
        stress = point.pull(1.0 - SQUEEZE * n / 40, 0.005)
    assert forces[39] == pytest.approx(-stress * EDGE**2, rel=3e-3)
    assert run.model.general is False


def test_a_bonded_cube_does_not_lock() -> None:
    """Cells of a half and a third: stress that yields has no volume to change, and yet the force hardly falls."""
    peaks = [max(squeezed("hex27", friction=50.0, cell=EDGE / n, back=0)[1]) for n in (1, 2, 3)]
    assert peaks[1] == pytest.approx(peaks[2], rel=0.03)
    assert peaks[0] == pytest.approx(peaks[2], rel=0.12)


def test_every_joule_is_found() -> None:
    """What the plates put in is stored, or was dissipated by the material, which takes as much whatever the step; the
    rest is implicit Euler's, and falls with the step."""
    left, taken_by_material = [], []
    for step in (0.01, 0.005, 0.0025):
        with softseam.open(scene(step=step)) as sim:
            seen = taken(sim)
        work, lost, slipped = (
            sum(one.energies[name] for one in seen[1:]) for name in ("tool_work", "dissipation", "material")
        )
        stored = [one.energies["strain"] + one.energies["kinetic"] for one in seen]
        assert work == pytest.approx(stored[-1] - stored[0] + slipped + lost, rel=1e-9)
        assert all(one.energies["material"] >= 0.0 for one in seen)
        assert not [event for one in seen for event in one.events if event.kind == "warning"]
        left.append(abs(lost / work))
        taken_by_material.append(slipped)
    assert left[0] < 0.15 and left[2] < 0.3 * left[0]
    assert taken_by_material[1] == pytest.approx(taken_by_material[2], rel=0.02)


def test_what_spins_does_not_yield() -> None:
    """Three turns a second."""
    body = {"shape": {"kind": "block", "size": (EDGE,) * 3}, "cell": EDGE, "material": material(), "spin": (0, 0, 20.0)}
    run = FemRun(block(body=body, gravity=(0.0, 0.0, 0.0), step=0.005))
    replies = run.run(1.0)
    assert replies[-1].kinetic == pytest.approx(replies[0].kinetic, rel=1e-3)
    assert run.committed.material[..., -1].max() == 0.0


def test_what_has_yielded_is_restored() -> None:
    """From a snapshot on every bit is the same."""
    with softseam.open(scene(cell=EDGE / 2, friction=0.8)) as sim:
        sim.reset(seed=0)
        for _ in range(20):
            sim.step()
        kept = sim.snapshot()
        after = [sim.step() for _ in range(10)]
        sim.restore(kept)
        for one, other in zip(after, [sim.step() for _ in range(10)], strict=True):
            np.testing.assert_array_equal(one.positions, other.positions)
            assert one.energies == other.energies


def test_a_layer_yields_in_a_body_that_does_not() -> None:
    """Two layers side by side: their forces add."""
    half = {"kind": "box", "position": [0, 0.025, 0.025], "size": [1, 0.05, 1]}
    body = {"shape": {"kind": "block", "size": (EDGE,) * 3}, "cell": EDGE / 2, "material": material(plasticity=None)}
    body |= {"inclusions": [{"shape": half, "material": {"plasticity": SLIDER}}]}
    run = FemRun(block(body=body, tools=plates(0.0), gravity=(0.0, 0.0, 0.0), step=0.01))
    parts, alone = (Point((), plasticity=SLIDER), Point([(1e-12, 1.0)])), [0.0, 0.0]
    for _ in range(20):
        reply = run.step({"left": (0.015, 0.0, 0.0), "right": (-0.015, 0.0, 0.0)}, dt=0.01)
        stretch = float(np.ptp(run.x[:, 0])) / EDGE
        alone = [-0.5 * EDGE**2 * part.pull(stretch, 0.01) for part in parts]
    assert alone[0] < 0.9 * alone[1]
    assert float(abs(reply.wrench[0, 0])) == pytest.approx(sum(alone), rel=0.01)


@pytest.mark.parametrize("element", ["hex8", "hex8_reduced"])
def test_elements_whose_bending_would_not_yield_are_refused(element: str) -> None:
    models = Scene.model_validate(scene().model_dump() | {"models": {"fem": {"element": element}}}).models
    with pytest.raises(softseam.SceneRefused, match=f"{element} .* does not yield: use hex27"):
        softseam.open(scene().model_copy(update={"models": models}))


@pytest.mark.parametrize(("stress", "words"), [(1e6, "elastic to strains of that order"), (2.0, "any touch leaves")])
def test_a_yield_stress_in_another_unit_is_doubted(stress: float, words: str) -> None:
    assert [text for text in doubts(scene(plasticity={"yield_stress": stress}), {}) if words in text]
    assert not [text for text in doubts(scene(), {}) if "plasticity" in text]
