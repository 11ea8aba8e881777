"""Error indicators against the true error: of the mesh on known fields, of PBD against finite elements solved."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from fem_run import FemRun, block
from numpy.typing import NDArray
from pbd_run import PbdRun, static_solution

from softseam_protocol.messages.header import Header
from softseam_protocol.messages.participant import BodyState, Fields
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.kinds import ElementKind
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.lattice import LOCAL
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

Floats = NDArray[np.float64]
HEADER = Header(1, "test", "near", 0, 0, 0, 0.0)
LENGTH, STILL = 0.04, (0.0, 0.0, 0.0)
CLAMP = {"fixed": [{"min": (-0.0401, -1.0, -1.0), "max": (-0.0399, 1.0, 1.0)}]}


def state(body: Body, x: Floats) -> BodyState:
    none = np.full(body.n_points, -1, dtype=np.int32)
    return BodyState(x, np.zeros_like(x), np.zeros((body.n_points, 3)), none)


def waves(x: Floats) -> Floats:
    """A smooth displacement (n, 3) [m] with strains of all kinds, to 1e-3."""
    a, b, c = np.moveaxis(x / LENGTH, -1, 0)
    return np.asarray(
        1e-5 * np.stack([np.sin(2 * a + b) * np.cos(c), np.cos(1.5 * b) * a**3, np.sin(2 * c * a)], axis=-1)
    )


def gradient(field: Callable[[Floats], Floats], x: Floats, step: float = 1e-6) -> Floats:
    """du_i/dx_j (n, 3, 3) by differences."""
    return np.stack([(field(x + h) - field(x - h)) / (2.0 * step) for h in step * np.eye(3)], axis=-1)


def energy_of_the_error(body: Body, moved: Floats, quadratic: bool) -> float:
    """1/2 int e : C : e with e the strain that interpolation of `waves` lacks, by Gauss points of its own [J]."""
    at, weight = np.polynomial.legendre.leggauss(4)
    total = 0.0
    line = np.linspace(-1.0, 1.0, 3) if quadratic else np.array([0.0, 1.0])
    material = body.material
    for i in range(4):
        for j in range(4):
            for k in range(4):
                share = weight[i] * weight[j] * weight[k]
                for corner in [(0, 0, 0)] if quadratic else np.ndindex(2, 2, 2):
                    local = np.array([at[i], at[j], at[k]])
                    if not quadratic:
                        local = 0.5 * (local + 1.0)  # within an octant, 0 .. 1
                    value = [_lagrange(line, t) for t in local]
                    size = body.edges / 2.0
                    slope = [_slope(line, t) / h for t, h in zip(local, size, strict=True)]
                    inside = [
                        a
                        for a, place in enumerate(LOCAL)
                        if quadratic or all(0 <= place[m] - corner[m] <= 1 for m in range(3))
                    ]
                    strain, X = np.zeros((body.n_cells, 3, 3)), np.zeros((body.n_cells, 3))
                    for a in inside:
                        p, q, r = LOCAL[a] - (np.zeros(3, int) if quadratic else np.array(corner))
                        n = value[0][p] * value[1][q] * value[2][r]
                        g = np.array(
                            [
                                slope[0][p] * value[1][q] * value[2][r],
                                value[0][p] * slope[1][q] * value[2][r],
                                value[0][p] * value[1][q] * slope[2][r],
                            ]
                        )
                        nodes = body.cell_nodes[:, a]
                        strain += moved[nodes][:, :, None] * g[None, None]
                        X += n * body.x_rest[nodes]
                    e = strain - gradient(waves, X)
                    e = 0.5 * (e + e.transpose(0, 2, 1))
                    trace = np.trace(e, axis1=1, axis2=2)
                    density = material.mu * (e * e).sum(axis=(1, 2)) + 0.5 * material.lambda_ * trace**2
                    volume = share / 8.0 * float(body.edges.prod()) * (1.0 if quadratic else 0.125)
                    total += volume * float(density.sum())
    return total


def _lagrange(line: Floats, t: float) -> list[float]:
    return [float(np.prod([(t - o) / (p - o) for o in line if o != p])) for p in line]


def _slope(line: Floats, t: float) -> Floats:
    h = 1e-6
    return np.asarray((np.array(_lagrange(line, t + h)) - np.array(_lagrange(line, t - h))) / (2.0 * h))


@pytest.mark.parametrize("poisson", [0.3, 0.45])
@pytest.mark.parametrize("element", ["hex27_full", "hex8_full"])
def test_the_mesh_error_of_a_known_field(element: ElementKind, poisson: float) -> None:
    """ZZ's estimate over the true error in the energy norm, on two meshes; and the rate: 2 of hex27, 1 of hex8."""
    quadratic = element == "hex27_full"
    found = []
    for n in (2, 4):
        scene = block(
            (LENGTH,) * 3,
            LENGTH / n,
            kind="linear",
            poisson=poisson,
            gravity=STILL,
            models={"fem": {"element": element}},
        )
        body = FemRun(scene).body
        moved = waves(body.x_rest)
        fields: Fields = FemRun(scene, state=state(body, body.x_rest + moved)).solver.fields(HEADER, True)
        true = np.sqrt(energy_of_the_error(body, moved, quadratic))
        found.append(np.sqrt(fields.mesh_error.sum()))
        assert 0.9 < found[-1] / true < 1.4
    rate = np.log2(found[0] / found[1])
    assert rate == pytest.approx(2.0 if quadratic else 1.0, abs=0.2)


