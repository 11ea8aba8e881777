"""The textbook's pitfalls: what is done wrong in each, seen to fail, beside what is done here; both measured."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam.errors import BadInput
from softseam.observation import Observation
from softseam_studies.atlas.runs import hang, iterations, poisson
from softseam_studies.atlas.scenes import FEM, confined, force_share, press
from softseam_studies.atlas.trace import follow
from softseam_studies.atlas.verdicts import percent
from softseam_studies.study.store import Store

Floats = NDArray[np.float64]
Answer = tuple[str, str, bool, str]
"""control, remedy, whether the one failed and the other held, the test that keeps it so"""


def locking() -> Answer:
    """Bonded squeeze at nu 0.4999."""
    bad, good = poisson(0.4999, "hex8_full", False, 0.05), poisson(0.4999, "hex27", False, 0.05)
    assert bad.error is not None and good.error is not None
    return (
        f"hex8_full at nu 0.4999: force {percent(bad.error)} too large",
        f"hex27: {percent(good.error)}",
        bad.error > 1.0 and good.error < 0.02,
        "test_element_convergence.py::test_uncured_elements_lock",
    )


def hourglass() -> Answer:
    """Patterns of a hexahedron with one point that cost nothing: those of K = V B^T D B with and without control."""
    signs = np.array([[x, y, z] for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)])
    gradient = signs / 4.0  # of a unit cube's shape functions at its middle
    strain = np.zeros((6, 24))
    for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
        strain[row, i::3] += gradient[:, j]
        strain[row, j::3] += gradient[:, i]
    x, y, z = signs.T
    patterns = np.stack([y * z, x * z, x * y, x * y * z])
    control = np.kron(patterns.T @ patterns / 64.0, np.eye(3))
    free = [_free_modes(strain.T @ strain + share * control) for share in (0.0, 1.0)]
    return (
        f"hexahedron with one point, no control: {free[0]} patterns without energy, 6 are rigid",
        f"with hourglass stiffness, as hex8_reduced and XPBD's blocks: {free[1]}",
        free == [18, 6],
        "test_fem_elements.py::test_a_reduced_hexahedron_without_hourglass_control_has_spurious_modes",
    )


def _free_modes(stiffness: Floats) -> int:
    values = np.linalg.eigvalsh(stiffness)
    return int(np.count_nonzero(values < 1e-10 * values[-1]))


def negative_jacobian() -> Answer:
    """Squeeze by 60 %: a law without a barrier collapses, neo-Hookean does not."""
    found = []
    for material in ("st_venant_kirchhoff", "neo_hookean"):
        trace = follow(
            press(2e4, 0.005, FEM, squeeze=0.6, material=material, hold=0.3, speed=0.03, walls=True), force_share(2e4)
        )
        found.append(trace)
    peak = max(found[0].values, default=0.0)
    good = abs(found[1].value / confined(0.6) - 1.0)
    left = found[0].value if found[0].finite else float("nan")
    bad = f"its force falls from {peak:.3f} to {left:.3f} E A" if not found[0].failed else "the run is given up"
    return (
        f"St. Venant-Kirchhoff squeezed by 60 %: {bad}, as cells collapse",
        f"neo-Hookean, whose energy grows without bound: {found[1].value:.3f} E A, {percent(good)} off the closed form",
        (bool(found[0].failed) or left < 0.8 * peak) and good < 0.02,
        "test_materials.py::test_st_venant_kirchhoff_weakens_where_it_says",
    )


def constraint_order() -> Answer:
    """A rope between two clamps whose springs are numbered otherwise."""
    control, remedy = _spread(coloured=False), _spread(coloured=True)
    return (
        f"one sweep a step in the springs' order: numbered otherwise, a chain hangs {percent(control)} of its sag off",
        f"colours of springs that share no particle, projected colour by colour: {percent(remedy)}",
        control > 0.01 and remedy == 0.0,
        "test_sheets.py",
    )


def _spread(coloured: bool) -> float:
    """Largest distance between chains whose springs were numbered in two ways, over the sag [1]."""
    chains = [_chain(coloured, np.random.default_rng(seed).permutation(12).tolist()) for seed in (0, 1, 2)]
    return max(float(np.abs(chain - chains[0]).max()) for chain in chains[1:]) / -float(chains[0][:, 1].min())


def _chain(coloured: bool, order: list[int], n_steps: int = 200) -> Floats:
    """Classic PBD on a chain clamped at both ends, one sweep a step: positions after 2 s (n + 1, 2) [m]."""
    n, dt = len(order), 0.01
    x = np.zeros((n + 1, 2))
    x[:, 0] = np.linspace(0.0, 0.9, n + 1)
    v = np.zeros_like(x)
    springs = sorted(order, key=lambda i: i % 2) if coloured else order
    for _ in range(n_steps):
        old = x.copy()
        v[1:-1, 1] -= 9.81 * dt
        v *= 0.95
        x[1:-1] += dt * v[1:-1]
        for i in springs:
            d = x[i + 1] - x[i]
            distance = float(np.hypot(*d))
            w0, w1 = float(i > 0), float(i + 1 < n)
            move = (1.0 - 1.0 / (n * distance)) / (w0 + w1) * d
            x[i] += w0 * move
            x[i + 1] -= w1 * move
        v = (x - old) / dt
    return x


def counted_iterations() -> Answer:
    """The rope at 4 and at 32 sweeps."""
    bad = iterations(32, 0.6, "classic", 0.05).error
    few, many = (hang({"sweeps": sweeps}, 50.0).value for sweeps in (8, 32))
    assert bad is not None
    good = abs(many / few - 1.0)
    return (
        f"classic PBD: 32 sweeps instead of 4 stretch a rope {percent(bad)} less",
        f"XPBD (E A 50 N; stiffer ropes: the map above): 32 sweeps instead of 8 change it by {percent(good)}",
        bad > 0.5 and good < 0.05,
        "test_ropes.py",
    )


def mass() -> Answer:
    """A cube squeezed by 30 %: density times present volume against what the ground carries."""
    weights, volumes = [], []

    def weigh(observation: Observation) -> float:
        x = observation.surface
        extent = x.max(axis=0) - x.min(axis=0)
        volumes.append(float(np.prod(extent)))
        weights.append(float(-observation.wrench["ground"][2]))
        return weights[-1]

    scene = press(2e4, 0.01, FEM, squeeze=0.3, hold=0.6)
    scene["gravity"] = [0, 0, -9.81]
    scene["body"]["position"] = [0, 0, 0]
    for name in ("left", "right"):
        scene["tools"][name]["position"][2] = 0.01
    scene["tools"]["ground"] = {"kind": "plane", "friction": 0.0}
    trace = follow(scene, weigh, fields=True)
    true = 1000.0 * 0.02**3 * 9.81
    control, remedy = abs(1000.0 * volumes[-1] * 9.81 / true - 1.0), abs(trace.value / true - 1.0)
    return (
        f"density times present volume, squeezed by 30 %: {percent(control)} of the mass gone",
        f"masses of the body at rest: the ground carries all but {percent(remedy)}",
        control > 0.03 and remedy < 0.005,
        "test_pbd_dynamics.py::test_free_flight_keeps_momentum",
    )


def closed_cycle() -> Answer:
    """Work over a closed loop of deformation: a stress made up by hand, and the derivative of an energy."""
    young, poisson = 1.0, 0.3
    mu, lam = 0.5 * young / (1 + poisson), young * poisson / ((1 + poisson) * (1 - 2 * poisson))

    def made_up(f: Floats) -> Floats:
        e = 0.5 * (f + f.T) - np.eye(3)  # small strain, used as if it were the first Piola-Kirchhoff stress of f
        return np.asarray(f @ f @ (2 * mu * e + lam * np.trace(e) * np.eye(3)))

    def derivative(f: Floats) -> Floats:
        log, back = np.log(np.linalg.det(f)), np.linalg.inv(f).T
        return np.asarray(mu * (f - back) + lam * log * back)

    works = [_loop(stress) for stress in (made_up, derivative)]
    return (
        f"a stress that is no derivative: a closed cycle of deformation does {percent(works[0])} of its largest work",
        f"dPsi/dF: {percent(works[1])}",
        works[0] > 0.01 and works[1] < 1e-5,
        "test_materials.py::test_stress_and_tangent_are_derivatives",
    )


def _loop(stress: Any, n: int = 400) -> float:
    """|Work| over a square of stretch and shear, relative to the largest work on the way."""
    corners = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3), (0.0, 0.0)]
    work = most = 0.0
    for (a0, s0), (a1, s1) in pairwise(corners):
        for i in range(n):
            ends = [_sheared(a0 + (a1 - a0) * t, s0 + (s1 - s0) * t) for t in (i / n, (i + 1) / n)]
            work += float(np.sum(stress(0.5 * (ends[0] + ends[1])) * (ends[1] - ends[0])))
            most = max(most, abs(work))
    return abs(work) / most


def _sheared(stretch: float, shear: float) -> Floats:
    """Deformation gradient (3, 3)."""
    return np.array([[1.0 + stretch, shear, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def large_rotation() -> Answer:
    """A free cube that spins: linear strain takes the turn for stretch."""
    bad, good = _swelling("linear"), _swelling("neo_hookean")
    return (
        f"linear strain: a cube that turns freely changes its diagonal by {percent(bad)}",
        f"neo-Hookean: {percent(good)}",
        bad > 0.05 and good < 0.01,
        "test_materials.py::test_linear_is_not_objective",
    )


def _swelling(material: str) -> float:
    """Largest change of the body's diagonal in a turn at 10 rad/s [1]."""
    scene = press(1e5, 0.005, FEM, material=material)
    scene |= {"tools": {}, "motion": [], "duration": 0.6, "quantities": []}
    scene["body"]["spin"] = [0, 0, 10.0]
    scene["models"][FEM] = {"integrator": "midpoint"}
    rest = np.sqrt(3.0) * 0.02

    def change(observation: Observation) -> float:
        x = observation.positions
        return float(abs(2.0 * np.linalg.norm(x - x.mean(axis=0), axis=1).max() / rest - 1.0))

    return max(follow(scene, change, fields=True).values)


