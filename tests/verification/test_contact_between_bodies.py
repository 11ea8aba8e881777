"""Contact between two bodies: one carries what the other weighs, Coulomb's law holds, and no energy is made."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tet_bar

import softseam
from softseam.errors import SoftseamError
from softseam_protocol.messages.session import StepReport
from softseam_protocol.scene.scene import Scene

MODELS = pytest.mark.parametrize("model", ["fem", "pbd", "fem on pbd", "pbd on fem"])
EDGE, DENSITY = 0.04, 1000.0
MASS = DENSITY * EDGE**3
WEIGHT = 9.81 * MASS
SLOPE = np.radians(20.0)


def cube(edge: float = EDGE, young: float = 5e5, **keys: Any) -> dict[str, Any]:
    material = {"young": young, "poisson": 0.3, "density": DENSITY, "retardation_time": 0.01}
    return {"shape": {"kind": "block", "size": [edge] * 3}, "cell": edge / 2, "material": material} | keys


def scene(
    upper: dict[str, Any],
    lower: dict[str, Any] | None = None,
    friction: float = 0.5,
    tilt: float = 0.0,
    step: float = 0.005,
    model: str = "fem",
    **keys: Any,
) -> Scene:
    """One cube upon or above another, on the ground, which may be tilted [rad]: then gravity is. model: of both, or of
    one on another."""
    of_upper, _, of_lower = model.partition(" on ")
    own = {"regions": {"default": of_lower}} if of_lower else {}
    data = {
        "softseam": 1,
        "name": "touch",
        "gravity": [9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt)],
        "step": step,
        "duration": 0.3,
        "bodies": {"lower": (lower or cube()) | own, "upper": {"position": [0.0, 0.0, EDGE]} | upper},
        "tools": {"ground": {"kind": "plane", "friction": 1.5}},
        "interfaces": {"touch": {"kind": "contact", "between": ["upper", "lower"], "friction": friction}},
        "regions": {"default": of_upper},
    }
    return Scene.model_validate(json.loads(json.dumps(data | keys)))


class Run:
    """Reports of all steps, and where the middles of the bodies were after each (s, 3) [m]."""

    def __init__(self, of: Scene) -> None:
        self.reports: list[StepReport] = []
        middles: dict[str, list[Any]] = {name: [] for name in of.bodies}
        speeds = [np.linalg.norm(body.said("velocity", (0.0,))) for body in of.bodies.values()]
        self.start = 0.5 * MASS * float(np.square(speeds).sum())
        with softseam.open(of) as sim:
            sim.reset(seed=0)
            while not sim.done:
                seen = sim.step()
                self.reports.append(seen.report)
                for name, body in seen.bodies.items():
                    middles[name].append(body.positions.mean(axis=0))
        self.middle = {name: np.array(each) for name, each in middles.items()}
        self.touch = [report.interfaces["touch"] for report in self.reports]

    @property
    def apart(self) -> Any:
        """Way from the lower to the upper body's middle (s, 3) [m]."""
        return self.middle["upper"] - self.middle["lower"]

    @property
    def energy(self) -> Any:
        return np.array(
            [sum(report.energy[key] for key in ("kinetic", "strain", "gravity")) for report in self.reports]
        )


def makes_nothing(run: Run) -> bool:
    """Whether energy never rises above that of the start, nor what contact gives above what it has taken."""
    little = 1e-9 * np.abs(run.energy).max()
    given = np.cumsum([each.work for each in run.touch])
    return bool(run.energy.max() <= run.start + little and given.max() <= little)


@MODELS
@pytest.mark.parametrize("lift", [0.0, 0.002, 0.02])
def test_the_ground_carries_both(lift: float, model: str) -> None:
    """To 1e-9, once the upper one has come down; its middle is an edge above the other's, but for what weights squeeze
    (.04 mm), and no step took more than two exchanges."""
    run = Run(scene(cube(young=2e5, position=[0.0, 0.0, EDGE + lift]), cube(young=2e5), duration=0.5, model=model))
    assert run.reports[-1].wrench[0, 2] == pytest.approx(-2.0 * WEIGHT, rel=1e-9)
    np.testing.assert_allclose(run.apart[-1], (0.0, 0.0, EDGE), atol=1.2e-4)
    assert max(each.exchanges for each in run.touch) <= 2
    assert makes_nothing(run)


