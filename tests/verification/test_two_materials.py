"""Bodies of two materials against closed forms: springs in series and side by side, weights, oscillations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from element_statics import Statics, lattice
from numpy.typing import NDArray
from pbd_run import Energy, PbdRun, Vector, block_scene
from scipy.linalg import eigh
from scipy.optimize import brentq

import softseam
from softseam_protocol.scene.kinds import ELEMENTS as FACTS
from softseam_protocol.scene.kinds import ElementKind
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.body.region import build_region
from softseam_services.fem.kernels.elements import cauchy_stress
from softseam_services.fem.mesh_error import MeshError
from softseam_services.fem.structures import build_tables
from softseam_services.fem.work import build_work
from softseam_services.pbd.model_error import ModelError

Floats = NDArray[np.float64]

SIDE = 0.02
LENGTH = 0.04
SOFT, STIFF = 20e3, 500e3
ELEMENTS = tuple(FACTS)


def _end(low: float, young: float = STIFF, **other: Any) -> dict[str, Any]:
    """Everything beyond z = low [m] is of another material."""
    shape = {"kind": "box", "position": (0.0, 0.0, low + 1.0), "size": (1.0, 1.0, 2.0)}
    return {"inclusions": [{"shape": shape, "material": {"young": young, **other}}]}


def _side(low: float, young: float = STIFF) -> dict[str, Any]:
    """Everything beyond x = low [m] is of another material."""
    shape = {"kind": "box", "position": (low + 1.0, 0.0, 0.0), "size": (2.0, 1.0, 1.0)}
    return {"inclusions": [{"shape": shape, "material": {"young": young}}]}


def _moduli(young: float, poisson: float) -> tuple[float, float]:
    return young / (2.0 * (1.0 + poisson)), young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))


def _held_stress(young: float, poisson: float, stretch: float) -> float:
    """P_zz of the neo-Hookean law stretched along z with its sides held [Pa]."""
    mu, lam = _moduli(young, poisson)
    return mu * (stretch - 1.0 / stretch) + lam * math.log(stretch) / stretch


def _in_series(poisson: float, length: float, border: float) -> tuple[float, float, float]:
    """Stretches below and beyond the border, and their stress [Pa], where both together are squeezed by a tenth."""

    def beyond(below: float) -> float:
        return (0.9 * length - below * border) / (length - border)

    below = float(brentq(lambda s: _held_stress(SOFT, poisson, s) - _held_stress(STIFF, poisson, beyond(s)), 0.5, 1.0))
    return below, beyond(below), _held_stress(SOFT, poisson, below)


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("border", [0.01, 0.015])
def test_layers_in_series_are_exact(element: ElementKind, border: float) -> None:
    """Two layers squeezed with their sides held: stretches piecewise constant, one stress; the patch test of a border.

    A border through the middle of a cell, which octants resolve, is exact for the elements that are in octants; a kink
    inside a quadratic element is not, and is left out.
    """
    if border == 0.015 and element in ("hex27", "hex27_reduced", "hex27_full", "tet10"):
        return
    below, beyond, stress = _in_series(0.3, 0.03, border)
    case = Statics(
        lattice((SIDE, SIDE, 0.03), (2, 2, 3), poisson=0.3, young=SOFT, inclusions=_end(border)["inclusions"]), element
    )
    f = case.forces(_layered(case.x_rest, border, below, beyond))
    _in_balance(f, case.x_rest, 0.03, stress)


@pytest.mark.parametrize("element", ["hex27", "hex27_reduced", "hex8", "tet10"])
def test_cells_that_end_at_a_border_are_exact_where_others_are_not(element: ElementKind) -> None:
    """The same squeezed bar of two layers, in equilibrium, with the border at 13 of 30 mm. Where cells of 10 mm do not
    end at it, the bar is that of another border, at 15 mm; and quadratic cells hold a kink that they cannot follow."""
    below, beyond, stress = _in_series(0.3, 0.03, 0.013)
    errors = []
    for borders in ("materials", "even"):
        body = _end(0.013) | {"shape": {"kind": "block", "size": (SIDE, SIDE, 0.03), "borders": borders}}
        scene = block_scene((SIDE, SIDE, 0.03), 0.01, young=SOFT, poisson=0.3, body=body)
        case = Statics(build_body(scene, {}), element)
        held = np.ones((len(case.x_rest), 3), dtype=np.bool_)
        z = case.x_rest[:, 2]
        held[(z > 1e-9) & (z < 0.03 - 1e-9), 2] = False
        x = case.solve(case.x_rest * (1.0, 1.0, 0.9), held)
        force = case.forces(x)[z > 0.03 - 1e-9, 2].sum()
        errors.append(abs(force / (stress * SIDE**2) - 1.0))
        if borders == "materials":
            np.testing.assert_allclose(x, _layered(case.x_rest, 0.013, below, beyond), atol=1e-9)
    assert errors[0] < 1e-8 and errors[1] > 0.05, errors


def _layered(x_rest: Floats, border: float, below: float, beyond: float) -> Floats:
    x = x_rest.copy()
    x[:, 2] = np.where(x_rest[:, 2] < border, below * x_rest[:, 2], below * border + beyond * (x_rest[:, 2] - border))
    return x


def _in_balance(f: Floats, x_rest: Floats, length: float, stress: float) -> None:
    """Forces f (n, 3) along z vanish between the ends, where they are the stress times the section."""
    z = x_rest[:, 2]
    ends = (z < 1e-9) | (z > length - 1e-9)
    force = stress * SIDE**2
    assert np.abs(f[~ends, 2]).max() < 1e-9 * abs(force)
    assert f[z > length - 1e-9, 2].sum() == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize("border", [0.01, 0.015])
def test_blocks_in_series_are_exact(border: float) -> None:
    below, beyond, stress = _in_series(0.3, 0.03, border)
    scene = block_scene((SIDE, SIDE, 0.03), 0.01, young=SOFT, poisson=0.3, body=_end(border))
    run = PbdRun(scene)
    f = -Energy(run).force(_layered(run.body.x_rest, border, below, beyond))
    _in_balance(f, run.body.x_rest, 0.03, stress)


def test_error_indicators_see_no_error_where_there_is_none() -> None:
    """In that state, with all outer nodes held: a jump of stress at a border is no error of the cells or of PBD. Each
    is less than a millionth of the strain energy, and a thousandth of it or more if the border is not known."""
    below, beyond, _ = _in_series(0.3, 0.04, 0.02)
    outer = [_slab(axis, at) for axis, at in ((0, -0.02), (0, 0.02), (1, -0.02), (1, 0.02), (2, 0.0), (2, 0.04))]
    scene = block_scene((0.04, 0.04, 0.04), 0.01, young=SOFT, poisson=0.3, body=_end(0.02), fixed=outer)
    run = PbdRun(scene)
    x = _layered(run.body.x_rest, 0.02, below, beyond)
    energy = Energy(run).value(x)
    unknown = replace(run.body, octant_material=np.zeros_like(run.body.octant_material))
    for body, low, high in ((run.body, 0.0, 1e-6 * energy), (unknown, 1e-3 * energy, np.inf)):
        mesh = MeshError(body, run.region, "hex27")
        stress = np.empty((body.n_cells, 8, 6))
        region = build_region(body, np.arange(body.n_cells, dtype=np.int32), np.zeros(0, dtype=np.int32))
        model, parameters = build_tables(run.body, region)
        cauchy_stress(x, model, parameters, build_work(model, parameters, 0), stress)
        assert low <= mesh.measure(x, stress).sum() < high
        known = run.solver.model.blocks, run.solver.parameters.blocks
        found = ModelError(body, run.region, "physical", known).measure(x, np.zeros((len(run.region.points), 3)))
        assert low <= found.sum() < high


def _slab(axis: int, at: float) -> dict[str, Vector]:
    """A thin box around a plane."""
    low, high = [-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]
    low[axis], high[axis] = at - 1e-6, at + 1e-6
    return {"min": (low[0], low[1], low[2]), "max": (high[0], high[1], high[2])}


@pytest.mark.parametrize("element", [*ELEMENTS, "blocks"])
def test_layers_side_by_side_add_up(element: str) -> None:
    """Poisson's ratio 0, one stretch along the border: E_eff is the mean by area."""
    keys = _side(-0.5 * SIDE + 0.005)
    if element == "blocks":
        run = PbdRun(block_scene((SIDE, SIDE, 0.02), 0.005, young=SOFT, poisson=0.0, kind="linear", body=keys))
        x_rest, share = run.body.x_rest, 0.75
        f = -Energy(run).force(x_rest * np.array([1.0, 1.0, 1.01]))
    else:
        body = lattice(
            (SIDE, SIDE, 0.02), (4, 2, 2), poisson=0.0, young=SOFT, kind="linear", inclusions=_side(0.005)["inclusions"]
        )
        case = Statics(body, element)
        x_rest, share = case.x_rest, 0.75
        f = case.forces(x_rest * np.array([1.0, 1.0, 1.01]))
    _in_balance(f, x_rest, 0.02, 0.01 * ((1.0 - share) * SOFT + share * STIFF))


