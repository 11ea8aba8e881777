"""Cells that lose volume between the points of split quadrature (fem/kernels/point_volumes.py)."""

from __future__ import annotations

import numpy as np
import pytest
from element_statics import Floats, Statics, lattice
from fem_run import FemRun, block

from softseam.scenes import load_scene
from softseam.variants import AS_GIVEN, with_settings
from softseam_protocol.messages.participant import BodyState
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.kinds import ElementKind
from softseam_protocol.scene.models import FemSpec
from softseam_services.fem.elements.hexahedra import SHARES
from softseam_services.fem.integrators.table import longest_substep
from softseam_services.fem.kernels.point_volumes import FIRST, WATCHED, strain_energy, watch_cells
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation

CORE = {"shape": {"kind": "box", "position": (0.02, 0.01, 0), "size": (0.01, 0.01, 0.05)}, "material": {"young": 150e3}}


def _case(element: ElementKind, stiff: bool = False) -> Statics:
    return Statics(lattice((0.02, 0.02, 0.02), (2, 2, 2), young=50e3, inclusions=[CORE] if stiff else []), element)


def _pressed(case: Statics, by: float) -> Floats:
    """Nodes (n, 3) [m], the upper edge at the largest x pressed in by this."""
    x = case.x_rest * np.array([1.05, 1.02, 0.95])
    edge = (case.x_rest[:, 0] > 0.0199) & (case.x_rest[:, 2] > 0.0199)
    x[edge, 2] -= by
    return np.asarray(x + 1e-4 * np.random.default_rng(1).standard_normal(x.shape))


def _watch(case: Statics, x: Floats) -> None:
    """As a step that begins at x does."""
    case.work.watched[:], case.work.watches[0] = False, 0
    watch_cells(WATCHED, x, case.model, case.parameters, case.work)


def _added(case: Statics, x: Floats) -> float:
    """What it adds to the energy at x [J]."""
    case.energy(x)
    return float(strain_energy(x, case.model, case.parameters, case.work))


@pytest.mark.parametrize("element", SHARES)
def test_smooth_cells_have_none_of_it(element: ElementKind) -> None:
    """Stretched, sheared, squeezed to 60 %, bent: no cell is watched, whatever they are counted as."""
    case = _case(element)
    X = case.x_rest
    bent = X + np.stack([4.0 * X[:, 0] * X[:, 2], 0.0 * X[:, 0], -2.0 * X[:, 0] ** 2], axis=1)
    for x in (1.3 * X, X @ np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.2], [0.1, 0.0, 0.6]]), bent):
        _watch(case, x)
        assert case.work.watches[0] == 0


@pytest.mark.parametrize("element", SHARES)
@pytest.mark.parametrize("stiff", [False, True])
@pytest.mark.parametrize("by", [4.5e-3, 6.5e-3, 9e-3])
def test_forces_and_stiffness_are_those_of_an_energy(element: ElementKind, stiff: bool, by: float) -> None:
    """An edge pressed in, some cells full quadrature in part, at last points inside out; in one case two materials."""
    case = _case(element, stiff)
    x = _pressed(case, by)
    case.share(x)
    _watch(case, x)
    mu = case.parameters.full.parameters[case.parameters.full.blend[case.work.watched], :, 0]
    assert (np.ptp(mu, axis=1) > 0.0).any() == stiff
    assert 0 < case.work.watches[0] < 8 and _added(case, x) > 1e-3 * case.energy(x)
    along, step = np.random.default_rng(2).standard_normal(x.shape), 1e-8
    slope = (case.energy(x + step * along) - case.energy(x - step * along)) / (2.0 * step)
    assert slope == pytest.approx(float((case.forces(x) * along).sum()), rel=1e-6)
    change = (case.forces(x + step * along) - case.forces(x - step * along)).ravel() / (2.0 * step)
    product = case.stiffness(x) @ along.ravel()
    np.testing.assert_allclose(product, change, atol=1e-6 * np.abs(change).max())


@pytest.mark.parametrize("element", SHARES)
def test_cells_are_watched_before_they_have_any(element: ElementKind) -> None:
    """As an edge is pressed in, cells are counted first, and then begin with nothing: no step finds a jump."""
    case = _case(element)
    added, watched = [], []
    for by in np.linspace(0.0, 9e-3, 181):
        x = _pressed(case, float(by))
        _watch(case, x)
        watched.append(int(case.work.watches[0]))
        added.append(_added(case, x) if watched[-1] else 0.0)
    assert WATCHED > 0.0 and watched[0] == 0
    first, begins = np.flatnonzero(watched)[0], np.flatnonzero(added)[0]
    assert first < begins
    assert added[begins] < 1e-3 * added[-1]