@MODELS
def test_friction_holds_on_a_slope_and_yields(model: str) -> None:
    """At 20 degrees mu = .5 holds: what moves in the last tenth of a second is less than 5 um; .2 lets the cube slide
    with g (sin - mu cos), in steps of implicit Euler x = a h^2 n (n + 1)/2, in XPBD's substeps nearly a t^2/2."""
    held = Run(scene(cube(position=[-0.004, 0.0, EDGE]), tilt=SLOPE, model=model))
    assert abs(held.apart[-1, 0] - held.apart[-20, 0]) < 5e-6
    assert held.apart[-1, 0] + 0.004 < 4e-4
    slid = Run(scene(cube(position=[-0.008, 0.0, EDGE]), friction=0.2, tilt=SLOPE, duration=0.15, model=model))
    a, n = 9.81 * (np.sin(SLOPE) - 0.2 * np.cos(SLOPE)), len(slid.apart)
    ended = n * (n + 1 if model.startswith("fem") else n)
    assert slid.apart[-1, 0] + 0.008 == pytest.approx(
        0.5 * a * 0.005**2 * ended, rel=0.012 if " on " in model else 0.01
    )


@MODELS
def test_friction_holds_up_to_its_angle(model: str) -> None:
    """At 20 degrees: with a coefficient whose angle is half a degree more the cube stays once it has come to rest, with
    half a degree less it goes."""
    more, less = (float(np.tan(SLOPE + np.radians(by))) for by in (0.5, -0.5))
    held = Run(scene(cube(position=[-0.004, 0.0, EDGE]), friction=more, tilt=SLOPE, model=model, duration=0.8))
    assert abs(held.apart[-1, 0] - held.apart[-20, 0]) < 5e-6
    slid = Run(scene(cube(position=[-0.004, 0.0, EDGE]), friction=less, tilt=SLOPE, model=model))
    way = 0.5 * 9.81 * (np.sin(SLOPE) - less * np.cos(SLOPE)) * 0.3**2
    assert slid.apart[-1, 0] + 0.004 > 0.8 * way


@MODELS
def test_a_cube_that_is_thrown_along_another_stops(model: str) -> None:
    """After v^2/(2 mu g), less v h/2 of FEM's implicit Euler; its friction took what it had, but for what the cubes
    damp."""
    upper = cube(position=[-0.008, 0.0, EDGE], velocity=[0.3, 0.0, 0.0])
    run = Run(scene(upper, friction=0.3, duration=0.2, model=model))
    way = 0.3**2 / (2.0 * 0.3 * 9.81) - (0.5 * 0.3 * 0.005 if model.startswith("fem") else 0.0)
    assert run.apart[-1, 0] + 0.008 == pytest.approx(way, rel=0.01)
    work = sum(each.work for each in run.touch)
    assert -0.5 * MASS * 0.3**2 < work < -0.9 * 0.5 * MASS * 0.3**2
    assert makes_nothing(run)


@MODELS
@pytest.mark.parametrize(
    ("velocity", "young"), [((0.0, 0.0, -2.0), 5e5), ((0.5, 0.3, -1.0), 5e5), ((0.0, 0.0, -1.0), 2e4)]
)
def test_a_knock_makes_no_energy(velocity: tuple[float, float, float], young: float, model: str) -> None:
    """And does not go through: at rest in the end, one upon the other, or beside it."""
    upper = cube(young=young, velocity=velocity, position=[-0.004, 0.0, EDGE + 0.002])
    run = Run(scene(upper, cube(young=young), duration=0.2, model=model))
    assert makes_nothing(run)
    assert run.apart[:, 2].min() > 0.6 * EDGE


@MODELS
def test_two_that_meet_in_flight_keep_their_momenta(model: str) -> None:
    """Beside one another, so that they turn: linear to 1e-8, angular to 1e-6 of what each brings."""
    upper = cube(position=[0.012, 0.007, EDGE + 0.003], velocity=[0.0, 0.0, -0.4])
    free: dict[str, Any] = {"gravity": [0.0, 0.0, 0.0], "tools": {}, "duration": 0.06, "model": model}
    run = Run(scene(upper, cube(velocity=[0.0, 0.0, 0.4]), **free))
    assert max(each.force for each in run.touch) > 0.1
    momenta = np.array([report.momentum for report in run.reports])
    assert np.abs(momenta - momenta[0]).max() < 1e-8 * MASS * 0.4
    spins = np.array([report.angular_momentum for report in run.reports])
    assert np.abs(spins - spins[0]).max() < 1e-6 * MASS * 0.4 * 0.014
    assert makes_nothing(run)