def test_mass_and_its_centre() -> None:
    """Two densities: their sum and centre are exact, on cells and through them, and no node is without mass."""
    for border in (0.02, 0.015):
        run = PbdRun(block_scene((SIDE, SIDE, LENGTH), 0.01, density=1000.0, body=_end(border, density=3000.0)))
        mass, x = run.region.mass, run.body.x_rest
        light, heavy = 1000.0 * border, 3000.0 * (LENGTH - border)
        assert mass.sum() == pytest.approx((light + heavy) * SIDE**2, rel=1e-12)
        centre = (light * 0.5 * border + heavy * 0.5 * (border + LENGTH)) / (light + heavy)
        np.testing.assert_allclose(mass @ x / mass.sum(), [0.0, 0.0, centre], atol=1e-12)
        assert mass.min() > 0.0


HEIGHT, BORDER = 0.08, 0.04
MODULI, DENSITIES = (20e3, 200e3), (1000.0, 2000.0)


def _hanging(model: str, border: float, near_from: float = 0.0) -> Scene:
    """A bar that hangs from its top, Poisson's ratio 0; stiffer and heavier above the border; near above near_from."""
    regions: dict[str, Any] = {"default": "pbd" if model == "hybrid" else model}
    if model == "hybrid":
        box = {"min": (-1.0, -1.0, near_from), "max": (1.0, 1.0, 1.0)}
        regions["near"] = {"model": "fem", "split": "always", "boxes": [box]}
    return block_scene(
        (SIDE, SIDE, HEIGHT),
        0.01,
        kind="linear",
        young=MODULI[0],
        poisson=0.0,
        density=DENSITIES[0],
        gravity=(0.0, 0.0, -9.81),
        step=0.02,
        fixed=({"min": (-1.0, -1.0, HEIGHT - 1e-6), "max": (1.0, 1.0, 1.0)},),
        body=_end(border, MODULI[1], density=DENSITIES[1]),
    ).model_copy(
        update={
            "regions": RegionsSpec.model_validate(regions),
            "probes": {"tip": (0.0, 0.0, 0.0), "border": (0.0, 0.0, border)},
            "duration": 10.0,
        }
    )