@pytest.mark.parametrize("element", SHARES)
def test_a_cell_that_got_there_within_a_step_is_counted(element: ElementKind) -> None:
    """From rest to where it has energy in one step: it is found at the end, once, and has what it has there.

    Its energy is told in any case: nothing need have been looked at when a body is configured from a state.
    """
    case = _case(element)
    x = _pressed(case, 6.5e-3)
    energy = case.energy(x)
    _watch(case, x)
    forces, watches = case.forces(x), case.work.watches[0]
    assert _added(case, x) > 0.01 * energy
    _watch(case, case.x_rest)
    assert case.work.watches[0] == 0 and case.energy(x) == energy
    assert np.abs(case.forces(x) - forces).max() > 0.01 * np.abs(forces).max()
    assert 0 < watch_cells(FIRST, x, case.model, case.parameters, case.work) == case.work.watches[0] <= watches
    np.testing.assert_array_equal(case.forces(x), forces)
    assert watch_cells(FIRST, x, case.model, case.parameters, case.work) == 0


@pytest.mark.parametrize("element", SHARES)
def test_a_look_is_of_the_places_that_it_was_of(element: ElementKind) -> None:
    """Places that change, even in the same array, are looked at anew; of the same ones it is kept, whatever counts."""
    case, x, other = _case(element), _pressed(_case(element), 6.5e-3), _pressed(_case(element), 4e-3)
    energy, added, there = case.energy(x), _added(case, x), _case(element).energy(other)
    _watch(case, x)
    watched = case.work.watched.copy()
    x[:] = other
    assert case.energy(x) == there != energy
    x[:] = _pressed(case, 0.0)
    _watch(case, x)
    assert case.work.watches[0] == 0 < watched.sum()
    x[:] = _pressed(case, 6.5e-3)
    _watch(case, x)
    np.testing.assert_array_equal(case.work.watched, watched)
    case.work.part[:] = 0.5
    assert _added(case, x) == pytest.approx(0.5 * added, rel=1e-12)
    x[0, 0] = np.nan
    _watch(case, x)
    x[:] = _pressed(case, 6.5e-3)
    assert _added(case, x) == pytest.approx(0.5 * added, rel=1e-12)


def test_a_march_counts_it_in_every_substep() -> None:
    """An edge is kicked in by symplectic Euler: one step of four substeps is four steps of one."""
    fem = FemSpec(integrator="symplectic_euler")
    scene = block((0.02, 0.02, 0.02), 0.02, gravity=(0.0, 0.0, 0.0))
    scene = scene.model_copy(update={"models": scene.models.model_copy(update={"fem": fem})})
    rest, n_points = FemRun(scene).body.x_rest, len(FemRun(scene).body.surface.cell)
    v = np.zeros_like(rest)
    v[(rest[:, 0] > 0.0099) & (rest[:, 2] > 0.0199), 2] = -12.0
    state = BodyState(rest, v, np.zeros((n_points, 3)), np.full(n_points, -1, dtype=np.int32))
    ends, added = [], 0.0
    for n_steps in (1, 4):
        run = FemRun(scene, state=state)
        model, parameters, work = run.model, run.parameters, run.work
        substep = longest_substep(model, parameters, work)
        run.run(4 * substep, dt=4 * substep / n_steps)
        ends.append(run.x)
        run.solver.strain  # noqa: B018 - deformation gradients at the end
        added = float(strain_energy(run.x, model, parameters, work))
    assert added > 0.0
    np.testing.assert_allclose(ends[0], ends[1], rtol=0.0, atol=1e-9 * 0.02)


@pytest.mark.slow
def test_rims_of_pads_come_to_rest() -> None:
    """tofu_pads on 14^3 graded cells: when the pads stand still again, steps take few iterations.

    By split quadrature alone they took 7 to 50, as points of the rims went to and fro (docs/decisions/10).
    """
    settings = (
        *AS_GIVEN,
        "regions={default: fem}",
        "step=0.04",
        "symmetry=[x, y]",
        f"body.cell={[0.05 / 14] * 3}",
        "body.shape.grading=4",
    )
    simulation = Simulation(bundle_scene(with_settings(load_scene("tofu_pads"), settings)), EmbeddedTransport())
    iterations = []
    while simulation.time < 1.99:
        (reply,) = simulation.step().parts.values()
        iterations.append(reply.iterations)
    assert max(iterations[-8:]) <= 8