@MODELS
def test_two_that_pass_each_other_feel_nothing(model: str) -> None:
    """At 20 m/s, one above the other by more than the reach: no point is inside what it has passed, though it looks at
    its far side."""
    upper = cube(position=[-0.2, 0.003, EDGE + 0.006], velocity=[20.0, 0.0, 0.0])
    free: dict[str, Any] = {"gravity": [0.0, 0.0, 0.0], "tools": {}, "duration": 0.03, "model": model}
    run = Run(scene(upper, **free))
    assert max(each.force for each in run.touch) == 0.0
    assert run.apart[-1, 0] == pytest.approx(-0.2 + 20.0 * 0.03, abs=1e-9)


@MODELS
def test_two_halves_are_pressed_as_the_whole(model: str) -> None:
    """Between planes without friction: the same force within 1 %, for surfaces sink in by .8 % of what cells do."""

    def pressed(halves: bool) -> float:
        block = cube() | {"shape": {"kind": "block", "size": [EDGE, EDGE, EDGE / 2 if halves else EDGE]}}
        of_upper, _, of_lower = model.partition(" on ")
        own = {"regions": {"default": of_lower or of_upper}}
        upper = block | {"position": [0.0, 0.0, EDGE / 2], "regions": {"default": of_upper}}
        bodies = {"lower": block | own, "upper": upper} if halves else {"lower": block}
        press = {"kind": "plane", "point": [0.0, 0.0, EDGE], "normal": [0.0, 0.0, -1.0]}
        data: dict[str, Any] = {
            "softseam": 1,
            "name": "pressed",
            "gravity": [0.0, 0.0, 0.0],
            "step": 0.01,
            "bodies": bodies,
            "tools": {"ground": {"kind": "plane"}, "press": press},
            "motion": [{"tools": ["press"], "move": [0.0, 0.0, -0.002], "speed": 0.02}, {"hold": 0.3}],
            "regions": {"default": of_upper},
        }
        if halves:
            data["interfaces"] = {"touch": {"kind": "contact", "between": ["upper", "lower"]}}
        with softseam.open(Scene.model_validate(json.loads(json.dumps(data)))) as sim:
            return float(sim.run().report.wrench[1, 2])

    assert pressed(halves=True) == pytest.approx(pressed(halves=False), rel=1e-2)


@pytest.mark.parametrize("model", ["fem", "fem on pbd", "pbd on fem"])
@pytest.mark.parametrize("cells", [(1, 1), (1, 2), (2, 1), (1, 3)])
def test_an_even_pressure_stays_even_across_unlike_cells(cells: tuple[int, int], model: str) -> None:
    """Two halves without Poisson's effect between planes: stress in all octants is the mean to 2e-3, also beside the
    contact (with nodes for points 60 % off where one has half the other's cells)."""

    def half(count: int, at: float, own: str) -> dict[str, Any]:
        material = {"young": 2e5, "poisson": 0.0, "density": DENSITY, "retardation_time": 0.01}
        shape = {"kind": "block", "size": [EDGE, EDGE, EDGE / 2]}
        about = {"shape": shape, "cell": EDGE / 2 / count, "material": material, "position": [0.0, 0.0, at]}
        return about | {"regions": {"default": own}}

    of_upper, _, of_lower = model.partition(" on ")
    bodies = {"lower": half(cells[0], 0.0, of_lower or of_upper), "upper": half(cells[1], EDGE / 2, of_upper)}
    press = {"kind": "plane", "point": [0.0, 0.0, EDGE], "normal": [0.0, 0.0, -1.0]}
    motion = [{"tools": ["press"], "move": [0.0, 0.0, -0.002], "speed": 0.02}, {"hold": 0.1}]
    data = {"softseam": 1, "name": "pressed", "gravity": [0.0, 0.0, 0.0], "step": 0.01, "bodies": bodies}
    data |= {"tools": {"ground": {"kind": "plane"}, "press": press}, "motion": motion, "regions": {"default": of_upper}}
    data["interfaces"] = {"touch": {"kind": "contact", "between": ["upper", "lower"]}}
    with softseam.open(Scene.model_validate(json.loads(json.dumps(data)))) as sim:
        seen = sim.run(fields=True)
    stress = -float(seen.report.wrench[1, 2]) / EDGE**2
    for body in seen.bodies.values():
        np.testing.assert_allclose(body.cauchy[..., 2], stress, rtol=2e-3)