def courant() -> Answer:
    """An explicit step beyond what is stable, and the same step where it is divided."""
    k, dt = 1.0, 2.05
    x, v = 1.0, 0.0
    for _ in range(100):
        v -= dt * k * x
        x += dt * v
    control = 0.5 * v * v + 0.5 * k * x * x
    scene = _kicked("symplectic_euler", 0.005)
    kept = _energy_left(scene)
    return (
        f"explicit steps 2.5 % beyond the limit: {control / 0.5:.0e} times the energy after 100 steps",
        f"symplectic Euler divides its steps: {kept:.2f} of the energy left after 0.5 s in steps of 5 ms",
        control > 1e6 and 0.8 < kept < 1.2,
        "test_fem_integrators.py::test_symplectic_euler_divides_steps_beyond_its_limit",
    )


def energy_drift() -> Answer:
    """A kicked cube, half a second."""
    bad, good = _energy_left(_kicked("implicit_euler", 0.001)), _energy_left(_kicked("midpoint", 0.001))
    return (
        f"implicit Euler keeps {percent(bad)} of a free oscillation's energy over 0.5 s (steps of 1 ms)",
        f"midpoint: {100.0 * good:.2f} % of it",
        bad < 0.5 and abs(good - 1.0) < 0.01,
        "test_fem_integrators.py::test_energy_of_a_free_oscillation",
    )