def _sag(border: float) -> tuple[float, float]:
    """How far tip and border come down: int N/(E A), N the weight below; exact for each layer's quadratic."""
    above = HEIGHT - border
    light, heavy = 9.81 * DENSITIES[0], 9.81 * DENSITIES[1]
    at_border = (light * border * above + 0.5 * heavy * above**2) / MODULI[1]
    return at_border + 0.5 * light * border**2 / MODULI[0], at_border


@pytest.mark.parametrize(
    ("model", "near_from", "tolerance"),
    [
        ("fem", 0.0, 1e-6),
        ("pbd", 0.0, 4e-3),
        ("hybrid", BORDER, 4e-3),  # the seam lies on the border
        ("hybrid", 0.06, 4e-3),  # in the stiff part
        ("hybrid", 0.02, 4e-3),  # in the soft part
    ],
)
def test_a_hanging_bar_of_two_layers_sags_as_it_should(model: str, near_from: float, tolerance: float) -> None:
    """FEM's quadratics are exact; PBD shares the weight of a cell out by Simpson's rule over linear blocks."""
    scene = _hanging(model, BORDER, near_from)
    with softseam.open(scene) as sim:
        sim.reset()
        for _ in range(200):
            obs = sim.step()
    tip, border = _sag(BORDER)
    assert obs.quantities["tip.displacement"] == pytest.approx(tip, rel=tolerance)
    assert obs.quantities["border.displacement"] == pytest.approx(border, rel=tolerance)


