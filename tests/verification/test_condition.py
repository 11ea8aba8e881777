"""Condition numbers of XPBD's systems, and Jacobi's radius: closed forms, dense matrices built one by one, and
gradients and tangents by differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from particle_run import ParticleRun, particle_scene
from pbd_run import PbdRun, block_scene
from tet_bar import bar_run

from softseam_protocol.scene.regions import RegionsSpec
from softseam_services.body.particles import ParticleBody
from softseam_services.pbd.condition import block_spectrum, block_tangents, condition_of
from softseam_services.pbd.kernels.block import new_workspace
from softseam_services.pbd.kernels.lanes import aligned
from softseam_services.pbd.kernels.sweep import batch_energies
from softseam_services.pbd.particles.condition import families, particle_spectrum, spring_spectrum
from softseam_services.pbd.spectrum import LARGEST, Spectrum

CLAMP = {"min": (-1.0, -1.0, -1.0), "max": (-0.49, 1.0, 1.0)}


def rope(divisions: int, stretch: float = 50.0, **other: Any) -> ParticleBody:
    spec = {"kind": "rope", "length": 1.0, "divisions": divisions, "density": 0.3, "stretch": stretch, **other}
    return ParticleRun(particle_scene(spec)).body


@pytest.mark.parametrize("substep", [1e-4, 1e-2, 1.0])
def test_two_springs_have_a_closed_form(substep: float) -> None:
    """A = [[d, -w], [-w, d]] with d = w' + w + alpha/h^2, w of the middle, w' of the ends: (d + w)/(d - w)."""
    body = rope(2)
    end, middle = 1.0 / body.mass[:2]
    d = end + middle + 1.0 / (body.springs.stiffness[0] * substep**2)
    assert spring_spectrum(body, substep).condition == pytest.approx((d + middle) / (d - middle), rel=1e-12)


def test_it_grows_with_the_square_of_a_stiff_rope_s_spacings() -> None:
    """The least eigenvalue of -1, 2, -1 on n springs falls as 1/n^2: twice as many, four times the number."""
    few, many = (spring_spectrum(rope(n, stretch=1e12, fixed=(CLAMP,)), 0.01).condition for n in (50, 100))
    assert many / few == pytest.approx(4.0, rel=0.03)


@pytest.mark.parametrize("substep", [1e-3, 1e-2])
def test_a_sheet_against_a_dense_matrix(substep: float) -> None:
    """More springs than particles have directions, and clamped ones."""
    spec = {"kind": "sheet", "size": (0.2, 0.2), "divisions": (6, 6), "density": 0.2, "stretch": 100.0}
    body = ParticleRun(particle_scene({**spec, "fixed": ({"min": (-1, -1, -1), "max": (-0.09, 1, 1)},)})).body
    weight = np.where(body.fixed, 0.0, 1.0 / body.mass)
    gradients = np.zeros((len(body.springs.rest), body.n_nodes, 3))
    for row, (i, j) in enumerate(body.springs.nodes):
        along = body.x_rest[j] - body.x_rest[i]
        gradients[row, i], gradients[row, j] = -along / np.linalg.norm(along), along / np.linalg.norm(along)
    A = np.einsum("anc,n,bnc->ab", gradients, weight, gradients)
    A += np.diag(1.0 / (body.springs.stiffness * substep**2))
    scale = np.diag(A) ** -0.5
    values = np.linalg.eigvalsh(scale[:, None] * A * scale)
    found = spring_spectrum(body, substep)
    assert found.condition == pytest.approx(values[-1] / values[0], rel=1e-5)
    iteration = np.linalg.eigvals(np.eye(len(A)) - A / np.diag(A)[:, None])
    assert found.jacobi == pytest.approx(np.abs(iteration).max(), rel=1e-5)
    assert (found.omega is None) == (substep == 1e-2)


def test_short_substeps_leave_each_spring_alone() -> None:
    """The chapter's claim (9.4.4): compliance and step bound it; as h goes to 0 it goes to 1."""
    body = rope(60, stretch=5e3)
    numbers = [spring_spectrum(body, h).condition for h in (1e-2, 1e-3, 1e-4, 1e-6)]
    assert numbers == sorted(numbers, reverse=True) and numbers[-1] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("n", "substep"), [(5, 1e-3), (40, 1e-2), (200, 1e-2)])
