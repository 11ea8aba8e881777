"""Every constraint on particles: gradients, momentum, rigid motion; tetrahedra against FEM."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from particle_run import G, ParticleRun, particle_scene
from tet_bar import vtk

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.fem.elements.tetrahedra import linear
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd.particles.batches import batches
from softseam_services.pbd.particles.kernels import bending, distance, neo_hookean, strain
from softseam_services.pbd.particles.parameters import build_tetrahedra
from softseam_services.pbd.particles.volume import VOLUME

Floats = NDArray[np.float64]
REST = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.9, 0.1], [0.1, -0.3, 0.8]])
X = REST + 0.15 * np.random.default_rng(1).normal(size=(4, 3))
WEIGHT = np.array([0.5, 1.0, 2.0, 0.8])
HINGE = np.array([1.3, -0.2, -0.7, -0.4])
HUGE = 1e7
"""compliance so large that a projection leaves the particles almost where they are: it shows gradient and value"""


def volume_of(x: Floats) -> float:
    return float(np.cross(x[1] - x[0], x[2] - x[0]) @ (x[3] - x[0]) / 6.0)


def gradient_of(x: Floats) -> Floats:
    """F."""
    return np.asarray((x[1:] - x[0]).T @ np.linalg.inv((REST[1:] - REST[0]).T))


def green(x: Floats) -> Floats:
    """E_00, E_11, E_22, 2 E_01, 2 E_02, 2 E_12, trace."""
    f = gradient_of(x)
    e = 0.5 * (f.T @ f - np.eye(3))
    return np.array([e[0, 0], e[1, 1], e[2, 2], 2 * e[0, 1], 2 * e[0, 2], 2 * e[1, 2], np.trace(e)])


VALUES: dict[str, Callable[[Floats], Floats]] = {
    "distance": lambda x: np.array([np.linalg.norm(x[1] - x[0]) - 0.7]),
    "bending": lambda x: HINGE @ x,
    "strain": green,
    "neo_hookean": lambda x: np.array([np.linalg.norm(gradient_of(x)), np.linalg.det(gradient_of(x)) - 1.4]),
}


def project(name: str, x: Floats, alpha: float, weight: Floats = WEIGHT) -> tuple[Floats, Floats]:
    """Positions and multipliers (c,) after one projection at compliance alpha/h^2."""
    made = batches(4, np.arange(4 if name != "distance" else 2, dtype=np.int32)[None])
    xw = np.zeros((12, 4))
    xw[:4, :3], xw[:4, 3] = x, weight
    n = len(VALUES[name](x))
    soft, one = made.lanes(np.full((1, n), alpha)), made.lanes(np.array([1.0]))
    lam = np.zeros((1, n, 8))
    tets = build_tetrahedra(REST, np.arange(4)[None].astype(np.int32))
    if name == "distance":
        inverse, soft1 = np.zeros((1, 8)), np.zeros((1, 8))
        distance.prepare_distances(xw, made.nodes, alpha * one, 1.0, 0.0, inverse, soft1)
        rest = made.lanes(np.array([0.7]), 1.0)
        distance.project_distances(np.zeros(distance.N_WORK), xw, made.nodes, rest, inverse, soft1, lam[:, 0])
    elif name == "bending":
        coefficient = made.lanes(HINGE[None])
        inverse, soft1 = np.zeros((1, 8)), np.zeros((1, 8))
        bending.prepare_bends(xw, made.nodes, coefficient, alpha * one, 1.0, 0.0, inverse, soft1)
        bending.project_bends(np.zeros(bending.N_WORK), xw, made.nodes, coefficient, inverse, soft1, lam)
    elif name == "strain":
        three = made.lanes(np.full((1, 3), alpha))
        strain.project_strains(xw, made.nodes, made.row, tets.inverse, three, 1.0, lam)
    else:
        gamma, ws = made.lanes(np.array([1.4])), np.zeros(neo_hookean.N_WORK)
        neo_hookean.project_pairs(ws, xw, made.nodes, tets.inverse, soft, gamma, lam)
    return xw[:4, :3].copy(), lam[0, :, 0].copy()


@pytest.mark.parametrize("name", VALUES)
@pytest.mark.parametrize("seed", range(3))
def test_gradients(name: str, seed: int) -> None:
    """The work of the step's forces in a small motion d is that of the multipliers: sum_c lambda_c dC_c/dx . d,
    differenced.

    At a huge compliance all constraints of a kind see the same x: lambda_c = -C_c/alpha, x_i moves by w_i sum lambda
    grad C.
    """
    after, lam = project(name, X, HUGE)
    force = (after - X) * HUGE / WEIGHT[:, None]
    value = VALUES[name]
    assert lam * HUGE == pytest.approx(-value(X), rel=1e-5)
    d = np.random.default_rng(10 + seed).normal(size=(4, 3))
    eps = 1e-6
    slope = (value(X + eps * d) - value(X - eps * d)) / (2.0 * eps)
    if name == "bending":
        assert (force * d).sum() == pytest.approx(-value(X) @ slope, rel=1e-5)
    assert (force * d).sum() == pytest.approx(float(lam * HUGE @ slope), rel=1e-5)


@pytest.mark.parametrize("name", VALUES)
def test_a_projection_keeps_momentum_and_turns_with_its_particles(name: str) -> None:
    """Linear and angular momentum of the correction vanish to rounding; a turned start ends turned."""
    after, _ = project(name, X, 0.3)
    moved = (after - X) / WEIGHT[:, None]
    assert np.abs(after - X).max() > 1e-3
    assert moved.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12) or name == "bending"
    if name not in ("bending", "strain", "neo_hookean"):  # several constraints in a row: each about where it finds x
        assert np.cross(X, moved).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    c, s = np.cos(0.8), np.sin(0.8)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    shift = np.zeros(3) if name == "bending" else np.array([1.0, 2.0, 3.0])
    turned, _ = project(name, X @ turn.T + shift, 0.3)
    assert turned == pytest.approx(after @ turn.T + shift, abs=1e-11)


@pytest.mark.parametrize("name", VALUES)
def test_held_particles_stay(name: str) -> None:
    weight = WEIGHT * np.array([0.0, 1.0, 1.0, 1.0])
    after, _ = project(name, X, 0.0, weight)
    assert np.array_equal(after[0], X[0])
    still, _ = project(name, X, 0.0, np.zeros(4))
    assert np.array_equal(still, X)


def test_the_gradient_of_a_volume_is_its_slope() -> None:
    gradient, other = np.zeros((4, 3)), np.zeros((4, 3))
    assert VOLUME.value(X, np.array([0.1]), gradient) == pytest.approx(volume_of(X) - 0.1, rel=1e-14)
    assert gradient.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-15)
    d = np.random.default_rng(3).normal(size=(4, 3))
    up, down = (VOLUME.value(X + sign * 1e-6 * d, np.array([0.1]), other) for sign in (1.0, -1.0))
    assert (gradient * d).sum() == pytest.approx((up - down) / 2e-6, rel=1e-8)


@pytest.mark.parametrize("bulk", [None, 5e4])
def test_a_volume_stiffens_a_tetrahedron_by_its_bulk_modulus(bulk: float | None) -> None:
    """Three corners are clamped, the fourth above their middle carries rho V/4: uniaxial strain u/h, so that
    u = rho g h^2/(4 (lambda + 2 mu + K)), for small strains: a tenth of the earth's gravity."""
    h, young, poisson, density, g = 0.05, 2e4, 0.3, 1000.0, 0.1 * G
    points = np.array([[-0.03, -0.02, 0.0], [0.03, -0.02, 0.0], [0.0, 0.04, 0.0], [0.0, 0.0, h]])
    body = {
        "kind": "tet_mesh",
        "path": "one.vtk",
        "density": density,
        "young": young,
        "poisson": poisson,
        "damping": 30.0,
        "fixed": [{"min": (-1.0, -1.0, -1.0), "max": (1.0, 1.0, 0.0)}],
        "constraints": [] if bulk is None else [{"kind": "volume", "bulk": bulk}],
    }
    scene = particle_scene(body, gravity=(0.0, 0.0, -g), pbd={"substeps": 20, "sweeps": 20})
    run = ParticleRun(scene, {"one.vtk": vtk(points, np.arange(4)[None])})
    apex = int(run.body.x_rest[:, 2].argmax())
    run.run(1.0)
    wave = ElasticConstants.from_young_poisson(young, poisson).p_wave + (bulk or 0.0)
    sunk = float(run.body.x_rest[apex, 2] - run.x[apex, 2])
    assert sunk == pytest.approx(density * g * h**2 / (4.0 * wave), rel=2e-3)


