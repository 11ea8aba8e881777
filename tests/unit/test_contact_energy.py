"""What yields to a tool is pressed by the slope of what it stores, and its work is that energy's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fem_run import FemRun, block
from scipy.spatial.transform import Rotation

import softseam
from softseam_protocol.scene.scene import Scene
from softseam_services.shapes.branches import BOX, CYLINDER
from softseam_services.tools.kernels import patch_energy, patch_press, press, press_energy

pytestmark = pytest.mark.kernels
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("sag", [0.0, 2e-4])
@pytest.mark.parametrize("inside", [1e-5, 3e-4, 2e-3])
def test_the_force_of_a_patch_is_the_slope_of_its_energy(inside: float, sag: float) -> None:
    """By central differences, whose error is of second order."""
    apart = 1e-6 * inside
    slope = (press_energy(inside + apart, sag) - press_energy(inside - apart, sag)) / (2.0 * apart)
    assert slope == pytest.approx(press(inside, sag)[0] if sag else inside, rel=1e-7)
    assert press_energy(-inside, sag) == press_energy(0.0, sag) == 0.0


@pytest.mark.parametrize(
    ("kind", "shape"), [(BOX, [0.01, 0.02, 0.01, 1e-3]), (CYLINDER, [0.008, 0.01, 1e-3, 0.0])], ids=["box", "cylinder"]
)
@pytest.mark.parametrize("sag", [0.0, 1e-4])
def test_a_patch_under_an_edge_is_pressed_by_the_slope_of_its_energy(kind: int, shape: list[float], sag: float) -> None:
    """As it goes along its force, at 20 places along an edge: eq. (2) against differences of the mean of its places."""
    u, v = np.array([4e-3, 0.0, 1e-3]), np.array([0.0, 3e-3, -5e-4])
    position, sizes = np.zeros(3), np.array(shape)
    for along in np.linspace(-3e-3, 3e-3, 20):
        at = np.array([shape[0] + along, 1e-3, (shape[2] if kind == BOX else shape[1]) - 8e-4])
        force, _, *normal = patch_press(kind, sizes, position, UPRIGHT, at, u, v, sag, 4)[:5]
        if force <= 0.0:
            continue
        apart, way = 1e-8, np.array(normal)
        ends = [patch_energy(kind, sizes, position, UPRIGHT, at + s * way, u, v, sag, 4) for s in (-apart, apart)]
        assert (ends[0] - ends[1]) / (2.0 * apart) == pytest.approx(force, rel=1e-5)


def test_what_a_turning_tool_puts_in_is_stored_and_given_back() -> None:
    """A box is turned into a block about an edge of its own by .2 rad, and back, without friction, in steps of statics:
    what its motion puts in is stored by patches and in the body, and not a thousandth is lost, nor made."""
    turn = Rotation.from_rotvec([0.2, 0.3, 0.1])
    below = float(np.abs(turn.as_matrix()[2]) @ np.array([0.02, 0.03, 0.02]) / 2.0)
    tool: dict[str, Any] = {"kind": "box", "size": (0.02, 0.03, 0.02), "rotation": turn.as_rotvec()}
    tool |= {"position": (0.002, 0.001, 0.02 + below + 1e-5), "friction": 0.0}
    material = {"kind": "neo_hookean", "young": 20e3, "poisson": 0.4, "density": 1000.0}
    body: dict[str, Any] = {"shape": {"kind": "block", "size": (0.04, 0.03, 0.02)}, "cell": 0.01, "material": material}
    body |= {"fixed": [{"min": (-1.0, -1.0, -1.0), "max": (1.0, 1.0, 1e-6)}]}
    spec = {"softseam": 1, "name": "turned", "gravity": (0.0, 0.0, 0.0), "step": 0.02, "duration": 10.0}
    spec |= {"body": body, "tools": {"box": tool}, "regions": {"default": "fem"}}
    spec |= {"models": {"fem": {"integrator": "static", "tolerance": 1e-7}}}
    strain, lost, put_in, to = [0.0], 0.0, 0.0, 0.0
    with softseam.open(Scene.model_validate(spec)) as sim:
        sim.reset()
        for _ in range(8):
            strain = [sim.step({"box": (0.0, 0.0, -0.01)}, fields=False).energies["strain"]]
        for sign in (1.0, -1.0):
            for _ in range(40):
                seen = sim.step({"box": (0.0, 0.0, 0.0, 0.0, 0.25 * sign, 0.0)}, fields=False).energies
                lost, to = lost + seen["contact_loss"], to + seen["drive_work"]
                put_in = max(put_in, to)
            strain.append(seen["strain"])
    assert strain[1] > 1.2 * strain[0]
    assert strain[2] == pytest.approx(strain[0], rel=1e-3)
    assert abs(lost) < 1e-3 * put_in


def test_what_is_stored_as_a_step_ends_is_what_the_next_begins_with() -> None:
    """A small box is pushed into a block, aside and off: with what contact stores found anew where each step begins,
    its work is the same to the last bit. So it is after a step that was taken back."""
    tool = {"kind": "box", "size": (0.012, 0.012, 0.01), "position": (0.003, 0.001, 0.0251), "friction": 0.5}
    clamped = {"fixed": [{"min": (-1.0, -1.0, -1.0), "max": (1.0, 1.0, 1e-6)}]}
    scene = block(size=(0.04, 0.03, 0.02), cell=0.01, body=clamped, tools={"box": tool}, step=0.01)
    kept, anew = FemRun(scene), FemRun(scene)
    ways = [(0.0, 0.0, -0.02)] * 10 + [(0.03, 0.0, 0.0)] * 5 + [(0.0, 0.0, 0.05)] * 8
    most = 0.0
    for number, way in enumerate(ways):
        anew.work.stored_x[:] = np.nan
        if number == 7:
            for run in (kept, anew):
                run.solver.advance(run.request({"box": (0.0, 0.02, -0.01)}))
                run.solver.discard()
        works = [run.step({"box": way}).tool_work for run in (kept, anew)]
        assert works[0] == works[1]
        most = max(most, float(kept.work.stored.sum()))
    assert most > 1e-6 and not kept.work.stored.any()