def test_a_chain_of_equal_springs_and_masses(n: int, substep: float) -> None:
    """A = w (-1, 2, -1) + alpha/h^2: eigenvalues w (2 - 2 cos(k pi/(n + 1))) + alpha/h^2, k = 1 .. n."""
    body = rope(n, stretch=500.0)
    body = replace(body, mass=np.full(n + 1, 1e-3))
    soft = 1.0 / (body.springs.stiffness[0] * substep**2)
    values = 1e3 * (2.0 - 2.0 * np.cos(np.arange(1, n + 1) * np.pi / (n + 1))) + soft
    found = spring_spectrum(body, substep)
    assert found.condition == pytest.approx(values[-1] / values[0], rel=1e-5)
    radius = 1.0 - found.least  # Jacobi's; that of Gauss-Seidel is its square (Young 1954)
    assert 0.1 ** (1.0 / found.sweeps) >= radius**2 * (1.0 - 1e-12)
    assert found.sweeps == 1 or 0.1 ** (1.0 / (found.sweeps - 1)) < radius**2


def test_what_is_left_of_an_error_after_the_sweeps_that_are_told() -> None:
    """A tenth of the slowest part: of a chain exactly; of a sheet's lattice, which has no such order, about so."""
    sheet = {"kind": "sheet", "size": (0.2, 0.2), "divisions": (6, 6), "density": 0.2, "stretch": 100.0}
    bodies = {"rope": rope(30, stretch=5e3), "sheet": ParticleRun(particle_scene(sheet)).body}
    for name, least, most in (("rope", 0.05, 0.101), ("sheet", 0.02, 0.3)):
        body = bodies[name]
        A = dense(body, [(springs_of, body.springs.nodes, 1.0 / body.springs.stiffness)], body.x_rest, 1e-3)
        sweep = np.eye(len(A)) - np.linalg.solve(np.tril(A), A)
        radius = np.abs(np.linalg.eigvals(sweep)).max()
        assert least < radius ** spring_spectrum(body, 1e-3).sweeps < most, name


Values = Callable[[NDArray[np.float64], int], Any]


def dense(
    body: ParticleBody, found: list[tuple[Values, Any, Any]], x: NDArray[np.float64], substep: float
) -> NDArray[np.float64]:
    """A, gradients by central differences of C(places (k, 3), number)."""
    rows, soft = [], []
    weight = np.repeat(np.where(body.fixed, 0.0, 1.0 / body.mass), 3)
    for values, particles, compliance in found:
        for number, nodes in enumerate(particles):
            gradient = np.zeros((body.n_nodes, 3))
            for corner, axis in np.ndindex(len(nodes), 3):
                ends = []
                for side in (1e-7, -1e-7):
                    places = x[nodes].copy()
                    places[corner, axis] += side
                    ends.append(float(values(places, number)))
                gradient[nodes[corner], axis] += (ends[0] - ends[1]) / 2e-7
            rows.append(gradient.ravel())
            soft.append(compliance[number])
    J = np.array(rows)
    return np.asarray((J * weight) @ J.T + np.diag(np.array(soft)) / substep**2)


def springs_of(places: NDArray[np.float64], _: int) -> Any:
    """Length, of which a constant is taken."""
    return np.linalg.norm(places[1] - places[0])


def scaled(A: NDArray[np.float64]) -> Spectrum:
    scale = np.diag(A) ** -0.5
    values = np.linalg.eigvalsh(scale[:, None] * A * scale)
    return Spectrum(float(values[0]), float(values[-1]))


