"""Newton's corrections with what changed at contacts since the factor was made."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from test_fem_contact import forces_at, squeezed_problem

from softseam_services.fem.kernels.contact_changes import apply_changes, find_changes, solve_with_changes
from softseam_services.fem.kernels.contact_columns import SLIP, STICK
from softseam_services.fem.kernels.fronts import solve
from softseam_services.fem.kernels.newton import refactor

pytestmark = pytest.mark.kernels

Floats = NDArray[np.float64]


@pytest.mark.parametrize(("friction", "state"), [(5.0, STICK), (0.3, SLIP)])
def test_the_whole_tangent_is_the_gradient_of_the_force(friction: float, state: int) -> None:
    """Central differences along every direction, those that change the pressure included."""
    model, parameters, _, work, tools, x, count = squeezed_problem(
        friction, multiplier=(0.0, 0.0, 1e-3), start=(3e-5, 1e-5, 0.0)
    )
    for _ in range(2):  # it slips the same way twice
        forces_at(x, model, parameters, tools, count, work)
    assert (work.state[:count] == state).all()
    find_changes(parameters, count, work)
    way, e = np.random.default_rng(0).standard_normal(x.shape), 1e-9
    ordered, product = np.zeros_like(work.r), np.empty_like(work.r)
    ordered.reshape(-1, 3)[model.order] = way
    apply_changes(model, parameters, count, ordered, work, product)
    difference = forces_at(x - e * way, model, parameters, tools, count, work) - forces_at(
        x + e * way, model, parameters, tools, count, work
    )
    np.testing.assert_allclose(product, difference / (2.0 * e), atol=1e-5 * np.abs(product).max())


def test_what_turned_round_does_not_slip_freely() -> None:
    """Along the way of a slip nothing resists; where that has just turned round, it is taken to."""
    model, parameters, _, work, tools, x, count = squeezed_problem(
        0.3, multiplier=(0.0, 0.0, 1e-3), start=(3e-5, 0.0, 0.0)
    )
    along, free, turned = np.zeros_like(work.r), np.empty_like(work.r), np.empty_like(work.r)
    along.reshape(-1, 3)[:, 0] = 1.0
    for _ in range(2):
        forces_at(x, model, parameters, tools, count, work)
    assert work.turned[0] == 0
    find_changes(parameters, count, work)
    apply_changes(model, parameters, count, along, work, free)
    forces_at(x - np.array([6e-5, 0.0, 0.0]), model, parameters, tools, count, work)
    assert (work.state[:count] == SLIP).all() and work.turned[0] == count
    find_changes(parameters, count, work)
    apply_changes(model, parameters, count, along, work, turned)
    assert np.abs(free).max() < 1e-9 * np.abs(turned).max()


@pytest.mark.slow
def test_a_factor_of_contacts_that_stuck_solves_for_what_slips() -> None:
    """What GMRES finds is the solution with the whole tangents, to its tolerance; that of the factor is far from it."""
    model, parameters, tree, work, tools, x, count = squeezed_problem(
        0.3, multiplier=(0.0, 0.0, 1e-3), start=(1e-6, 0.0, 0.0)
    )
    forces_at(x, model, parameters, tools, count, work)
    assert (work.state[:count] == STICK).all()
    assert refactor(x, x, model, parameters, tree, tools, count, 1e4, 1.0, False, -np.inf, False, work)
    work.begun[:count, 0] -= 3e-5
    for _ in range(2):
        forces_at(x, model, parameters, tools, count, work)
    assert (work.state[:count] == SLIP).all()
    low = parameters.x_rest[:, 2] == parameters.x_rest[:, 2].min()
    work.d[:] = 0.0
    work.d.reshape(-1, 3)[model.order[low], 0] = 1e-3  # a push along the way they slip
    solve(tree, work.values, work.d, work.factoring)
    plain = work.d.copy()

    def left(d: Floats) -> float:
        """Of eq. (1), relative."""
        change = np.empty_like(d)
        apply_changes(model, parameters, count, d, work, change)
        solve(tree, work.values, change, work.factoring)
        return float(np.linalg.norm(d + change - plain) / np.linalg.norm(plain))

    solve_with_changes.py_func(model, parameters, tree, count, work)  # alone it is not compiled: newton is
    assert left(work.d.copy()) < 0.05
    assert left(plain) > 0.2