BLOCK: dict[str, Any] = {
    "softseam": 1,
    "name": "block",
    "duration": 0.1,
    "step": 0.1,
    "gravity": (0.0, 0.0, -9.81),
    "body": {
        "shape": {"kind": "block", "size": (0.1, 0.1, 0.1)},
        "cell": 0.05,
        "material": {"kind": "neo_hookean", "young": 2e4, "poisson": 0.3, "density": 1000.0},
        "fixed": [{"min": (-1.0, -1.0, 0.1), "max": (1.0, 1.0, 1.0)}],
    },
    "regions": {"default": "fem"},
    "models": {"fem": {"element": "tet4", "integrator": "static", "tolerance": 1e-7}},
}


def hung(body: Body, name: str, h: float, sweeps: int, at_once: bool = True) -> float:
    """How far tetrahedra sag in a second, nearly at rest then [m]; at_once: pairs begin with the stress there is."""
    tets = build_tetrahedra(body.x_rest, body.cell_nodes[:, linear().nodes].reshape(-1, 4))
    mass = np.zeros(body.n_nodes)
    np.add.at(mass, body.cell_nodes, body.cell_mass)
    n, elastic, nodes = body.n_nodes, body.material.elastic, tets.batches.nodes
    xw, v = np.zeros((n + 8, 4)), np.zeros((n, 3))
    xw[:n, :3], xw[:n, 3] = body.x_rest, np.where(body.fixed, 0.0, 1.0 / mass)
    free, ws, pull = xw[:n, 3] > 0.0, np.zeros(neo_hookean.N_WORK), np.zeros((n + 8, 4))
    compliance, gamma = tets.pair(elastic)
    soft = compliance / h**2
    strains = tets.strains(elastic) / h**2
    lam = np.zeros((len(nodes), 7 if name == "strain" else 2, 8))
    for _ in range(round(1.0 / h)):
        before = xw[:n, :3].copy()
        v[free, 2] -= h * 9.81
        xw[:n, :3] += h * v
        lam[:] = 0.0
        if name != "strain" and at_once:
            neo_hookean.begin_pairs(ws, xw, nodes, tets.inverse, soft, gamma, lam, pull)
        for _ in range(sweeps):
            if name == "strain":
                strain.project_strains(xw, nodes, tets.batches.row, tets.inverse, strains, 1.0, lam)
            else:
                neo_hookean.project_pairs(ws, xw, nodes, tets.inverse, soft, gamma, lam)
        v = (xw[:n, :3] - before) / h / (1.0 + 20.0 * h)
    low = np.isclose(body.x_rest[:, 2], 0.0)
    return float((body.x_rest - xw[:n, :3])[low, 2].mean())


