"""FEM bodies whose stress relaxes: beside integrals and closed forms, in every element, with every joule found."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import pytest
from fem_run import FemRun, block
from relaxing import CASES, POISSON, TWO, YOUNG, Point, said

import softseam
from softseam.checks import doubts
from softseam_protocol.scene.kinds import ELEMENTS
from softseam_protocol.scene.materials import MATERIALS, MaterialSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.materials import LAWS, Law
from softseam_services.body.materials.point import NEO_HOOKEAN

EDGE = 0.05
RAMP, SQUEEZE = 0.4, 0.25


def material(branches: tuple[tuple[float, float], ...] = TWO, **own: Any) -> dict[str, Any]:
    return {"young": YOUNG, "poisson": POISSON, "density": 10.0, "relaxation": said(branches)} | own


def plates(friction: float) -> dict[str, Any]:
    plate = {"kind": "box", "size": (0.01, 0.2, 0.2), "friction": friction}
    left, right = ({"position": (side * (0.5 * EDGE + 0.005), 0.0, 0.025)} for side in (-1.0, 1.0))
    return {"left": plate | left, "right": plate | right}


def cube(element: str = "hex27", friction: float = 0.0, step: float = 0.01, **own: Any) -> Scene:
    """Between plates that touch it, light and alone."""
    body = {"shape": {"kind": "block", "size": (EDGE,) * 3}, "cell": EDGE, "material": material(**own)}
    return block(body=body, tools=plates(friction), gravity=(0.0, 0.0, 0.0), step=step).model_copy(
        update={"models": Scene.model_validate(_models(element)).models}
    )


def _models(element: str) -> dict[str, Any]:
    tofu = {
        "shape": {"kind": "block", "size": (EDGE,) * 3},
        "cell": EDGE,
        "material": {"young": 1e4, "poisson": 0.4, "density": 1.0},
    }
    return {
        "softseam": 1,
        "name": "models",
        "duration": 1.0,
        "body": tofu,
        "models": {"fem": {"element": element, "tolerance": 1e-8}},
    }


def squeezed(run: FemRun, time: float, dt: float) -> tuple[list[Any], list[float]]:
    """Replies of steps of dt until this time, the ramp at first, and the stretch that the plates give the cube."""
    speed, replies, stretches = 0.5 * SQUEEZE * EDGE / RAMP, [], []
    closing = {"left": (speed, 0.0, 0.0), "right": (-speed, 0.0, 0.0)}
    for n in range(int(time / dt + 0.5)):
        replies.append(run.step(closing if (n + 0.5) * dt < RAMP else {}, dt=dt))
        stretches.append(float(np.ptp(run.x[:, 0])) / EDGE)
    return replies, stretches


def force(reply: Any) -> float:
    """With which a plate presses [N]."""
    return float(abs(reply.wrench[0, 0]))


def test_a_cube_between_plates_is_the_bar_of_the_differential_equation() -> None:
    """Squeezed by 25 % in .4 s and held until 5 s, in steps of 10 ms: .1 % of the integral while it is held, and of the
    point on the same way all along, once the plates' corners have settled (1.6 % in the first step)."""
    run, point = FemRun(cube()), Point(TWO)
    replies, stretches = squeezed(run, 5.0, 0.01)
    times, forces = 0.01 * (1 + np.arange(len(replies))), np.array([force(reply) for reply in replies])
    case = CASES["relaxation"]
    expected = -np.array(case["P"]) * EDGE**2
    found, held = np.interp(case["t"], times, forces), np.array(case["t"]) > RAMP
    np.testing.assert_allclose(found[held], expected[held], rtol=1e-3)
    np.testing.assert_allclose(found, expected, rtol=3e-3)  # the plates' penalty yields by 1e-4 of the edge
    alone = np.array([-point.pull(stretch, 0.01) * EDGE**2 for stretch in stretches])
    np.testing.assert_allclose(forces[10:], alone[10:], rtol=1.5e-3)
    np.testing.assert_allclose(forces[50:], alone[50:], rtol=1e-4)


