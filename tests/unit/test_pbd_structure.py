"""The structure of a PBD region is shared by bodies that differ in numbers alone, and gives them the same bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pbd_run import Floats, block_scene

from softseam_protocol.scene.scene import Scene
from softseam_services.body.build import build_body
from softseam_services.body.region import build_region
from softseam_services.pbd.block_parameters import build_block_parameters
from softseam_services.pbd.kernels import summary as k
from softseam_services.pbd.model import Layout, PbdModel, build_model, lay_out, model_of
from softseam_services.pbd.parameters import PbdParameters, build_parameters
from softseam_services.pbd.records import PbdState, new_state
from softseam_services.pbd.step import StepInputs, StepScratch, step
from softseam_services.structures import Structures
from softseam_services.tools.build import build_tools
from softseam_services.tools.motion import tool_motion

pytestmark = pytest.mark.kernels

Known = Structures[Layout, PbdModel]
SIZE, CELL = (0.06, 0.04, 0.04), 0.02
GROUND = {"kind": "plane", "friction": 0.6}
PAD = {"kind": "box", "size": (0.02, 0.03, 0.01), "position": (0.0, 0.0, 0.0449), "friction": 0.6}
PLAIN: dict[str, Any] = {
    "size": SIZE,
    "cell": CELL,
    "young": 20e3,
    "poisson": 0.4,
    "density": 1050.0,
    "gravity": (0.0, 0.0, -9.81),
    "tools": {"ground": GROUND, "pad": PAD},
    "pbd": {},
}
GRADED = {"shape": {"kind": "block", "size": SIZE, "grading": 2.0}}


def scaled(factor: float) -> dict[str, Any]:
    """All lengths times a factor."""
    pad = {name: tuple(factor * x for x in PAD[name]) for name in ("size", "position")}  # type: ignore[attr-defined]
    return {
        "size": tuple(factor * x for x in SIZE),
        "cell": factor * CELL,
        "tools": {"ground": GROUND, "pad": {**PAD, **pad}},
    }


NUMBERS: dict[str, dict[str, Any]] = {
    "modulus": {"young": 50e3},
    "ratio": {"poisson": 0.3},
    "density": {"density": 900.0},
    "gravity": {"gravity": (1.0, 0.0, -3.0)},
    "friction": {"tools": {"ground": GROUND, "pad": {**PAD, "friction": 0.1}}},
    "damping": {"pbd": {"damping": {"stiffness": 2e-3, "mass": 1.0}}},
    "scale": scaled(2.0),
    "any scale": scaled(1.3),
    "sweeps": {"pbd": {"sweeps": 2}},
    "law": {"kind": "corotated"},
    "clamped": {"fixed": ({"min": (-1.0, -1.0, -1.0), "max": (-0.0299, 1.0, 1.0)},)},
}
OTHERS: dict[str, dict[str, Any]] = {
    "cells": {"cell": 0.01},
    "size": {"size": (0.08, 0.04, 0.04)},
    "coarse": {"pbd": {"coarse": {"boxes": [{"min": (-1.0, -1.0, -1.0), "max": (0.0, 1.0, 1.0)}]}}},
    "shape of cells": {"body": GRADED},
    "inclusion": {
        "body": {
            "inclusions": [
                {
                    "shape": {"kind": "box", "size": (0.02, 0.04, 0.04), "position": (0.0, 0.0, 0.02)},
                    "material": {"young": 1e5, "poisson": 0.4, "density": 1050},
                }
            ]
        }
    },
    "one tool": {"tools": {"ground": GROUND}},
    "no edge": {"tools": {"ground": GROUND, "pad": {**PAD, "size": (0.1, 0.1, 0.01)}}},
}


def scene_of(**changes: Any) -> Scene:
    return block_scene(**{**PLAIN, **changes})


class Case:
    """A scene's body, region and tools."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.spec = scene, scene.models.pbd
        self.body = build_body(scene, {})
        self.tools = build_tools(scene)
        cells = np.arange(self.body.n_cells, dtype=np.int32)
        self.region = build_region(self.body, cells, np.zeros(0, dtype=np.int32))

    def structure(self, known: Known) -> PbdModel:
        return known.find(lay_out(self.body, self.region, self.tools, self.spec))

    def parameters(self, model: PbdModel) -> PbdParameters:
        return build_parameters(model, self.body, self.region, self.tools, self.spec)

    def start(self, model: PbdModel) -> PbdState:
        """At rest, where it is not in equilibrium with gravity."""
        state = new_state(model.n_nodes, model.blocks.n_batches, model.n_points, model.n_tools)
        state.x[:] = self.body.x_rest
        state.monitor[6] = 1.0
        return state

    def inputs(self) -> StepInputs:
        velocity = np.zeros((len(self.tools.names), 6))
        velocity[-1, 0], velocity[-1, 2] = 0.02, -0.05
        motion = tool_motion(self.tools.position, self.tools.orientation, velocity, self.scene.step)
        return StepInputs(motion, np.zeros((0, 3)))