def hung_by_fem(kind: str) -> tuple[Body, float]:
    """The block, and how far FEM's linear tetrahedra sag [m]."""
    scene = Scene.model_validate(
        {**BLOCK, "body": {**BLOCK["body"], "material": {**BLOCK["body"]["material"], "kind": kind}}}
    )
    simulation = Simulation(Bundle(scene.model_dump_json(), {}), EmbeddedTransport())
    simulation.step(fields=False)
    body, x = simulation.body, simulation.frame().x
    simulation.close()
    assert isinstance(body, Body)
    return body, float((body.x_rest - x)[np.isclose(body.x_rest[:, 2], 0.0), 2].mean())


def test_tetrahedra_of_strain_hang_as_those_of_fem() -> None:
    """384 tetrahedra under their weight, the same mesh and St. Venant-Kirchhoff in both: 2.1 mm, alike to 0.6 %."""
    body, wanted = hung_by_fem("st_venant_kirchhoff")
    assert wanted == pytest.approx(2.1e-3, rel=0.05)
    assert hung(body, "strain", 1e-3, 2) == pytest.approx(wanted, rel=0.006)


def test_neo_hookean_pairs_hang_as_fem_does_if_they_begin_with_their_stress() -> None:
    """FEM's law differs from the pair's by 1 % here. Within that with one sweep in 1 ms as in 0.25 ms.

    The control: multipliers that begin at zero. XPBD takes each gradient where it finds the particles, and both
    multipliers of a tetrahedron are large and opposite at rest, so the fixed point of many sweeps is not that of the
    energy: one sweep is 2 % off at 0.25 ms, eight are 15 % off at 1 ms.
    """
    body, wanted = hung_by_fem("neo_hookean")
    for h in (2.5e-4, 1e-3):
        assert hung(body, "neo_hookean", h, 1) == pytest.approx(wanted, rel=0.012)
    assert hung(body, "neo_hookean", 2.5e-4, 1, at_once=False) == pytest.approx(wanted, rel=0.02)
    assert hung(body, "neo_hookean", 1e-3, 8, at_once=False) < 0.9 * wanted