@pytest.mark.parametrize("element", [one for one in ELEMENTS if one not in ("hex8", "hex8_reduced")])
def test_every_element_does_what_the_point_does(element: str) -> None:
    """On the way that the plates give the cube, once these are settled: .02 %, in steps as long as half a branch."""
    run, point = FemRun(cube(element)), Point(TWO)
    replies, stretches = squeezed(run, 0.8, 0.05)
    alone = [-point.pull(stretch, 0.05) * EDGE**2 for stretch in stretches]
    np.testing.assert_allclose([force(reply) for reply in replies[-3:]], alone[-3:], rtol=2e-4)


class Slow(MaterialSpec):
    kind: Literal["slow"] = "slow"


@pytest.fixture
def slow() -> Iterator[None]:
    """neo_hookean, but for its fast path."""
    MATERIALS.add("slow", Slow)
    LAWS.add("slow", Law(LAWS["neo_hookean"].parameters, inline=NEO_HOOKEAN))
    yield
    MATERIALS.remove("slow")
    LAWS.remove("slow")


@pytest.mark.usefixtures("slow")
def test_both_paths_of_the_default_element_are_one() -> None:
    """Bonded and bulged."""
    found = []
    others_own: tuple[dict[str, Any], ...] = ({}, {"kind": "slow"})
    for own in others_own:
        run = FemRun(cube(friction=50.0, **own))
        replies, _ = squeezed(run, 0.6, 0.02)
        found.append((run, replies))
    (one, some), (other, others) = found
    assert not one.model.general and other.model.general
    assert np.ptp(one.x[:, 2]) > 1.02 * EDGE
    np.testing.assert_allclose(one.x, other.x, atol=1e-6 * EDGE)
    np.testing.assert_allclose(one.committed.material, other.committed.material, atol=1e-5)
    for reply, same in zip(some, others, strict=True):
        np.testing.assert_allclose(reply.wrench, same.wrench, atol=1e-4 * force(reply))
        for name in ("strain", "tool_work"):
            assert getattr(reply, name) == pytest.approx(getattr(same, name), rel=1e-4)
        assert reply.extras["dissipated"] == pytest.approx(same.extras["dissipated"], rel=1e-4)


def test_a_cube_creeps_under_a_force_that_is_held() -> None:
    """As the point under what the plates press with, up to 1.6 % less than what they are to hold while it sinks."""
    body = {"shape": {"kind": "block", "size": [EDGE] * 3}, "cell": EDGE, "material": material(((0.6, 0.2),))}
    motion = [{"tools": ["left", "right"], "close": 0.02, "force": 1.0, "until": {"time": 0.3}}, {"hold": 2.0}]
    data = {"softseam": 1, "name": "creep", "gravity": [0, 0, 0], "step": 0.01, "body": body, "tools": plates(0.0)}
    data |= {"motion": motion, "regions": {"default": "fem"}, "quantities": ["grip_force"]}
    with softseam.open(Scene.model_validate(data | {"models": {"fem": {"tolerance": 1e-8}}})) as sim:
        seen = taken(sim)
    point = Point(((0.6, 0.2),))
    found = np.array([np.ptp(one.positions[:, 0]) / EDGE for one in seen])
    alone = np.array([point.carry(-one.quantities["grip_force"] / EDGE**2, 0.01) for one in seen])
    np.testing.assert_allclose(1.0 - found[20:], 1.0 - alone[20:], rtol=1e-4)
    assert 1.0 - found[-1] > 1.6 * (1.0 - found[20])