def test_a_guest_that_is_squeezed_between_a_pile_and_another_is_named() -> None:
    """What the pile's rounds do not settle yet fails, and says what to do."""
    bodies = {
        name: cube()
        | {"shape": {"kind": "block", "size": [EDGE, EDGE, EDGE / 2]}, "position": [0.0, 0.0, at * EDGE / 2]}
        for at, name in enumerate(("lowest", "middle", "upper"))
    }
    bodies["lowest"]["regions"] = {"default": "pbd"}
    press = {"kind": "plane", "point": [0.0, 0.0, 1.5 * EDGE], "normal": [0.0, 0.0, -1.0]}
    data = {"softseam": 1, "name": "squeezed", "gravity": [0.0, 0.0, 0.0], "step": 0.01, "bodies": bodies}
    data |= {"tools": {"ground": {"kind": "plane"}, "press": press}, "regions": {"default": "fem"}}
    data["motion"] = [{"tools": ["press"], "move": [0.0, 0.0, -0.003], "speed": 0.03}]
    data["contacts"] = {"friction": 0.5}
    with softseam.open(Scene.model_validate(json.loads(json.dumps(data)))) as sim:
        with pytest.raises(SoftseamError, match=r"middle.*upper.*do not agree.*shorten the step"):
            sim.run()


@MODELS
def test_a_restored_contact_goes_on_with_the_same_bits(model: str) -> None:
    """From before it touches, and from while it slides."""
    upper = cube(position=[-0.008, 0.0, EDGE + 0.001], velocity=[0.3, 0.0, 0.0])
    with softseam.open(scene(upper, friction=0.3, model=model)) as sim:
        sim.reset(seed=0)
        kept = [sim.snapshot()]
        first = [sim.step() for _ in range(12)]
        kept.append(sim.snapshot())
        first += [sim.step() for _ in range(6)]
        sim.restore(kept[0])
        again = [sim.step() for _ in range(12)]
        sim.restore(kept[1])
        again += [sim.step() for _ in range(6)]
    for one, other in zip(first, again, strict=True):
        for name in ("lower", "upper"):
            np.testing.assert_array_equal(one.bodies[name].positions, other.bodies[name].positions)


def test_what_contact_cannot_do_is_refused_by_name(tmp_path: Path) -> None:
    elastic = cube(material={"young": 5e5, "poisson": 0.3, "density": DENSITY})
    for keys in ({"residual": 0.01, "sweeps": 4}, {"method": "leapfrog"}):
        with pytest.raises(SoftseamError, match=r"interfaces\.touch.*leave out"):
            softseam.open(scene(elastic, elastic, model="pbd", models={"pbd": keys}, tools={}))
    points, tetrahedra = tet_bar.bar((2, 2, 2), (EDGE, EDGE, EDGE))
    (tmp_path / "bar.vtk").write_bytes(tet_bar.vtk(points, tetrahedra))
    bar = cube(shape={"kind": "mesh", "path": "bar.vtk", "cells": "tetrahedra"}, position=[0.0, 0.0, 2.0 * EDGE])
    del bar["cell"]
    mesh = json.loads(scene(bar).model_dump_json(exclude_unset=True))
    (tmp_path / "bar.yaml").write_text(json.dumps(mesh))
    with pytest.raises(SoftseamError, match=r"interfaces\.touch.*'upper'.*tetrahedra"):
        softseam.open(tmp_path / "bar.yaml")


@pytest.mark.parametrize("model", ["fem on pbd", "pbd on fem"])
@pytest.mark.parametrize("step", [0.005, 0.02])
@pytest.mark.parametrize(
    ("upper", "lower"),
    [
        ({"young": 2e6}, {"young": 2e4}),
        ({"young": 2e4}, {"young": 2e6}),
        ({"young": 2e6, "density": 1e4}, {"young": 1e5}),
    ],
)
def test_no_stiffness_or_weight_shakes_contact_of_two_models(
    upper: dict[str, float], lower: dict[str, float], step: float, model: str
) -> None:
    """A hundred times as stiff, ten times as heavy, either way round, after a fall over 2 mm, in steps of 5 and 20 ms:
    nothing is made; the force between them is the weight in the mean of the last .1 s, to 1e-3, and ripples by less
    than 1 % of it."""

    def one(keys: dict[str, float]) -> dict[str, Any]:
        made = cube()
        return made | {"material": made["material"] | keys}

    run = Run(
        scene(one(upper) | {"position": [0.0, 0.0, EDGE + 0.002]}, one(lower), step=step, duration=1.0, model=model)
    )
    assert makes_nothing(run)
    on_ground = np.array([report.wrench[0, 2] for report in run.reports[-round(0.1 / step) :]])
    weight = 9.81 * EDGE**3 * (upper.get("density", DENSITY) + DENSITY)
    assert on_ground.mean() == pytest.approx(-weight, rel=1e-3)
    assert np.ptp(on_ground) < 0.01 * weight
