"""What a ladder cannot do yet is refused by name, before anything runs; tests/extensions/test_rung.py climbs one."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import pytest

import softseam
from softseam_coupling import ladder
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Failure, Release, Reply, Request
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.ladder import RUNGS, RungSpec
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.transport import ParticipantFailed


class FineSpec(RungSpec):
    kind: Literal["fine"] = "fine"
    after: float = 0.0


class Fine:
    """Smaller cells, from a time on."""

    def __init__(self, spec: FineSpec) -> None:
        self.spec = spec

    def holds(self, body: ladder.Standing) -> bool:
        return body.time >= self.spec.after

    def body(self, spec: Any) -> Any:
        return spec.model_copy(update={"cell": 0.5 * spec.cell})

    def carry(self, old: ladder.Discretised, new: ladder.Discretised) -> Any:
        raise RuntimeError("the rung is broken")


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    RUNGS.add("fine", FineSpec)
    ladder.RUNGS.add("fine", Fine)
    yield
    RUNGS.remove("fine")
    ladder.RUNGS.remove("fine")


def scene(rungs: list[dict[str, Any]], named: bool = False, **keys: Any) -> Scene:
    body = {
        "shape": {"kind": "block", "size": [0.04] * 3},
        "cell": 0.04,
        "material": {"young": 1e4, "poisson": 0.3, "density": 1000.0},
        "ladder": rungs,
    }
    data = {"softseam": 1, "name": "ladder", "step": 0.01, "duration": 0.1, "regions": {"default": "fem"}}
    data |= {"bodies": {"block": body}} if named else {"body": body}
    return Scene.model_validate(json.loads(json.dumps(data | keys)))


PLATES = {
    name: {"kind": "box", "size": [0.01, 0.1, 0.1], "position": [x, 0, 0.02]}
    for name, x in (("left", -0.03), ("right", 0.03))
}
CLOSE = [{"tools": ["left", "right"], "close": 0.01, "until": {"time": 0.1}}]
REFUSED: dict[str, tuple[list[dict[str, Any]], dict[str, Any], str]] = {
    "no rung": ([{"kind": "fine", "after": 0.05}], {}, "has no rung for it at 0 s"),
    "closing": ([{"kind": "fine"}], {"tools": PLATES, "motion": CLOSE}, "tools that close measure bodies whose cells"),
    "near": (
        [{"kind": "fine"}],
        {"regions": {"default": "pbd", "near": {"model": "fem", "within": 0.01}}},
        "cells that have a model of their own stay",
    ),
}


@pytest.mark.kernels
@pytest.mark.parametrize("case", REFUSED)
def test_what_a_ladder_cannot_do_is_refused(case: str) -> None:
    rungs, keys, words = REFUSED[case]
    with pytest.raises(softseam.SceneRefused, match=words):
        softseam.open(scene(rungs, **keys))


def test_a_kind_that_is_not_there_is_named() -> None:
    with pytest.raises(ValueError, match=r"finr|fine"):
        scene([{"kind": "finr"}])
    RUNGS.add("forgotten", FineSpec)
    try:
        with pytest.raises(softseam.BadInput, match="table of rungs: no row 'forgotten'"):
            softseam.open(scene([{"kind": "fine"}]))
    finally:
        RUNGS.remove("forgotten")


def test_it_is_not_recorded(tmp_path: Path) -> None:
    with pytest.raises(softseam.BadInput, match="a recording has one surface a body"):
        softseam.open(scene([{"kind": "fine"}]), record=tmp_path / "ladder.mcap")


@pytest.mark.kernels
def test_a_rung_that_fails_leaves_the_body_where_it_was() -> None:
    """The step raises what the rung raised; the body stands, and is asked as before where the ladder lets it."""
    with softseam.open(scene([{"kind": "fine"}, {"kind": "fine", "after": 0.025}])) as sim:
        sim.reset(seed=0)
        seen = [sim.step() for _ in range(3)]
        for _ in range(2):
            with pytest.raises(RuntimeError, match="the rung is broken"):
                sim.step()
        assert seen[-1].time == pytest.approx(0.03) and seen[-1].momentum[2] < 0.0
        assert sim.snapshot()


class Boxed(Fine):
    """The same cells, all near, so that another part has them; they go on twice as fast."""

    def body(self, spec: Any) -> Any:
        box = {"min": [-1, -1, -1], "max": [1, 1, 1]}
        regions = (
            {"default": "pbd", "near": {"model": "fem", "boxes": [box]}} if self.spec.after else {"default": "fem"}
        )
        return spec.model_copy(update={"regions": RegionsSpec.model_validate(regions)})

    def carry(self, old: ladder.Discretised, new: ladder.Discretised) -> Any:
        return old.x, 2.0 * old.v


class Holding(EmbeddedTransport):
    """It does not let go of parts once."""

    refused = 0

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        if not self.refused and any(isinstance(request, Release) for request in requests.values()):
            self.refused += 1
            raise ParticipantFailed("block.far", Failure(FailureKind.INTERNAL, "not now"))
        return super().exchange(requests)


@pytest.mark.kernels
def test_nothing_is_booked_where_old_parts_are_not_let_go(monkeypatch: pytest.MonkeyPatch) -> None:
    """The body stands with the energies that it had; the next try climbs, and books what twice the speed adds."""
    monkeypatch.setattr("softseam_services.orchestrator.ladder.RUNGS", {"fine": Boxed})
    rungs: list[dict[str, Any]] = [{"kind": "fine"}, {"kind": "fine", "after": 0.025}]
    transport = Holding()
    simulation = Simulation(bundle_scene(scene(rungs, named=True)), transport)
    for _ in range(3):
        simulation.step()
    had = simulation.only.balance.energies
    with pytest.raises(ParticipantFailed, match="not now"):
        simulation.step()
    assert transport.refused == 1 and simulation.only.balance.energies == had
    assert simulation.step().energy["switch"] == pytest.approx(3.0 * had.kinetic, rel=1e-6)
    simulation.close()
