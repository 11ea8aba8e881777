"""A coupling loop from outside: Robin on one part, Neumann on the other.

Part b goes under -lambda, part a is solved with a spring S that draws it to where b went, and what the spring bears
is taken over: lambda <- lambda + S (x_b - x_a), until the gap is closed. An error of lambda becomes
(1 - S H_b)/(1 + S H_a) times itself (Badia, Nobile and Vergara, J. Comput. Phys. 227, 2008, 7027-7051).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import softseam
from softseam_coupling.loops import LOOPS
from softseam_coupling.loops.coupled_part import gap_of, parts_of
from softseam_coupling.loops.loop import Ask, Correct, LoopSetup, Outcome, PartRequest, StepRefused, Unsuited, largest
from softseam_protocol.messages.participant import Capabilities
from softseam_protocol.scene import kinds
from softseam_protocol.scene.file import SceneError, parse_scene

Floats = NDArray[np.float64]


class RobinNeumann:
    def __init__(self, setup: LoopSetup) -> None:
        if len(setup.interfaces) != 1 or len(setup.mobility) != 2:
            raise Unsuited("robin_neumann couples two parts at one interface: use seam: {scheme: position}")
        self.setup, (self.a, self.b) = setup, setup.interfaces[0].parts
        self.parts, self.offset = parts_of(setup.interfaces, {name: len(m) for name, m in setup.mobility.items()})
        self.lambda_ = np.zeros_like(self.offset) if setup.first is None else setup.first

    def begin(self, capabilities: Mapping[str, Capabilities]) -> None:
        if not capabilities[self.a].impedance:
            raise Unsuited(f"robin_neumann: part {self.a!r} takes no impedance")

    def multipliers(self) -> Floats:
        return self.lambda_

    def solve(self, ask: Ask, correct: Correct, dt: float, may_refuse: bool = False) -> Outcome:
        spring = np.diag(np.repeat(1.0 / (dt * dt * self.setup.mobility[self.b]), 3))
        lambda_, parts = self.lambda_, self.parts
        for exchange in range(1, self.setup.exchanges + 1):
            replies = ask({self.b: PartRequest(parts[self.b].force(lambda_))})
            target = self.offset - parts[self.b].to_rows(replies[self.b].coupling.x)
            replies |= ask({self.a: PartRequest(lambda_, target=target, impedance=spring)})
            gap = gap_of(parts, {name: reply.coupling.x for name, reply in replies.items()}, self.offset)
            lambda_ = replies[self.a].coupling.force
            if largest(gap) <= self.setup.tolerance:
                self.lambda_ = lambda_
                return Outcome(replies, lambda_, largest(gap), 2 * exchange)
        raise StepRefused(2 * self.setup.exchanges)

    def forget_sent(self) -> None: ...

    def to_arrays(self) -> dict[str, Floats]:
        return {"lambda": self.lambda_}

    def take(self, arrays: Mapping[str, Floats]) -> None:
        self.lambda_ = arrays["lambda"]


@pytest.fixture(autouse=True)
def rows() -> Iterator[None]:
    kinds.SCHEMES.add("robin_neumann", kinds.SchemeFacts(like="position"))
    LOOPS.add("robin_neumann", RobinNeumann)
    yield
    kinds.SCHEMES.remove("robin_neumann")
    LOOPS.remove("robin_neumann")


def scene(seam: str) -> Any:
    return parse_scene(f"""
softseam: 1
name: beam
step: 0.001
duration: 0.05
body:
  shape: {{kind: block, size: [0.12, 0.02, 0.02]}}
  cell: 0.02
  fixed: [{{min: [-0.061, -1, -1], max: [-0.059, 1, 1]}}]
  material: {{young: 2.0e5, poisson: 0.3, density: 1000}}
regions: {{default: pbd, near: {{model: fem, boxes: [{{min: [-1, -1, -1], max: [0.001, 1, 1]}}]}}}}
seam: {seam}
quantities: [tip_deflection]
""")


def fall(seam: str) -> tuple[float, float, float]:
    """Where the beam's tip is in the end, the largest gap over a cell, and exchanges a step."""
    with softseam.open(scene(seam)) as sim:
        sim.reset()
        seen = [sim.step() for _ in range(50)]
    gaps, exchanges = [one.seam.gap / 0.02 for one in seen], [one.seam.exchanges for one in seen]
    return seen[-1].quantities["tip_deflection"], max(gaps), float(np.mean(exchanges))


def test_a_beam_falls_under_what_came_from_outside_as_by_default() -> None:
    tip, gap, exchanges = fall("{scheme: robin_neumann, tolerance: 3.0e-5, exchanges: 200}")
    default, _, fewer = fall("{}")
    assert tip == pytest.approx(default, rel=2e-4) and tip < -0.005
    assert gap <= 3e-5
    assert exchanges > 1.5 * fewer  # it does not ask how parts yield


def test_a_name_without_its_row_is_refused_where_it_stands_or_at_start() -> None:
    with pytest.raises(SceneError, match=r'"robin_neuman" is not in the table of seam schemes; did you mean'):
        scene("{scheme: robin_neuman}")
    LOOPS.remove("robin_neumann")
    with pytest.raises(softseam.BadInput, match="table of coupling loops: no row 'robin_neumann'"):
        softseam.open(scene("{}"))
    LOOPS.add("robin_neumann", RobinNeumann)