def test_a_sheet_s_springs_bends_and_hinges_against_a_dense_matrix() -> None:
    """Bent, so that no gradient is along an axis; hinges' C is their own function's, bends' a sum of places."""
    hinges = [{"kind": "hinge", "bending": 1e-3, "curvature": (2.0, 0.0)}]
    spec = {"kind": "sheet", "size": (0.2, 0.2), "divisions": (4, 4), "density": 0.2, "stretch": 100.0}
    clamp = ({"min": (-1, -1, -1), "max": (-0.09, 1, 1)},)
    run = ParticleRun(particle_scene({**spec, "bending": 1e-3, "constraints": hinges, "fixed": clamp}))
    body, joined = run.body, run.solver.parameters.joined
    x = body.x_rest + 0.01 * np.random.default_rng(3).normal(size=body.x_rest.shape)
    bends = body.bends
    found: list[tuple[Values, Any, Any]] = [(springs_of, body.springs.nodes, 1.0 / body.springs.stiffness)]
    for axis in range(3):
        found.append((partial(sum_of, bends.coefficient, axis), bends.nodes, 1.0 / bends.stiffness))
    hinge = families_of(joined, x)
    found.append((hinge[0], hinge[1], joined.compliance))
    wanted, got = scaled(dense(body, found, x, 5e-3)), particle_spectrum(body, joined, x, 5e-3)
    assert got is not None and wanted.condition > 10.0
    assert got.least == pytest.approx(wanted.least, rel=1e-4) and got.most == pytest.approx(wanted.most, rel=1e-5)


def sum_of(coefficient: NDArray[np.float64], axis: int, places: NDArray[np.float64], number: int) -> Any:
    """A component of a bend's sum of places."""
    return coefficient[number] @ places[:, axis]


def families_of(joined: Any, x: NDArray[np.float64]) -> tuple[Values, NDArray[np.int64]]:
    """The angle of hinges, from the two normals, and their particles."""
    k = joined.families[0][1]
    particles = joined.particle.reshape(-1, k)

    def angle(p: NDArray[np.float64], _: int) -> Any:
        edge = p[1] - p[0]
        first, second = np.cross(p[0] - p[2], p[1] - p[2]), np.cross(p[1] - p[3], p[0] - p[3])
        return np.arctan2(np.cross(first, second) @ edge / np.linalg.norm(edge), first @ second)

    return angle, particles


@pytest.mark.parametrize(("law", "size"), [("st_venant_kirchhoff", 1.0), ("neo_hookean", 1.0), ("neo_hookean", 0.5)])
def test_tetrahedra_against_a_dense_matrix(law: str, size: float) -> None:
    """Strained by some 10 %, with volumes beside; a pair's distortion is softer by F:F where that is below 1, as of
    half the size."""
    run = bar_run((1, 1, 1), (0.05, 0.05, 0.05), law=law, constraints=({"kind": "volume", "bulk": 3e4},))
    body, joined = run.body, run.solver.parameters.joined
    assert body.solid is not None
    x = size * body.x_rest + 0.003 * size * np.random.default_rng(4).normal(size=body.x_rest.shape)
    nodes, mu, lam = body.solid.nodes, body.solid.elastic.mu, body.solid.elastic.lambda_
    inverse = np.linalg.inv((body.x_rest[nodes[:, 1:]] - body.x_rest[nodes[:, :1]]).transpose(0, 2, 1))
    volume = 1.0 / np.linalg.det(inverse) / 6.0

    def F(p: NDArray[np.float64], i: int) -> Any:
        return (p[1:] - p[0]).T @ inverse[i]

    def strain(a: int, b: int) -> Values:
        return lambda p, i: (1.0 if a == b else 2.0) * 0.5 * (F(p, i).T @ F(p, i) - np.eye(3))[a, b]

    softer = np.array([min(1.0, (F(x[each], i) ** 2).sum()) for i, each in enumerate(nodes)])
    found: list[tuple[Values, Any, Any]]
    if law == "neo_hookean":
        found = [
            (lambda p, i: np.linalg.norm(F(p, i)), nodes, 1.0 / (mu * volume * softer)),
            (lambda p, i: np.linalg.det(F(p, i)), nodes, 1.0 / ((lam + mu) * volume)),
        ]
    else:
        found = [(strain(a, a), nodes, 1.0 / (2.0 * mu * volume)) for a in range(3)]
        found += [(strain(a, b), nodes, 1.0 / (mu * volume)) for a, b in ((0, 1), (0, 2), (1, 2))]
        found += [(lambda p, i: 0.5 * (np.trace(F(p, i).T @ F(p, i)) - 3.0), nodes, 1.0 / (lam * volume))]
    of = joined.particle.reshape(-1, 4)
    found.append((lambda p, i: np.linalg.det(p[1:] - p[0]) / 6.0, of, joined.compliance))
    wanted, got = scaled(dense(body, found, x, 5e-3)), particle_spectrum(body, joined, x, 5e-3)
    assert got is not None and wanted.condition > 1.2 and (softer.min() < 0.9) == (size == 0.5)
    assert got.least == pytest.approx(wanted.least, rel=1e-4) and got.most == pytest.approx(wanted.most, rel=1e-5)