def test_a_border_inside_cells_is_off_by_what_a_quadratic_cannot_kink() -> None:
    """The border through the middle of cells: the tip's sag stays within half a per cent, in both models."""
    for model in ("fem", "pbd"):
        with softseam.open(_hanging(model, 0.045)) as sim:
            sim.reset()
            for _ in range(200):
                obs = sim.step()
        assert obs.quantities["tip.displacement"] == pytest.approx(_sag(0.045)[0], rel=5e-3)


def _tone(length: float, border: float) -> float:
    """Lowest angular frequency of lengthwise waves, clamped at 0, free at the end: Z1 cot(k1 l1) = Z2 tan(k2 l2)."""
    speeds = [math.sqrt(young / density) for young, density in zip(MODULI, DENSITIES, strict=True)]
    impedances = [math.sqrt(young * density) for young, density in zip(MODULI, DENSITIES, strict=True)]

    def missing(omega: float) -> float:
        near, far = omega * border / speeds[0], omega * (length - border) / speeds[1]
        return impedances[0] * math.cos(near) * math.cos(far) - impedances[1] * math.sin(near) * math.sin(far)

    return float(brentq(missing, 1e-3, math.pi / 2.0 / (border / speeds[0])))


def _lengthwise(forces: Callable[[Floats], Floats], x_rest: Floats, mass: Floats) -> float:
    """Lowest angular frequency where every cross-section moves as one along z, the first of them clamped."""
    height = np.round(x_rest[:, 2], 9)
    planes, number = np.unique(height, return_inverse=True)
    columns = []
    step = 1e-7
    for plane in range(1, len(planes)):
        shift = np.zeros_like(x_rest)
        shift[number == plane, 2] = step
        f = (forces(x_rest + shift) - forces(x_rest - shift)) / (2.0 * step)
        columns.append(np.bincount(number, weights=f[:, 2])[1:])
    values = eigh(np.array(columns), np.diag(np.bincount(number, weights=mass)[1:]), eigvals_only=True)
    return math.sqrt(values[0])


@pytest.mark.parametrize(("model", "tolerance"), [("fem", 1e-6), ("pbd", 2e-4)])
def test_a_bar_of_two_materials_rings_at_its_tone(model: str, tolerance: float) -> None:
    """Eight cells along the bar, clamped in the softer, lighter half."""
    body = _end(BORDER, MODULI[1], density=DENSITIES[1])
    scene = block_scene(
        (SIDE, SIDE, HEIGHT), 0.01, body=body, kind="linear", young=MODULI[0], poisson=0.0, density=DENSITIES[0]
    )
    run = PbdRun(scene)
    energy = Energy(run)
    forces = Statics(run.body, "hex27").forces if model == "fem" else lambda x: -energy.force(x)
    found = _lengthwise(forces, run.body.x_rest, run.region.mass)
    assert found == pytest.approx(_tone(HEIGHT, BORDER), rel=tolerance)


