"""A material law with state from outside: a standard linear solid, whose stress relaxes at a fixed strain.

P = P_e - q,  q' = (g P_e - q)/tau,  with Hooke's P_e; over a step q1 = k q0 + (1 - k) g P_e1, k = exp(-dt/tau)
(Simo and Hughes, Computational Inelasticity, 1998, ch. 10): the share g of the stress fades. It stores
W(e) - q : e + U(q)/g, U the energy of Hooke's law by stress, and dissipates what that loses while q0 becomes q1.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from fem_run import FemRun
from pydantic import Field

import softseam
from softseam_protocol.scene.materials import MATERIALS, MaterialSpec
from softseam_protocol.scene.regions import NearSpec
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Positive
from softseam_services.body.build import build_body
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.materials import LAWS, Law
from softseam_services.body.region import build_region
from softseam_services.orchestrator.parts import resting_state
from softseam_services.pbd.blocks import build_blocks, cell_layout, to_blocks, to_octants
from softseam_services.pbd.levels import build_levels


class Relaxing(MaterialSpec):
    kind: Literal["relaxing"] = "relaxing"
    fading: float = Field(gt=0.0, lt=1.0, description="share of the stress that fades [1]")
    time: Positive = Field(description="time in which it fades to 1/e [s]")


def respond(F, state, dt, parameters, P, A, following):  # type: ignore[no-untyped-def]
    mu, lam, g, tau = parameters[0], parameters[1], parameters[2], parameters[3]
    keep = np.exp(-dt / tau)
    trace = F[0, 0] + F[1, 1] + F[2, 2] - 3.0
    left, psi, stale = 1.0 - (1.0 - keep) * g, 0.0, 0.0
    bulk = 3.0 * lam + 2.0 * mu
    A[:] = 0.0
    for i in range(3):
        for j in range(3):
            unit = 1.0 if i == j else 0.0
            elastic = mu * (F[i, j] + F[j, i] - 2.0 * unit) + lam * trace * unit
            following[3 * i + j] = keep * state[3 * i + j] + (1.0 - keep) * g * elastic
            P[i, j] = elastic - following[3 * i + j]
            e = 0.5 * (F[i, j] + F[j, i]) - unit
            psi += 0.5 * elastic * e + following[3 * i + j] * (0.25 * following[3 * i + j] / (g * mu) - e)
            stale += 0.5 * elastic * e + state[3 * i + j] * (0.25 * state[3 * i + j] / (g * mu) - e)
            A[3 * i + j, 3 * i + j] += left * mu
            A[3 * i + j, 3 * j + i] += left * mu
            A[4 * i, 4 * j] += left * lam
    new, old = following[0] + following[4] + following[8], state[0] + state[4] + state[8]
    psi -= 0.25 * lam * new**2 / (g * mu * bulk)
    stale -= 0.25 * lam * old**2 / (g * mu * bulk)
    return psi, stale - psi


def parameters(spec: Relaxing, elastic: ElasticConstants) -> tuple[float, ...]:
    return elastic.mu, elastic.lambda_, spec.fading, spec.time


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    MATERIALS.add("relaxing", Relaxing)
    LAWS.add("relaxing", Law(parameters, small=True, state=9, respond=respond))
    yield
    MATERIALS.remove("relaxing")
    LAWS.remove("relaxing")


EDGE, YOUNG, FADING, TIME, STEP = 0.05, 20e3, 0.6, 0.1, 0.01
PLATE = {"kind": "box", "size": [0.01, 0.2, 0.2], "friction": 0.0}
SCENE: dict[str, Any] = {
    "softseam": 1,
    "name": "relaxing",
    "gravity": [0, 0, 0],
    "step": STEP,
    "body": {
        "shape": {"kind": "block", "size": [EDGE] * 3},
        "cell": EDGE / 2,
        "material": {
            "kind": "relaxing", "young": YOUNG, "poisson": 0.3, "density": 100, "fading": FADING, "time": TIME,
        },
    },
    "tools": {"left": PLATE | {"position": [-0.0301, 0, 0.025]}, "right": PLATE | {"position": [0.0301, 0, 0.025]}},
    "motion": [{"tools": ["left", "right"], "close": 0.05, "until": {"compression": 0.02}}, {"hold": 0.5}],
    "quantities": ["grip_force", "compression"],
    "regions": {"default": "fem"},
    "models": {"fem": {"tolerance": 1e-9}},
}  # fmt: skip


def variant(**changes: Any) -> Scene:
    return Scene.model_validate(json.loads(json.dumps(SCENE)) | changes)


def test_a_held_block_relaxes_as_its_closed_form() -> None:
    """Squeezed by 2 % between smooth plates and held: F = A E e ((1 - g) + g c exp(-t/tau)), step by step."""
    with softseam.open(variant()) as sim:
        sim.reset(seed=0)
        seen = []
        while not sim.done:
            seen.append(sim.step().quantities)
    force, strain = (np.array([q[name] for q in seen]) for name in ("grip_force", "compression"))
    faded, keep = 0.0, np.exp(-STEP / TIME)
    expected = []
    for e in np.maximum(strain, 0.0):
        faded = keep * faded + (1.0 - keep) * FADING * e
        expected.append(YOUNG * EDGE**2 * (e - faded))
    held = np.flatnonzero(strain == strain[-1])[3:]
    assert len(held) > 40
    np.testing.assert_allclose(force[held], np.array(expected)[held], rtol=5e-3)
    left = force[held] - YOUNG * EDGE**2 * (1.0 - FADING) * strain[-1]
    first = left[: len(held) // 2]
    slope = np.polyfit(STEP * np.arange(len(first)), np.log(first), 1)[0]
    assert slope == pytest.approx(-1.0 / TIME, rel=0.01)
    assert force[held[0]] > 1.3 * force[-1]


def test_what_the_material_dissipates_is_no_loss_of_the_integrator() -> None:
    """work = stored + dissipated by the material + by implicit Euler, which takes little; the run ends without a word
    of what was not done."""
    with softseam.open(variant()) as sim:
        seen = taken(sim)
    energies, events = [one.energies for one in seen], [event.kind for one in seen for event in one.events]
    work, material, lost = (sum(e[name] for e in energies[1:]) for name in ("tool_work", "material", "dissipation"))
    stored = [energy["strain"] + energy["kinetic"] for energy in energies]
    assert work == pytest.approx(stored[-1] - stored[0] + material + lost, rel=1e-6)  # the first step opens the ledger
    assert all(energy["material"] >= 0.0 for energy in energies) and material > 0.2 * stored[0]
    assert abs(lost) < 0.1 * material
    assert "lost" not in events


def taken(sim: softseam.Session) -> list[softseam.Observation]:
    sim.reset(seed=0)
    seen = []
    while not sim.done:
        seen.append(sim.step())
    return seen


@pytest.mark.parametrize("element", ["hex8_bbar", "tet4_fbar", "hex8_reduced", "hex27"])
def test_a_law_that_hardly_fades_is_the_elastic_one(element: str) -> None:
    """Nearly incompressible, between plates that stick, so that no two points are strained alike: as `linear`."""
    found = []
    for own in ({"kind": "relaxing", "fading": 1e-9, "time": TIME}, {"kind": "linear"}):
        body = SCENE["body"] | {"material": {"young": YOUNG, "poisson": 0.49, "density": 100} | own}
        tools = {name: tool | {"friction": 5.0} for name, tool in SCENE["tools"].items()}
        models = {"fem": {"element": element, "tolerance": 1e-9}}
        with softseam.open(variant(body=body, tools=tools, models=models, duration=0.1)) as sim:
            found.append(taken(sim)[-1])
    assert np.ptp(found[0].positions[:, 2]) > 1.001 * EDGE
    np.testing.assert_allclose(found[0].positions, found[1].positions, atol=1e-8)
    for name in ("strain", "tool_work"):
        assert found[0].energies[name] == pytest.approx(found[1].energies[name], rel=1e-4)


PBD = {"default": "pbd"}
FREE: dict[str, Any] = {"regions": PBD, "tools": {}, "motion": [], "quantities": [], "duration": 1.0}
IN_HALVES = {"model": "fem", "boxes": [{"min": [-1, -1, -1], "max": [1, 1, EDGE / 2]}]}
BESIDE_THE_ROD = {"model": "fem", "within": 0.03, "tools": ["rod"], "split": "always", "patience": 1}


def test_blocks_of_a_law_that_hardly_fades_are_the_elastic_ones() -> None:
    """XPBD, between plates that stick: forms and the general solve, as boxes and their own of `linear`."""
    found = []
    for own in ({"kind": "relaxing", "fading": 1e-9, "time": TIME}, {"kind": "linear"}):
        body = SCENE["body"] | {"material": {"young": YOUNG, "poisson": 0.3, "density": 100} | own}
        tools = {name: tool | {"friction": 5.0} for name, tool in SCENE["tools"].items()}
        with softseam.open(variant(body=body, tools=tools, regions=PBD, duration=0.3)) as sim:
            found.append(taken(sim)[-1])
    np.testing.assert_allclose(found[0].positions, found[1].positions, atol=2e-6)
    assert found[0].energies["strain"] == pytest.approx(found[1].energies["strain"], rel=1e-2)


def test_octants_and_blocks_hand_over_what_they_remember() -> None:
    """There and back: an octant's numbers, and the mean of a cell's that is one block."""
    body = build_body(variant(), {})
    region = build_region(body, np.arange(8, dtype=np.int32), np.zeros(0, dtype=np.int32))
    internal = np.random.default_rng(0).normal(size=(8, 8, 9))
    for coarse in (np.zeros(8, dtype=np.bool_), np.arange(8) < 3, np.ones(8, dtype=np.bool_)):
        levels = build_levels(region.cell_nodes, len(region.nodes), coarse)
        blocks = build_blocks(cell_layout(body, region), levels)
        memory = np.zeros((blocks.n_batches, 9, 4))
        to_blocks(blocks, coarse, internal, memory)
        back = to_octants(blocks, coarse, memory)
        np.testing.assert_array_equal(back[~coarse], internal[~coarse])
        np.testing.assert_allclose(back[coarse], internal[coarse].mean(axis=1, keepdims=True).repeat(8, axis=1))


@pytest.mark.parametrize(("near", "cuts"), [(IN_HALVES, 0), (BESIDE_THE_ROD, 2)])
def test_state_goes_along_where_a_body_is_cut(near: dict[str, Any], cuts: int) -> None:
    """Two parts of FEM, from the start or while a rod is near in mid-relaxation, do as the whole body, bit by bit again
    from a snapshot on. Where the plates stop the halves are 1 um apart from it, as those of a linear block are."""
    rod = {"kind": "box", "size": [0.2, 0.2, 0.02], "position": [0, 0, 0.2]}
    ways: list[Any] = [{"tools": ["rod"], "move": [0, 0, way], "speed": 2.0} for way in (-0.13, 0.13)]
    motion = [SCENE["motion"][0], {"hold": 0.05}, ways[0], {"hold": 0.05}, ways[1], {"hold": 0.1}]
    whole = variant(tools=SCENE["tools"] | {"rod": rod}, motion=motion)
    cut = whole.with_regions(whole.regions.model_copy(update={"near": NearSpec.model_validate(near)}))
    with softseam.open(whole) as sim:
        expected = taken(sim)
    with softseam.open(cut) as sim:
        seen = taken(sim)
        sim.reset(seed=0)
        for _ in range(15):
            sim.step()
        kept = sim.snapshot()
        after = [sim.step() for _ in range(10)]
        sim.restore(kept)
        for one, other in zip(after, [sim.step() for _ in range(10)], strict=True):
            np.testing.assert_array_equal(one.positions, other.positions)
            assert one.energies == other.energies
    assert sum(event.kind == "regions" for one in seen for event in one.events) >= cuts
    assert max(len(one.parts) for one in seen) == 2 and len(seen) == len(expected)
    for one, other in zip(seen, expected, strict=True):
        np.testing.assert_allclose(one.positions, other.positions, atol=2e-6)
        assert one.energies["material"] == pytest.approx(other.energies["material"], rel=2e-3)
        assert abs(one.energies["switch"]) < 1e-9


def test_state_of_another_law_is_refused() -> None:
    run = FemRun(variant())
    told = resting_state(run.body)
    with pytest.raises(ValueError, match="relaxing has 9 in an octant of 8"):
        FemRun(variant(), state=replace(told, internal=np.zeros((8, 8, 2))))


def test_state_is_part_of_a_snapshot() -> None:
    """What follows a restored snapshot follows to the last bit, and is not what follows a fresh body."""
    with softseam.open(variant()) as sim:
        sim.reset(seed=0)
        for _ in range(15):
            sim.step()
        kept = sim.snapshot()
        after = [sim.step() for _ in range(5)]
        sim.restore(kept)
        again = [sim.step() for _ in range(5)]
    for one, other in zip(after, again, strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
        assert one.quantities == other.quantities
        assert one.energies == other.energies


def test_a_step_that_is_taken_again_leaves_nothing() -> None:
    """A step that was first taken with plates that close faster, and then as it is meant: as if taken once."""
    once, twice = FemRun(variant()), FemRun(variant())
    push, shove = ({"left": (v, 0.0, 0.0), "right": (-v, 0.0, 0.0)} for v in (0.02, 0.05))
    for run in (once, twice):
        run.solver.advance(run.request(push))
        run.solver.commit()
        if run is twice:
            run.solver.advance(run.request(shove))
            run.solver.discard()
        run.solver.snapshot()  # drops the factor, which would differ in rounding
        run.solver.advance(run.request(push))
    assert np.abs(once.solver.state.material).max() > 1.0
    np.testing.assert_array_equal(once.solver.state.material, twice.solver.state.material)
    np.testing.assert_array_equal(once.x, twice.x)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"models": {"fem": {"integrator": "bdf2"}}}, "bdf2 does not know the state of relaxing"),
        ({"symmetry": ["y"]}, "images do not carry the state of relaxing"),
        ({"regions": {"default": "fem", "goal": "grip_force"}}, "a goal does not know the state of relaxing"),
        ({"regions": {"default": "pbd", "near": {"model": "fem", "error": 0.1}}}, "errs by is not known of relaxing"),
        (FREE | {"models": {"pbd": {"method": "leapfrog"}}}, "leapfrog does not know the state of relaxing"),
        (
            {"regions": PBD, "models": {"pbd": {"damping": {"stiffness": 1e-2}}}},
            "do not know the state",
        ),
    ],
)
def test_what_cannot_carry_state_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(softseam.SceneRefused, match=words):
        softseam.open(variant(**changes))


def test_a_law_says_what_it_is() -> None:
    for given in ({"state": 3}, {"respond": respond}, {"state": 9, "respond": respond, "inline": 1}):
        with pytest.raises(ValueError, match="a law"):
            Law(lambda spec, elastic: (), **given)