def blocks(kind: str = "neo_hookean", cell: float = 0.05, **other: Any) -> PbdRun:
    """A cube of 5 cm in eight blocks or more."""
    return PbdRun(block_scene((0.05, 0.05, 0.05), cell, kind=kind, **other))


def strained(run: PbdRun) -> NDArray[np.float64]:
    """Places of its nodes, thrown about by some 5 % of an edge."""
    rest = run.solver.parameters.arrays.x_rest
    return rest + 1e-3 * np.random.default_rng(5).normal(size=rest.shape)


@pytest.mark.parametrize("kind", ["neo_hookean", "linear", "mooney_rivlin"])
def test_tangents_of_blocks_are_second_differences_of_their_energy(kind: str) -> None:
    """J^T H J = d^2 U/dx^2, by the energy's own kernel; less what turns the stress, the second of J being zero."""
    run = blocks(kind)
    model, parameters, x = run.solver.model, run.solver.parameters, strained(run)
    J, H = block_tangents(model, parameters, x)
    found = np.zeros((3 * model.n_nodes, 3 * model.n_nodes))
    nodes = model.blocks.nodes.transpose(0, 2, 1)[model.blocks.order >= 0]
    for block, of in enumerate(nodes):
        at = (3 * of[:, None] + np.arange(3)).ravel()
        found[np.ix_(at, at)] += J[block].T @ H[block] @ J[block]
    numbers = parameters.blocks
    xw, energies = aligned(model.n_nodes + 8, 4), np.zeros((model.blocks.n_batches, 2))
    xw[: model.n_nodes, :3], xw[model.n_nodes :, :3] = x, numbers.padding_x

    def energy(*moved: tuple[int, float]) -> float:
        xw[: model.n_nodes, :3] = x
        for place, way in moved:
            xw[place // 3, place % 3] += way
        batch_energies(
            new_workspace(), xw, model.blocks.nodes, numbers.volume, numbers.constants, numbers.law,
            0, model.blocks.n_batches, energies,
        )  # fmt: skip
        return float(energies[:, 0].sum())

    step = 2e-6
    for i, j in np.random.default_rng(6).choice(3 * model.n_nodes, (20, 2)):
        second = sum(a * b * energy((i, a * step), (j, b * step)) for a in (1, -1) for b in (1, -1)) / (4.0 * step**2)
        assert found[i, j] == pytest.approx(second, abs=2e-4 * np.abs(found).max())


@pytest.mark.parametrize("kind", ["neo_hookean", "linear"])
def test_blocks_against_a_dense_matrix(kind: str) -> None:
    """1 + h^2 H^1/2 J W J^T H^1/2 of all blocks, scaled by the inverse roots of its diagonal blocks of 21."""
    fixed = ({"min": (-1.0, -1.0, -1.0), "max": (-0.024, 1.0, 1.0)},)
    run = blocks(kind, fixed=fixed)
    model, parameters, x = run.solver.model, run.solver.parameters, strained(run)
    J, H = block_tangents(model, parameters, x)
    h = 0.005 / parameters.substeps(0.005)
    nodes = model.blocks.nodes.transpose(0, 2, 1)[model.blocks.order >= 0]
    rows = np.zeros((len(nodes), 21, 3 * model.n_nodes))
    for block, of in enumerate(nodes):
        values, vectors = np.linalg.eigh(H[block])
        root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        rows[block][:, (3 * of[:, None] + np.arange(3)).ravel()] = h * root @ J[block]
    B = rows.reshape(-1, 3 * model.n_nodes) * np.sqrt(np.repeat(parameters.arrays.inverse_mass, 3))
    A, scale = np.eye(len(B)) + B @ B.T, np.zeros((len(B), len(B)))
    for block in range(len(nodes)):
        of = slice(21 * block, 21 * (block + 1))
        values, vectors = np.linalg.eigh(A[of, of])
        scale[of, of] = (vectors / np.sqrt(values)) @ vectors.T
    values = np.linalg.eigvalsh(scale @ A @ scale)
    found = block_spectrum(model, parameters, x, 0.005)
    assert found.least == pytest.approx(values[0], rel=1e-5) and found.most == pytest.approx(values[-1], rel=1e-5)
    assert found.condition > 1.3


def test_a_block_alone_is_solved_at_once_and_more_of_them_are_not() -> None:
    """A cell of one block has the number 1; it grows with blocks at substeps that do not, and falls with these."""
    alone = blocks(pbd={"coarse": {"beyond": 0.0}})
    found = block_spectrum(alone.solver.model, alone.solver.parameters, alone.solver.parameters.arrays.x_rest, 0.005)
    assert found.condition == pytest.approx(1.0, abs=1e-9) and found.sweeps == 1
    numbers = []
    for cell, substeps in ((0.05, 20), (0.025, 20), (0.0125, 20), (0.0125, 80), (0.0125, 2000)):
        run = blocks(cell=cell, pbd={"substeps": substeps})
        model, parameters = run.solver.model, run.solver.parameters
        numbers.append(block_spectrum(model, parameters, parameters.arrays.x_rest, 0.005).condition)
    assert numbers[0] < numbers[1] < numbers[2] > numbers[3] > numbers[4]
    assert numbers[4] == pytest.approx(1.0, abs=0.01)


def test_there_is_no_number_where_nothing_is_swept() -> None:
    """FEM's cells, classic PBD and leapfrog have none, nor what has too many unknowns; of cells that are cut XPBD's
    have one."""
    scene = block_scene((0.05, 0.05, 0.05), 0.025)
    run = PbdRun(scene)
    tools, x = run.tools, run.body.x_rest

    def of(default: str, x: NDArray[np.float64] = x, **pbd: Any) -> Any:
        regions = scene.regions.model_copy(update={"default": default})
        models = scene.models.model_copy(update={"pbd": scene.models.pbd.model_copy(update=pbd)})
        other = scene.model_copy(update={"regions": regions, "models": models})
        return condition_of(other, run.body, tools, x)

    assert of("fem") is None and of("pbd", method="leapfrog") is None
    whole = of("pbd")
    assert whole.spectrum.condition > 1.3 and whole.sweeps == 1
    half = RegionsSpec.model_validate({"default": "pbd", "near": {"model": "fem", "within": 0.01, "tools": []}})
    cut = scene.model_copy(update={"regions": half})
    first = np.arange(8) < 1
    rest, none = (condition_of(cut, run.body, tools, x, near) for near in (first, np.ones(8, dtype=np.bool_)))
    assert rest is not None and 1.3 < rest.spectrum.condition < whole.spectrum.condition and none is None
    most = LARGEST // 3
    assert of("pbd", np.concatenate([x, np.zeros((most - len(x), 3))])).spectrum == whole.spectrum
    assert of("pbd", np.concatenate([x, np.zeros((most + 1 - len(x), 3))])) is None
    sheet = {"kind": "rope", "length": 1.0, "divisions": 4, "density": 0.1, "stretch": 10.0}
    classic = ParticleRun(particle_scene(sheet, pbd={"method": "pbd"}))
    assert condition_of(classic.scene, classic.body, classic.tools, classic.body.x_rest) is None
    lone = ParticleRun(particle_scene(sheet))
    told = condition_of(lone.scene, lone.body, lone.tools, lone.body.x_rest)
    assert told is not None and [*families(lone.body, lone.solver.parameters.joined, lone.x)]
