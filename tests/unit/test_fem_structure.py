"""Bodies that differ in numbers alone share one structure, and what is solved on it has the same bits as ever."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, block

from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.fem.inputs import StepInputs, at_rest, moved
from softseam_services.fem.parameters import build_parameters
from softseam_services.fem.region_tables import RegionTables
from softseam_services.fem.solver import FemSolver
from softseam_services.fem.step import Stepper
from softseam_services.fem.structures import FemStructures, Tables, no_structures

pytestmark = pytest.mark.kernels

STEPS = 6


def squeezed(
    size: float = 1.0, friction: float = 0.6, plate: float = 0.08, counts: int = 2, time: float = 0.0, **keys: Any
) -> Scene:
    """A cube on the ground between two plates that stand clear of it, `size` times 5 cm, of counts^3 cells."""
    box = {"kind": "box", "size": (0.01 * size, plate * size, plate * size), "friction": friction}
    tools = {
        "ground": {"kind": "plane", "friction": friction},
        "left": {**box, "position": (-0.0301 * size, 0.0, 0.03 * size)},
        "right": {**box, "position": (0.0301 * size, 0.0, 0.03 * size)},
    }
    edge = 0.05 * size
    scene = block((edge, edge, edge), edge / counts, tools=tools, step=0.005, **keys)
    assert isinstance(scene.body, BodySpec)
    material = scene.body.material.model_copy(update={"retardation_time": time})
    return scene.with_body(scene.body.model_copy(update={"material": material}))


def tables_of(run: FemRun, structures: FemStructures) -> RegionTables:
    return RegionTables(run.body, run.region, run.tools, run.scene, structures)


def taken(run: FemRun) -> FemRun:
    """After some steps in which the plates reach the cube and press it."""
    for _ in range(STEPS):
        run.step(CLOSE)
    return run


NUMBERS: list[dict[str, Any]] = [
    {"young": 35e3},
    {"poisson": 0.3},
    {"density": 700.0},
    {"gravity": (1.0, 0.0, -5.0)},
    {"friction": 0.2},
    {"time": 0.01},
    {"size": 1.7},
    {"young": 50e3, "poisson": 0.4, "density": 900.0, "friction": 0.9, "size": 0.6},
]


@pytest.mark.parametrize("element", ["hex27", "hex8_bbar"])
@pytest.mark.parametrize("numbers", NUMBERS, ids=lambda numbers: "+".join(numbers))
def test_a_body_of_other_numbers_has_the_same_structure_and_bits(numbers: dict[str, Any], element: str) -> None:
    models = {"fem": {"element": element, "tolerance": 1e-7}}
    structures = no_structures()
    first = tables_of(FemRun(squeezed(models=models)), structures).whole
    alone = FemRun(squeezed(models=models, **numbers))
    other = FemRun(squeezed(models=models, **numbers))
    tables = tables_of(other, structures)
    other.solver = FemSolver(other.scene, other.body, other.region, other.tools, tables=tables)
    assert tables.whole.model is first.model
    assert differ(first, tables.whole)
    start = alone.x.copy()
    taken(alone)
    taken(other)
    assert np.abs(alone.x - start).max() > 1e-5
    for name in ("x", "v", "contact"):
        np.testing.assert_array_equal(getattr(alone.solver.state, name), getattr(other.solver.state, name))


def differ(one: Tables, other: Tables) -> bool:
    """Whether their numbers do."""
    a, b = vars(one.parameters), vars(other.parameters)
    plain = [name for name, value in a.items() if isinstance(value, np.ndarray | float) and not name.startswith("_")]
    return not all(np.array_equal(a[name], b[name]) for name in plain)


def test_a_structure_found_again_equals_one_built_anew() -> None:
    """Every array of it, the order of elimination included."""
    structures = no_structures()
    tables_of(FemRun(squeezed()), structures).whole  # noqa: B018  it is built when asked for
    run = FemRun(squeezed(young=1e3, size=0.3))
    found, anew = tables_of(run, structures).whole.model, run.solver.tables.whole.model
    assert found is not anew
    for one, other in ((found, anew), (found.tree, anew.tree), (found.joints, anew.joints)):
        names = [name for name in vars(one) if not name.startswith("_") and name not in ("tree", "joints")]
        assert len(names) > 12
        for name in names:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@pytest.mark.parametrize(
    "change",
    [
        {"counts": 3},
        {"models": {"fem": {"element": "hex8"}}},
        {"kind": "linear"},
        {"body": {"fixed": [{"min": (-1.0, -1.0, -1.0), "max": (1.0, 1.0, 1e-6)}]}},
        {"plate": 0.03},
    ],
    ids=["cells", "element", "law", "clamp", "edges"],
)
def test_another_structure_is_not_shared(change: Mapping[str, Any]) -> None:
    structures = no_structures()
    first, run = tables_of(FemRun(squeezed()), structures).whole, FemRun(squeezed(**change))
    other = tables_of(run, structures).whole
    assert other.model is not first.model
    assert tables_of(FemRun(squeezed()), structures).whole.model is first.model


def test_parameters_of_another_structure_are_refused() -> None:
    run, other = FemRun(squeezed()), FemRun(squeezed(counts=3))
    with pytest.raises(ValueError, match="other nodes than the structure says"):
        build_parameters(run.solver.tables.whole.model, other.body, other.region, other.tools)


def test_a_step_is_of_structure_parameters_state_and_inputs() -> None:
    """One stepper takes a step with two sets of parameters: the state that it begins with stays, and each end has the
    bits of a stepper that never saw the other set."""
    run = taken(FemRun(squeezed()))
    model, soft = run.solver.tables.whole
    stiff_body = build_body(squeezed(young=80e3), {})
    stiff = build_parameters(model, stiff_body, run.region, run.tools, run.scene.models.fem)
    state = run.solver.state.copy()
    before = state.copy()
    request = run.request(CLOSE)
    inputs = StepInputs.of(request, moved(at_rest(run.tools), request.tools))

    def stepper() -> Stepper:
        return Stepper(run.scene.models.fem, model, soft, len(run.tools.names))

    one = stepper()
    ends = []
    for parameters in (soft, stiff, soft):
        end, result = one.step(model, parameters, state, inputs, request.dt)
        assert result.status == 0
        alone, told = stepper().step(model, parameters, state, inputs, request.dt)
        np.testing.assert_array_equal(end.x, alone.x)
        np.testing.assert_array_equal(result.arrays.wrench, told.arrays.wrench)
        ends.append(end)
    np.testing.assert_array_equal(ends[0].x, ends[2].x)
    assert np.abs(ends[0].x - ends[1].x).max() > 1e-7
    for name in ("x", "v", "contact"):
        np.testing.assert_array_equal(getattr(state, name), getattr(before, name))