def test_a_bar_of_which_nothing_lasts_sinks_alike_on_coarse_cells() -> None:
    """Mozzarella held by one end for 5 s, 4 x 1 x 1 cells and 8 x 2 x 2: within 2 %; with nothing that steadies the
    coarse ones they fall apart, twenty times as far."""
    branches = ((0.45, 0.03), (0.075, 0.3), (0.155, 1.0), (0.013, 3.0), (0.072, 10.0), (0.235, 30.0))
    sunk = []
    for n in (1, 2):
        body = {"shape": {"kind": "block", "size": (0.08, 0.02, 0.02)}, "cell": 0.02 / n}
        body |= {"material": {"young": 6e5, "poisson": 0.45, "density": 1000.0, "relaxation": said(branches)}}
        body |= {"fixed": [{"min": (-1, -1, -1), "max": (-0.04 + 1e-6, 1, 1)}]}
        run = FemRun(block(body=body, gravity=(0.0, 0.0, -9.81), step=0.1))
        begun = run.x[:, 2].copy()
        run.run(5.0)
        sunk.append(float((begun - run.x[:, 2]).max()))
    assert sunk[0] == pytest.approx(sunk[1], rel=0.02)
    assert 7e-3 < sunk[1] < 0.012


def scene(step: float = 0.01, regions: dict[str, Any] | None = None, **own: Any) -> Scene:
    """The cube squeezed by 10 % between plates that stick, and held for half a second."""
    body = {"shape": {"kind": "block", "size": [EDGE] * 3}, "cell": EDGE / 2, "material": material(**own)}
    motion = [{"tools": ["left", "right"], "close": 0.05, "until": {"compression": 0.1}}, {"hold": 0.5}]
    data: dict[str, Any] = {"softseam": 1, "name": "held", "gravity": [0, 0, 0], "step": step, "body": body}
    data |= {
        "tools": plates(0.8),
        "motion": motion,
        "quantities": ["grip_force"],
        "models": {"fem": {"tolerance": 1e-8}},
    }
    return Scene.model_validate(data | {"regions": regions or {"default": "fem"}})


def taken(sim: softseam.Session) -> list[softseam.Observation]:
    sim.reset(seed=0)
    seen = []
    while not sim.done:
        seen.append(sim.step())
    return seen


def test_every_joule_is_found() -> None:
    """What the plates put in is stored or was dissipated by the material, more and more so with shorter steps; the rest
    is implicit Euler's, which takes half of what the force grows by in each step of the ramp, of five and ten, and next
    to nothing while the plates are still."""
    left = []
    for step in (0.01, 0.005):
        with softseam.open(scene(step)) as sim:
            seen = taken(sim)
        work, lost, faded = (
            sum(one.energies[name] for one in seen[1:]) for name in ("tool_work", "dissipation", "material")
        )
        stored = [one.energies["strain"] + one.energies["kinetic"] for one in seen]
        assert work == pytest.approx(stored[-1] - stored[0] + faded + lost, rel=1e-9)
        assert all(one.energies["material"] >= 0.0 for one in seen) and faded > 0.3 * work
        assert not [event for one in seen for event in one.events if event.kind == "warning"]
        left.append(lost / work)
        still = seen[3 + int(np.argmax([one.quantities["grip_force"] for one in seen])) :]
        assert sum(one.energies["material"] for one in still) > 0.25 * work
        assert abs(sum(one.energies["dissipation"] for one in still)) < 1e-4 * work
    assert 0.4 * left[0] < left[1] < 0.6 * left[0] < 0.1


def test_a_body_that_spins_relaxes_nothing() -> None:
    """Three turns a second, from rest on: what is lost is of the stretch that the spin brings, and no turn costs."""
    found = []
    for rate in (0.0, 20.0):
        body = {
            "shape": {"kind": "block", "size": (EDGE,) * 3},
            "cell": EDGE,
            "material": material(),
            "spin": (0, 0, rate),
        }
        run = FemRun(block(body=body, gravity=(0.0, 0.0, 0.0), step=0.005))
        found.append((run, run.run(1.0)))
    run, replies = found[1]
    energy = replies[0].kinetic
    assert replies[-1].kinetic == pytest.approx(energy, rel=1e-3)
    stretch = np.abs(run.committed.material).max()
    assert stretch < 20.0**2 * EDGE**2 * 10.0 / (2.0 * 9e3)  # of the order rho (omega a)^2 over the modulus
    assert sum(reply.extras["dissipated"] for reply in replies) < stretch * energy
    assert found[0][1][-1].extras["dissipated"] < 1e-25