@pytest.mark.parametrize(("element", "least", "most"), [("hex27_full", 0.7, 1.3), ("hex8_full", 0.75, 1.1)])
def test_the_mesh_error_of_a_cantilever_at_rest(element: ElementKind, least: float, most: float) -> None:
    """Hooke's law: the error's energy is what the potential energy lacks to that of much finer cells."""
    beams = {}
    for n, kind in ((1, element), (2, element), (6, "hex27_full")):
        models = {"fem": {"integrator": "static", "element": kind, "tolerance": 1e-12}}
        scene = block((0.08, 0.02, 0.02), 0.02 / n, 50e3, 0.3, kind="linear", gravity=(0, 0, -0.5), body=CLAMP,
                      models=models, step=1.0)  # fmt: skip
        run = FemRun(scene)
        reply = run.step()
        wanted = n < 6
        beams[n] = reply.strain + reply.gravity, run.solver.fields(HEADER, wanted).mesh_error.sum() if wanted else 0.0
    for n in (1, 2):
        assert least < np.sqrt(beams[n][1] / (beams[n][0] - beams[6][0])) < most


def test_uniform_stress_has_no_mesh_error() -> None:
    for element in ("hex27", "hex8", "hex8_bbar", "tet4"):
        scene = block((0.04, 0.03, 0.06), (0.02, 0.03, 0.02), gravity=STILL, models={"fem": {"element": element}})
        body = FemRun(scene).body
        x = body.x_rest @ np.array([[1.1, 0.05, 0.0], [0.0, 0.9, 0.02], [0.0, 0.0, 1.05]])
        fields = FemRun(scene, state=state(body, x)).solver.fields(HEADER, True)
        assert fields.mesh_error.sum() < 1e-12 * fields.cell_energy.sum()


@pytest.mark.parametrize(("kind", "gravity"), [("linear", -0.5), ("neo_hookean", -5.0)])
def test_the_model_error_is_what_finite_elements_would_correct(kind: str, gravity: float) -> None:
    """PBD's static beam put into FEM: its energy above FEM's own minimum is the indicator's sum."""
    models = {"fem": {"integrator": "static", "element": "hex27_full", "tolerance": 1e-12}}
    scene = block((0.08, 0.02, 0.02), 0.02, 50e3, 0.3, 1000.0, kind, gravity=(0, 0, gravity), body=CLAMP, models=models,
                  step=1.0)  # fmt: skip
    fem, pbd = FemRun(scene), PbdRun(scene)
    reply = fem.step()
    load = pbd.region.mass[:, None] * pbd.body.gravity
    x = static_solution(pbd, load)
    there = FemRun(scene, state=state(pbd.body, x)).solver
    true = there.strain - float((load * (x - pbd.body.x_rest)).sum()) - (reply.strain + reply.gravity)
    seen = PbdRun(scene, x=x).solver.fields(HEADER, True).model_error
    assert seen.sum() == pytest.approx(true, rel=0.01)
    potential = there.fields(HEADER, True).model_error
    np.testing.assert_allclose(potential, seen, rtol=1e-9)
    assert np.argmax(seen) == 0, "the clamped cell is the one that bends most"