def taken(case: Case, model: PbdModel, scratch: StepScratch | None = None) -> tuple[Floats, Floats]:
    """State and figures after two steps."""
    parameters, dt = case.parameters(model), case.scene.step
    scratch = StepScratch(model, parameters, dt) if scratch is None else scratch
    state = case.start(model)
    for _ in range(2):
        before = state
        state, result = step(model, parameters, before, case.inputs(), dt, scratch)
        scratch.next = before
    return state.buffer.copy(), result.figures.copy()


@pytest.mark.parametrize("name", NUMBERS)
def test_bodies_that_differ_in_numbers_share_a_structure_and_its_bits(name: str) -> None:
    known = Known(model_of)
    model = Case(scene_of()).structure(known)
    other = Case(scene_of(**NUMBERS[name]))
    assert other.structure(known) is model
    alone = build_model(other.body, other.region, other.tools, other.spec)
    assert alone is not model
    for mine, theirs in zip(taken(other, model), taken(other, alone), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    plain = taken(Case(scene_of()), model)
    assert not np.array_equal(plain[0], taken(other, model)[0]), "the number does something"


@pytest.mark.parametrize("name", OTHERS)
def test_bodies_that_differ_in_structure_do_not_share_one(name: str) -> None:
    known = Known(model_of)
    model = Case(scene_of()).structure(known)
    assert Case(scene_of(**OTHERS[name])).structure(known) is not model
    assert Case(scene_of()).structure(known) is model


def test_a_step_takes_other_parameters_as_they_come() -> None:
    """On one structure and one scratch, now these numbers and now those: bits as on a scratch of their own."""
    cases = [Case(scene_of()), Case(scene_of(**NUMBERS["modulus"])), Case(scene_of(**NUMBERS["damping"]))]
    model = cases[0].structure(Known(model_of))
    scratch = StepScratch(model, cases[0].parameters(model), 0.005)
    for case in (*cases, cases[0]):
        for mine, theirs in zip(taken(case, model, scratch), taken(case, model), strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_a_step_leaves_the_state_that_it_starts_from() -> None:
    case = Case(scene_of())
    model = case.structure(Known(model_of))
    parameters = case.parameters(model)
    state = case.start(model)
    before = state.buffer.copy()
    after, result = step(model, parameters, state, case.inputs(), 0.005, StepScratch(model, parameters, 0.005))
    assert result.fault.why == "" and result.to_plan and result.n_substeps == parameters.substeps(0.005)
    np.testing.assert_array_equal(state.buffer, before)
    assert after is not state and result.figures[k.KINETIC] > 0.0
    kinetic = 0.5 * parameters.arrays.mass @ (after.v**2).sum(axis=1)
    assert result.figures[k.KINETIC] == pytest.approx(kinetic, rel=1e-12)


@pytest.mark.parametrize("name", ["plain", "shape of cells", "inclusion", "coarse"])
def test_some_of_the_blocks_have_the_numbers_of_the_whole(name: str) -> None:
    """Taken from all blocks' numbers, those of some are what these blocks would be given from the body, to the bit."""
    case = Case(scene_of(**OTHERS.get(name, {})))
    model = case.structure(Known(model_of))
    part = model.blocks.only(model.blocks.ids[3::2])
    assert 0 < len(part.ids) < len(model.blocks.ids) and (part.octant < 0).any()
    whole = case.parameters(model).blocks
    taken_out = whole.only(model.blocks, part)
    built = build_block_parameters(part, case.body, case.region, case.spec.hourglass)
    np.testing.assert_array_equal(taken_out.volume, built.volume)
    np.testing.assert_array_equal(taken_out.constants.table, built.constants.table)
    np.testing.assert_array_equal(taken_out.constants.number, built.constants.number)