def test_two_materials_of_one_body_relax_each_for_itself() -> None:
    """Two layers side by side, of which one is elastic: their forces add."""
    half = {"kind": "box", "position": [0, 0.025, 0.025], "size": [1, 0.05, 1]}
    body = {"shape": {"kind": "block", "size": (EDGE,) * 3}, "cell": EDGE / 2, "material": material(poisson=0.0)}
    body |= {"inclusions": [{"shape": half, "material": {"relaxation": []}}]}
    run = FemRun(block(body=body, tools=plates(0.0), gravity=(0.0, 0.0, 0.0), step=0.01))
    replies, stretches = squeezed(run, 0.8, 0.01)
    parts = Point(TWO, poisson=0.0), Point([(1e-12, 1.0)], poisson=0.0)
    alone = [0.0, 0.0]
    for stretch in stretches:
        alone = [-0.5 * EDGE**2 * part.pull(stretch, 0.01) for part in parts]
    assert alone[0] < 0.7 * alone[1]
    assert force(replies[-1]) == pytest.approx(sum(alone), rel=0.01)


LOWER = {"model": "fem", "boxes": [{"min": [-1, -1, -1], "max": [1, 1, EDGE / 2]}]}


def test_what_octants_remember_is_restored_and_goes_along() -> None:
    """From a snapshot on every bit is the same; of two parts that a seam joins as of one."""
    with softseam.open(scene()) as sim:
        whole = taken(sim)
    with softseam.open(scene(regions={"default": "fem", "near": LOWER})) as sim:
        seen = taken(sim)
        sim.reset(seed=0)
        for _ in range(10):
            sim.step()
        kept = sim.snapshot()
        after = [sim.step() for _ in range(10)]
        sim.restore(kept)
        for one, other in zip(after, [sim.step() for _ in range(10)], strict=True):
            np.testing.assert_array_equal(one.positions, other.positions)
            assert one.energies == other.energies
    for one, other in zip(seen, whole, strict=True):
        np.testing.assert_allclose(one.positions, other.positions, atol=5e-6)


def test_a_scene_that_names_no_model_gets_one_that_relaxes() -> None:
    nameless = scene().model_copy(update={"regions": Scene.model_validate(_models("hex27")).regions})
    with softseam.open(nameless) as sim:
        sim.reset(seed=0)
        assert {part.model for part in sim.step().parts.values()} == {"fem"}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"relaxation": [{"share": 0.7, "time": 1.0}, {"share": 0.4, "time": 2.0}]}, "are 1.1 of the shear modulus"),
        ({"relaxation": [{"share": 0.7, "time": 0.0}]}, "greater than 0"),
        ({"relaxation": said([(0.1, 1.0)] * 7)}, "at most 6"),
        ({"kind": "linear"}, "linear knows small strains only"),
        ({"retardation_time": 1e-3}, "two viscosities of one body"),
    ],
)
def test_bad_branches_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        scene(**changes)


@pytest.mark.parametrize("element", ["hex8", "hex8_reduced"])
def test_elements_whose_bending_would_not_relax_are_refused(element: str) -> None:
    with pytest.raises(softseam.SceneRefused, match=f"{element} .* does not relax: use hex27"):
        softseam.open(scene().model_copy(update={"models": Scene.model_validate(_models(element)).models}))


@pytest.mark.parametrize(
    ("branches", "words"),
    [
        (((0.06, 0.002),), "relaxation.0.time: 0.002 s, a share of 0.06 that fades within a step of 0.01 s"),
        (((0.2, 0.1), (0.2, 5e4)), "relaxation.1.time: 50000 s, but the motion lasts 0.5"),
    ],
)
def test_times_that_the_run_does_not_see_are_doubted(branches: tuple[tuple[float, float], ...], words: str) -> None:
    assert [text for text in doubts(scene(branches=branches), {}) if words in text]
    assert not [text for text in doubts(scene(), {}) if "relaxation" in text]