def _kicked(integrator: str, step: float) -> dict[str, Any]:
    """A cube clamped at its base, thrown sideways."""
    scene = press(2e4, step, FEM)
    scene |= {"tools": {}, "motion": [], "duration": 0.5, "quantities": []}
    scene["body"] |= {"velocity": [0.1, 0, 0], "fixed": [{"min": [-1, -1, -1], "max": [1, 1, -0.00999]}]}
    scene["models"][FEM] = {"integrator": integrator}
    return scene


def _energy_left(scene: dict[str, Any]) -> float:
    """Energy at the end (mean of the last quarter) over that at the start [1]."""
    trace = follow(scene, lambda observation: observation.energies["kinetic"] + observation.energies["strain"])
    return trace.value / trace.values[0]


PREFIX = "pitfall"
"""of the files' names"""


@dataclass(frozen=True)
class Row:
    """One pitfall."""

    name: str
    control: str
    """what was done wrong, and the figure of it"""
    remedy: str
    """what is done here, and its figure"""
    holds: bool
    """whether the control failed and the remedy held"""
    test: str
    """the test that keeps it so"""


def rows_json(rows: Sequence[Row]) -> list[dict[str, Any]]:
    return [asdict(row) for row in rows]


PITFALLS: dict[str, Callable[[], tuple[str, str, bool, str]]] = {
    "Locking": locking,
    "Hourglassing": hourglass,
    "Negative Jacobian": negative_jacobian,
    "Order of constraints": constraint_order,
    "Stiffness follows iterations": counted_iterations,
    "Mass of the deformed volume": mass,
    "Stress that is no derivative": closed_cycle,
    "Linear strain in a large turn": large_rotation,
    "Courant's limit": courant,
    "Energy drift": energy_drift,
}


def pitfalls(store: Store) -> list[Row]:
    """Measure every pitfall, or read what was measured before."""
    rows = []
    for name, measure in PITFALLS.items():
        key = _key(name)
        data = store.read(key)
        if data is None:
            control, remedy, holds, test = measure()
            data = asdict(Row(name, control, remedy, holds, test))
            store.write(key, data)
        rows.append(Row(**data))
    return rows


def kept_pitfalls(store: Store) -> list[Row]:
    """What was measured before; none where a pitfall is missing, spoilt or of other code."""
    try:
        found = [store.read(_key(name)) for name in PITFALLS]
    except BadInput:
        return []
    return [Row(**data) for data in found if data is not None] if None not in found else []


def _key(name: str) -> str:
    return f"{PREFIX}-" + name.lower().replace(" ", "-").replace("'", "")
