"""What FEM's regions were computed with is kept for the next that is the same, and no run writes to it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from softseam.variants import with_settings
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Advance, Configure, ToolMotion
from softseam_protocol.scene.file import bundle_scene, load_scene
from softseam_services.body.body import Body
from softseam_services.body.region import build_region
from softseam_services.built import Built
from softseam_services.fem import model, region_tables, symmetry
from softseam_services.fem.dissection import dissect
from softseam_services.fem.mesh_error import MeshError
from softseam_services.fem.region_tables import RegionTables
from softseam_services.fem.structures import Tables, build_tables
from softseam_services.fem.tree import Tree
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.server import build_setup, build_solver

pytestmark = pytest.mark.kernels

SCENES = Path(__file__).parents[2] / "scenes"
BEFORE = ["motion.0.hold=0.02"]
"""so that the plates of tofu_grasp are near after 34 steps and touch it after 60"""


def arrays(tables: Tables) -> dict[str, NDArray[np.generic]]:
    """All arrays of records, and of records within them."""
    found: dict[str, NDArray[np.generic]] = {}
    records = [(str(number), record) for number, record in enumerate(tables)]
    while records:
        name, record = records.pop()
        for key, value in vars(record).items():
            if isinstance(value, np.ndarray):
                found[f"{name}.{key}"] = value
            elif hasattr(value, "_declared"):
                records.append((f"{name}.{key}", value))
    return found


@pytest.mark.parametrize("split", ["when_cheaper", "always"])
def test_an_episode_builds_no_region_that_was_there_before(split: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One body from the start, and one that is cut in each episode: the same numbers as in the first, from the tables
    that were built for it, whose bytes stay as they were."""
    built: list[Tables] = []
    indicators: list[MeshError] = []
    copies: list[dict[str, NDArray[np.generic]]] = []

    def counted(*arguments: object, **named: object) -> Tables:
        built.append(build_tables(*arguments, **named))  # type: ignore[arg-type]
        copies.append({name: array.copy() for name, array in arrays(built[-1]).items()})
        return built[-1]

    def measured(*arguments: object) -> MeshError:
        indicators.append(MeshError(*arguments))  # type: ignore[arg-type]
        return indicators[-1]

    for module in (region_tables, symmetry):
        monkeypatch.setattr(module, "build_tables", counted)
    monkeypatch.setattr(region_tables, "MeshError", measured)
    scene = with_settings(
        load_scene(SCENES / "tofu_grasp.yaml").scene, [*BEFORE, f"regions.near.split={split}", "symmetry=[y]"]
    )
    simulation = Simulation(bundle_scene(scene, {}), EmbeddedTransport())
    episodes, estimates = [], []
    for episode in range(3):
        if episode:
            simulation.reset()
        reports = [simulation.step() for _ in range(80)]
        estimates.append(simulation.estimate())
        episodes.append(np.concatenate([report.wrench.ravel() for report in reports]))
    simulation.close()
    assert len(indicators) == 1 and estimates[0] is not None and estimates[0] == estimates[1] == estimates[2]
    assert len(built) == {"when_cheaper": 2, "always": 1}[split]  # what is solved for is a half, and all is read
    assert all(np.array_equal(episodes[0], each) for each in episodes[1:]) and np.abs(episodes[0]).max() > 1.0
    for tables, copy in zip(built, copies, strict=True):
        assert len(copy) > 60
        for name, array in arrays(tables).items():
            np.testing.assert_array_equal(array, copy[name], err_msg=name)


def test_four_regions_are_kept_each_of_its_body() -> None:
    setup = build_setup(load_scene(SCENES / "tofu_grasp.yaml").bundle)
    other = build_setup(load_scene(SCENES / "tofu_grasp.yaml").bundle)
    assert isinstance(setup.body, Body) and isinstance(other.body, Body)
    bundle, none = load_scene(SCENES / "tofu_grasp.yaml").bundle, np.zeros(0, dtype=np.int32)

    def asked(n_cells: int) -> Configure:
        cells = np.arange(n_cells, dtype=np.int32)
        return Configure(Header(SCHEMA_VERSION, "s", "near", 0, 0, 0, 0.0), bundle, "fem", cells, none, None, True)

    region = build_region(setup.body, asked(12).cells, none)
    tables = RegionTables(setup.body, region, setup.tools, setup.scene)
    kept = Built()
    for n_cells in range(1, 6):
        kept.keep(setup.body, asked(n_cells), tables)
    assert [kept.find(setup.body, asked(n)) is tables for n in range(1, 6)] == [False, True, True, True, True]
    assert kept.find(other.body, asked(5)) is None
    assert not any(kept.find(each, asked(6)) for each in (setup.body, other.body))


@pytest.mark.parametrize("symmetry", ["[]", "[y]"])
def test_a_scene_of_other_numbers_orders_no_unknowns_anew(symmetry: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another modulus, friction and density of the same cube: the server finds its structure, whole or halved, and
    solves as one that has seen no other scene."""
    ordered: list[int] = []

    def counted(cell_nodes: NDArray[np.int32], *others: Any) -> Tree:
        ordered.append(len(cell_nodes))
        return dissect(cell_nodes, *others)

    monkeypatch.setattr(model, "dissect", counted)
    scene, none = load_scene(SCENES / "tofu_grasp.yaml").scene, np.zeros(0, dtype=np.int32)
    changes = ["body.material.young=33e3", "tools.left.friction=0.3", "body.material.density=900"]
    built, forces = Built(), []
    for settings, kept in (([], built), (changes, built), (changes, Built())):
        bundle = bundle_scene(with_settings(scene, [f"symmetry={symmetry}", *settings]), {})
        setup = build_setup(bundle)
        assert isinstance(setup.body, Body)
        cells = np.arange(setup.body.n_cells, dtype=np.int32)
        header = Header(SCHEMA_VERSION, "s", "near", 0, 0, 0, 0.0)
        solver, _ = build_solver(setup, Configure(header, bundle, "fem", cells, none, None, True), kept)
        tools = ToolMotion(*(setup.tools.position, setup.tools.orientation) * 2)
        reply = solver.advance(Advance(header, 0.005, np.zeros((0, 3)), tools))
        forces.append(reply.wrench)
    assert len(ordered) == 2
    np.testing.assert_array_equal(forces[1], forces[2])
    assert not np.array_equal(forces[0], forces[1])
