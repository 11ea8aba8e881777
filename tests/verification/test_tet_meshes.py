"""Solids of tetrahedra in scenes, moved by XPBD alone, against closed forms of bars."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from particle_run import ParticleRun
from tet_bar import bar, bar_run, vtk

import softseam
from softseam_protocol.messages.outcomes import Detail
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import SceneError, parse_scene
from softseam_services.body.errors import MeshError
from softseam_services.server import build_setup

SCENES = Path(__file__).resolve().parents[2] / "scenes"
LENGTH = 0.2
SIZE = (LENGTH, 0.05, 0.05)


def lowest(run: ParticleRun) -> float:
    """How far the free end is from where it was, along the bar [m]."""
    rest = run.body.x_rest
    return float((run.x - rest)[rest[:, 0] > 0.5 * LENGTH - 1e-9, 0].mean())


def hanging(young: float, gravity: float) -> float:
    """Tip of a bar under its own weight: E (u' + 3/2 u'^2 + u'^3/2) = rho g (L - s), St. Venant and Kirchhoff's."""
    load = 1000.0 * gravity * (np.arange(1000) + 0.5) / 1000.0 * LENGTH / young
    slopes = [np.roots([0.5, 1.5, 1.0, -each]) for each in load]
    return float(np.mean([root[np.abs(root).argmin()].real for root in slopes])) * LENGTH


@pytest.mark.parametrize(("substeps", "sweeps", "error"), [("auto", 1, 0.012), ("auto", 2, 0.012), (40, 4, 4e-4)])
def test_a_bar_hangs_as_its_closed_form(substeps: int | str, sweeps: int, error: float) -> None:
    """Strains of 1 %: automatic substeps are within 1 %, many sweeps in short ones meet it."""
    pbd = {"substeps": substeps, "sweeps": sweeps}
    run = bar_run((8, 2, 2), SIZE, poisson=0.01, gravity=(0.981, 0.0, 0.0), damping=15.0, pbd=pbd)
    last = run.run(1.4)
    assert lowest(run) == pytest.approx(hanging(2e4, 0.981), rel=error)
    assert last.kinetic < 1e-11 and last.extras["stretch_violation"] < 2e-3
    stored = 0.5 * 0.981 * run.body.total_mass * lowest(run) * 2.0 / 3.0  # half the load's work
    assert last.strain == pytest.approx(stored, rel=0.03)


@pytest.mark.parametrize("pbd", [{}, {"sweeps": 2}, {"substeps": 40, "sweeps": 4}])
def test_a_neo_hookean_bar_hangs_as_its_closed_form_whatever_the_substeps(pbd: dict[str, int]) -> None:
    """Its law as it is, with free sides, summed along the bar: to 1e-3, with one sweep as with four."""
    run = bar_run((8, 2, 2), SIZE, poisson=0.01, gravity=(0.981, 0.0, 0.0), damping=15.0, pbd=pbd, law="neo_hookean")
    last = run.run(1.4)
    assert run.body.solid is not None
    elastic = run.body.solid.elastic
    assert lowest(run) == pytest.approx(_neo_hookean_hanging(elastic.mu, elastic.lambda_ + elastic.mu), rel=1e-3)
    assert last.kinetic < 1e-11 and last.extras["stretch_violation"] < 1e-4
    stored = 0.5 * 0.981 * run.body.total_mass * lowest(run) * 2.0 / 3.0  # half the load's work
    assert last.strain == pytest.approx(stored, rel=0.03)


def _neo_hookean_hanging(mu: float, bulk: float) -> float:
    """Tip of the bar: stretches a along and b across with p = bulk (a b^2 - 1) - mu, mu b + p a b = 0 and
    mu a + p b^2 = rho g (L - s)."""
    total, at = 0.0, np.ones(2)
    for s in (np.arange(400) + 0.5) / 400.0:
        load = 1000.0 * 0.981 * (1.0 - s) * LENGTH

        def off(values: np.ndarray, load: float = load) -> np.ndarray:
            a, b = values
            pressure = bulk * (a * b * b - 1.0) - mu
            return np.array([mu * a + pressure * b * b - load, mu * b + pressure * a * b])

        for _ in range(5):
            columns = [(off(at + step) - off(at - step)) / 2e-6 for step in 1e-6 * np.eye(2)]
            at = at - np.linalg.solve(np.array(columns).T, off(at))
        total += (at[0] - 1.0) * LENGTH / 400.0
    return float(total)


@pytest.mark.parametrize("poisson", [0.05, 0.3, 0.45])
def test_neo_hookean_pairs_stay_calm_and_put_themselves_right(poisson: float) -> None:
    """Kicked at random with automatic substeps no energy comes from nowhere; a body pressed flat, into a point,
    mirrored or with all corners thrown about finds its shape again."""
    keys: dict[str, Any] = {"clamped": False, "poisson": poisson, "law": "neo_hookean"}
    run = bar_run((4, 2, 2), (0.1, 0.05, 0.05), **keys)
    rng = np.random.default_rng(2)
    run.v[:] += 0.2 * rng.standard_normal(run.v.shape)
    energy = [reply.kinetic + reply.strain for reply in (run.step() for _ in range(60))]
    assert max(energy) <= energy[0] and energy[-1] < 0.25 * energy[0]
    for name in ("flat", "mirrored", "thrown about", "a point", "nearly a point"):
        run = bar_run((4, 2, 2), (0.1, 0.05, 0.05), damping=20.0, **keys)
        rest = run.body.x_rest
        moved = {
            "flat": rest * [1.0, 1.0, 0.0] + 1e-6 * rng.standard_normal(rest.shape),
            "a point": 0.0 * rest + [0.01, 0.02, 0.03],
            "nearly a point": 0.2 * rest,
            "mirrored": rest * [1.0, 1.0, -1.0],
            "thrown about": 0.03 * rng.standard_normal(rest.shape),
        }
        run.x[:] = moved[name]
        assert "96 tetrahedra are crushed" in run.step().alarms.get(Detail.INSIDE_OUT, "") or name != "a point"
        last = run.run(3.0)
        assert not last.alarms
        assert last.extras["worst_stretch"] < 1e-6, name


def test_strains_that_are_met_inside_out_are_told_of() -> None:
    run = bar_run((2, 1, 1), (0.1, 0.05, 0.05), clamped=False)
    run.x[:] = run.body.x_rest * [1.0, 1.0, -1.0]
    assert (
        "12 tetrahedra are crushed to nothing or inside out, and stay so: take law"
        in run.step().alarms[Detail.INSIDE_OUT]
    )


def test_no_tetrahedron_of_the_pudding_stays_squeezed() -> None:
    with softseam.open(SCENES / "pudding.yaml") as session:
        seen = session.reset()
        while not seen.done:
            seen = session.step()
    assert seen.quantities["worst_stretch"] < 0.06
    assert seen.quantities["stretch_violation"] < 1e-3


@pytest.mark.parametrize("law", ["st_venant_kirchhoff", "neo_hookean"])
def test_a_bar_swings_at_c_over_four_lengths(law: str) -> None:
    """Let go from the sine of its slowest mode, f = sqrt(E/rho)/(4 L); lumped masses of 8 cubes lack 0.2 %."""
    run = bar_run((8, 1, 1), SIZE, poisson=0.01, pbd={"substeps": 80, "sweeps": 4}, law=law)
    along = (run.body.x_rest[:, 0] + 0.5 * LENGTH) / LENGTH
    run.x[:, 0] += 1e-4 * np.sin(0.5 * np.pi * along)
    frequency = np.sqrt(2e4 / 1000.0) / (4.0 * LENGTH)
    q = []
    for _ in range(20):
        run.step()
        q.append(lowest(run))
    crossing = next(i for i in range(len(q)) if q[i] < 0.0)
    quarter = 0.01 * (crossing + q[crossing - 1] / (q[crossing - 1] - q[crossing]))
    assert quarter == pytest.approx(0.25 / frequency, rel=0.01)


@pytest.mark.parametrize("law", ["st_venant_kirchhoff", "neo_hookean"])
def test_a_free_solid_keeps_momentum_and_turns_freely(law: str) -> None:
    run = bar_run((3, 1, 1), SIZE, clamped=False, rotation=(0.1, 0.2, 0.3), velocity=(0.1, 0.0, -0.2), law=law)
    arm = run.body.x_rest - run.body.x_rest.mean(axis=0)
    run.v[:] += np.cross([0.0, 0.0, 2.0], arm)
    first, last = run.step(), run.run(0.3)
    np.testing.assert_allclose(last.momentum, first.momentum, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(last.angular_momentum, first.angular_momentum, rtol=0.02, atol=1e-6)
    assert last.extras["worst_stretch"] < 0.02


@pytest.mark.parametrize("law", ["st_venant_kirchhoff", "neo_hookean"])
def test_a_solid_comes_to_rest_on_the_ground(law: str) -> None:
    """Dropped by 2 mm with drag: it bears its weight, and no corner is under the ground."""
    ground = {"ground": {"kind": "plane", "point": (0.0, 0.0, -0.027), "friction": 0.5}}
    run = bar_run(
        (4, 2, 2), (0.1, 0.05, 0.05), clamped=False, gravity=(0, 0, -9.81), tools=ground, damping=20.0, law=law
    )
    last = run.run(1.5)
    assert last.wrench[0, 2] == pytest.approx(-9.81 * run.body.total_mass, rel=1e-3)
    assert run.x[:, 2].min() > -0.027 - 1e-6 and last.kinetic < 1e-9


@pytest.mark.parametrize("law", ["st_venant_kirchhoff", "neo_hookean"])
def test_the_order_of_a_file_does_not_matter(law: str) -> None:
    """Corners the other way round in all tetrahedra, or another order of tetrahedra: the same solid, bit by bit."""
    points, cells = bar((3, 1, 1), SIZE)
    scene = bar_run((3, 1, 1), SIZE, gravity=(1.0, 0.0, -1.0), law=law).scene
    found = []
    for given in (cells, cells[::-1], cells[:, [0, 2, 1, 3]]):
        run = ParticleRun(scene, {"bar.vtk": vtk(points, given)})
        run.run(0.1)
        found.append(run.x.copy())
    np.testing.assert_array_equal(found[1], found[0])
    np.testing.assert_allclose(found[2], found[0], atol=1e-12)


def test_a_snapshot_goes_on_with_the_same_bits() -> None:
    run = bar_run((3, 1, 1), SIZE, gravity=(0.0, 0.0, -3.0))
    run.run(0.05)
    taken = run.solver.snapshot()
    run.run(0.05)
    end = run.x.copy()
    run.solver.restore(taken)
    run.run(0.05)
    np.testing.assert_array_equal(run.x, end)


SCENE = """softseam: 1
name: a
duration: 1
body: {kind: tet_mesh, path: bar.vtk, density: 1000, young: 1.0e+4, poisson: 0.3}
"""


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("models: {pbd: {method: leapfrog}}\n", "leapfrog moves cells"),
        ("regions: {default: fem}\n", "only pbd can simulate it"),
        (
            "tools: {a: {kind: sphere, radius: 0.01, position: [0, 0, 1]}}\nmotion: [{tools: [a], grip: 0.1}]\n",
            "held by friction",
        ),
    ],
)
def test_what_a_solid_of_particles_cannot_do_is_refused_by_name(extra: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        parse_scene(SCENE + extra)


def test_files_without_tetrahedra_are_refused_by_name() -> None:
    points, cells = bar((1, 1, 1), SIZE)
    inverted = cells.copy()
    inverted[0] = inverted[0, [1, 0, 2, 3]]
    text = vtk(points, cells).decode()
    quads = text.replace("\n10", "\n9")
    files = {"inverted": vtk(points, inverted), "made of tetrahedra": quads.encode(), "is empty": b""}
    bundle = parse_scene(SCENE).model_dump_json()
    for words, data in files.items():
        with pytest.raises(MeshError, match=words):
            build_setup(Bundle(bundle, {"bar.vtk": data}))