def test_pbd_in_motion_rings_at_that_tone() -> None:
    """Let go from its slowest mode, with the substeps that it chooses itself, counted over three periods."""
    body = _end(BORDER, MODULI[1], density=DENSITIES[1])
    scene = block_scene(
        (SIDE, SIDE, HEIGHT), 0.01, kind="linear", young=MODULI[0], poisson=0.0, density=DENSITIES[0], step=1e-3,
        fixed=({"min": (-1.0, -1.0, -1.0), "max": (1.0, 1.0, 1e-6)},), body=body, pbd={"substeps": 8},
    )  # fmt: skip
    at_rest = PbdRun(scene).body.x_rest
    x = at_rest + 1e-3 * np.sin(0.5 * np.pi * at_rest[:, 2:] / HEIGHT) * np.array([0.0, 0.0, HEIGHT])
    run = PbdRun(scene, x=x)
    tip = np.argmax(at_rest @ np.array([0.0, 0.0, 1.0]))
    omega = _tone(HEIGHT, BORDER)
    height = [x[tip, 2] - HEIGHT]
    for _ in range(round(3.2 * 2.0 * math.pi / omega / scene.step)):
        run.step()
        height.append(run.x[tip, 2] - HEIGHT)
    down = [
        i + height[i] / (height[i] - height[i + 1]) for i in range(len(height) - 1) if height[i] > 0 >= height[i + 1]
    ]
    assert 2.0 * math.pi / (np.diff(down).mean() * scene.step) == pytest.approx(omega, rel=0.02)


def _squeezed(cell: float, model: str, young: float, boxes: Sequence[Mapping[str, Vector]] = ()) -> float:
    """Force of frictionless plates [N] that squeeze a cube with a core a third as wide by a tenth, when it rests."""
    side = 0.045
    middle = (0.0, 0.0, 0.5 * side)
    core = {"shape": {"kind": "box", "position": middle, "size": (side / 3,) * 3}, "material": {"young": young}}
    plate = {"kind": "box", "size": (0.01, 0.1, 0.1), "friction": 0.0}
    away = 0.5 * side + 0.005
    scene = block_scene(
        (side, side, side),
        cell,
        young=SOFT,
        poisson=0.3,
        step=0.01,
        tools={
            "left": {**plate, "position": (-away, 0.0, 0.5 * side)},
            "right": {**plate, "position": (away, 0.0, 0.5 * side)},
        },
        body={"inclusions": [core]},
    ).model_dump()
    scene["motion"] = [{"tools": ["left", "right"], "close": side / 2, "until": {"compression": 0.1}}, {"hold": 0.2}]
    scene["quantities"] = ["grip_force"]
    scene["regions"] = {"default": "pbd" if boxes else model}
    scene["duration"] = None
    if boxes:
        scene["regions"]["near"] = {"model": model, "split": "always", "boxes": boxes}
    with softseam.open(Scene.model_validate(scene)) as sim:
        sim.reset()
        while not sim.done:
            obs = sim.step()
    return float(obs.quantities["grip_force"])


@pytest.mark.slow
def test_a_core_a_hundred_times_as_stiff_converges_in_both_models_and_across_a_seam() -> None:
    """The core's edges are singular, so cells of a third, sixth and ninth of the side come close slowly, from above,
    each step less than half the one before. On the same cells PBD, as it comes to rest, is 0.3 to 0.5 % stiffer, and
    so is a body with its seam around the core, or through the middle of one ten times as stiff. Without the core all
    have a tenth less."""
    coarse, fem, fine = (_squeezed(0.045 / n, "fem", 100.0 * SOFT) for n in (3, 6, 9))
    assert coarse > fem > fine
    assert coarse - fem > 2.0 * (fem - fine)
    assert fem == pytest.approx(fine, rel=3e-3)
    assert fem < _squeezed(0.0075, "pbd", 100.0 * SOFT) < 1.006 * fem
    around = [{"min": (-0.0076, -0.0076, 0.0149), "max": (0.0076, 0.0076, 0.0301)}]
    assert fem < _squeezed(0.0075, "fem", 100.0 * SOFT, around) < 1.006 * fem
    half = [{"min": (-1.0, -1.0, -1.0), "max": (0.0, 1.0, 1.0)}]
    ten = _squeezed(0.0075, "fem", 10.0 * SOFT)
    assert ten < _squeezed(0.0075, "fem", 10.0 * SOFT, half) < 1.006 * ten
    assert _squeezed(0.0075, "fem", 1.001 * SOFT) == pytest.approx(0.9016 * fem, rel=1e-3)