def test_a_pbd_that_lags_shows_a_larger_model_error() -> None:
    """The same beam, let go: with one long substep a step the blocks' stress lags behind their shape."""
    errors = []
    for substeps in (2, 40):
        scene = block((0.08, 0.02, 0.02), 0.02, 50e3, 0.3, 1000.0, gravity=(0, 0, -5.0), body=CLAMP, step=0.01,
                      models={"pbd": {"substeps": substeps}})  # fmt: skip
        run = PbdRun(scene)
        run.run(0.03)
        fields = run.solver.fields(HEADER, True)
        errors.append(fields.model_error.sum() / fields.cell_energy.sum())
    assert errors[0] > 1.3 * errors[1]


def hanging(quantities: list[str]) -> Scene:
    """A bar, half FEM, half PBD."""
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "hang",
            "step": 0.005,
            "duration": 0.05,
            "body": {
                "shape": {"kind": "block", "size": (0.08, 0.02, 0.02)},
                "cell": 0.02,
                "material": {"young": 5e4, "poisson": 0.4, "density": 1000.0},
                **CLAMP,
            },
            "regions": {"default": "pbd", "near": {"boxes": [{"min": (-1, -1, -1), "max": (0, 1, 1)}]}},
            "quantities": quantities,
        }
    )


def test_a_scene_that_asks_gets_numbers_and_fields() -> None:
    simulation = Simulation(bundle_scene(hanging(["model_error", "traction_jump"])), EmbeddedTransport())
    for _ in range(6):
        report = simulation.step(fields=True)
    frame = simulation.frame()
    seen = frame.indicators
    assert seen is not None
    near = frame.cell_near == 1
    assert (seen.model_error[near] == 0.0).all() and (seen.model_error[~near] > 0.0).all()
    assert (seen.mesh_error[near] > 0.0).all() and (seen.mesh_error[~near] == 0.0).all()
    assert np.flatnonzero(seen.traction_jump).tolist() == [1, 2], "the two cells at the seam"
    strain = sum(region.strain for region in report.parts.values())
    assert report.quantities["model_error"] == pytest.approx(np.sqrt(seen.model_error.sum() / strain))
    assert report.quantities["traction_jump"] == pytest.approx(seen.traction_jump[1])
    assert seen.gap.max() > 0.0
    simulation.close()


def test_a_scene_that_does_not_ask_pays_nothing() -> None:
    simulation = Simulation(bundle_scene(hanging([])), EmbeddedTransport())
    report = simulation.step(fields=True)
    assert simulation.frame().indicators is None
    assert not {"model_error", "mesh_error", "traction_jump"} & set(report.quantities)
    simulation.close()


def test_two_materials_side_by_side_are_told_apart() -> None:
    """A bar of a soft and a stiff half, pulled: stress is uniform though strain jumps, so the mesh does not err.
    PBD's error in a bar that sags is still what FEM's energy has too much."""
    half = {"kind": "box", "size": (0.04, 0.02, 0.02), "position": (0.02, 0.0, 0.01)}
    inclusion = {"shape": half, "material": {"young": 2e5}}
    body = {"inclusions": [inclusion], **CLAMP}
    models = {"fem": {"integrator": "static", "element": "hex27_full", "tolerance": 1e-12}}
    scene = block(
        (0.08, 0.02, 0.02), 0.02, 5e4, 0.0, 1000.0, "linear", body=body, gravity=STILL, models=models, step=1.0
    )
    built = FemRun(scene).body
    assert len(built.materials) == 2 and np.unique(built.octant_material).tolist() == [0, 1]
    x = built.x_rest.copy()
    x[:, 0] += np.where(x[:, 0] < 0.0, 0.04 * (x[:, 0] + 0.04), 0.04 * 0.04 + 0.01 * x[:, 0])
    fields = FemRun(scene, state=state(built, x)).solver.fields(HEADER, True)
    assert fields.mesh_error.sum() < 1e-12 * fields.cell_energy.sum()
    scene = block(
        (0.08, 0.02, 0.02), 0.02, 5e4, 0.3, 1000.0, "linear", body=body, gravity=(0, 0, -0.5), models=models, step=1.0
    )
    fem, pbd = FemRun(scene), PbdRun(scene)
    reply = fem.step()
    load = pbd.region.mass[:, None] * pbd.body.gravity
    x = static_solution(pbd, load)
    there = FemRun(scene, state=state(pbd.body, x)).solver
    true = there.strain - float((load * (x - pbd.body.x_rest)).sum()) - (reply.strain + reply.gravity)
    assert PbdRun(scene, x=x).solver.fields(HEADER, True).model_error.sum() == pytest.approx(true, rel=0.01)
