"""Parts of an interface whose answers are known, linear ones and such that err, and a loop that takes their steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from softseam_coupling.interface import Interface
from softseam_coupling.loops.loop import Correction, First, Loop, LoopSetup, Outcome, PartRequest
from softseam_coupling.loops.one_way import OneWay
from softseam_protocol.messages.header import Header
from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.participant import Advanced, Capabilities, Coupled

Floats = NDArray[np.float64]

DT, CELL, TOLERANCE = 0.01, 0.02, 5e-6
NONE, NOWHERE = np.zeros((0, 0)), np.zeros((0, 3))


@dataclass
class Part:
    """Nodes that yield by H: x = free + H f + bend (H f)^2/cell; free moves on by `way` a step."""

    yields: Floats
    free: Floats
    way: Floats
    takes_impedance: bool = False
    bend: float = 0.0
    claims: float = 1.0
    """what it says that it yields by, over what it does"""
    corrects: bool = True
    tells: bool = True
    """its compliance"""
    impedance: Floats = field(default_factory=lambda: NONE)
    told: bool = False
    x: Floats = field(default_factory=lambda: NOWHERE)
    force: Floats = field(default_factory=lambda: NOWHERE)
    asked: int = 0

    def answer(self, force: Floats) -> Floats:
        moved = (self.yields @ force.ravel()).reshape(-1, 3)
        return self.free + moved + self.bend * moved * np.abs(moved) / CELL

    def advance(self, request: PartRequest) -> Advanced:
        self.asked += 1
        self.force, root, told = request.force, NONE, NONE
        if request.impedance is not None:
            self.impedance, self.told = request.impedance, False
        if request.target is not None:  # f = request.force + S (target - x) and x = free + H f
            n = self.free.size
            spring = self.impedance @ (request.target - self.free).ravel()
            self.force = np.asarray(
                np.linalg.solve(np.eye(n) + self.impedance @ self.yields, request.force.ravel() + spring)
            ).reshape(-1, 3)
        self.x = self.answer(self.force)
        if self.takes_impedance:
            if not self.told or request.repeat:
                behind = self.impedance if request.target is not None else np.zeros_like(self.yields)
                root = np.asarray(np.linalg.cholesky(np.linalg.inv(np.linalg.inv(self.yields) + behind)))
                self.told = True
        elif request.renew:
            told = self.claims * self.yields
        return self.reply(root, told)

    def correct(self, correction: Correction) -> Advanced:
        behind = np.linalg.inv(self.yields) + (self.impedance if self.impedance.size else 0.0)
        self.x = self.x + np.linalg.solve(behind, correction.push.ravel()).reshape(-1, 3) * self.claims
        self.force = correction.force
        return self.reply(NONE, NONE)

    def reply(self, root: Floats, told: Floats) -> Advanced:
        header, three = Header(2, "test", "part", 0, 0, 0, 0.0), np.zeros(3)
        return Advanced(
            header, Status.CONVERGED, np.zeros((0, 6)), 0.0, 0.0, 0.0, 0.0, three, three, np.zeros((2, 3)), 0.0,
            np.zeros(0),
            Coupled(self.x.copy(), force=self.force, compliance=told, root=root, correctable=self.corrects),
        )  # fmt: skip


def part(seed: int, n: int = 3, scale: float = 1e-3, **options: object) -> Part:
    """Nodes that yield together, at random."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((3 * n, 3 * n))
    h = scale * (a @ a.T / (3 * n) + 0.3 * np.eye(3 * n))
    return Part(h, np.zeros((n, 3)), 1e-4 * rng.standard_normal((n, 3)), **options)  # type: ignore[arg-type]


def seam(a: str, b: str, n: int = 3, at: tuple[int, int] = (0, 0), weights: Floats | None = None) -> Interface:
    places = tuple(np.arange(first, first + n, dtype=np.int32) for first in at)
    return Interface(f"{a}-{b}", (a, b), (places[0], places[1]), (None, weights), np.zeros((n, 3)))


class Chain:
    """Parts and the loop that takes their steps; replies arrive in an order of choice."""

    def __init__(
        self,
        parts: Mapping[str, Part],
        interfaces: list[Interface],
        backwards: bool = False,
        most: int = 16,
        build: Callable[[LoopSetup], Loop] = OneWay,
        mobility: float = 1.0,
    ) -> None:
        self.parts, self.backwards = dict(parts), backwards
        self.able = {
            name: Capabilities(one.tells, one.corrects, one.takes_impedance, 1, False, False, 0.0)
            for name, one in parts.items()
        }
        by_mass = {name: np.full(len(one.free), mobility) for name, one in parts.items()}
        self.setup = LoopSetup(tuple(interfaces), by_mass, TOLERANCE, CELL, most)
        self.loop = build(self.setup)
        self.loop.begin(self.able)

    def _ordered(self, replies: dict[str, Advanced]) -> dict[str, Advanced]:
        return dict(reversed(replies.items())) if self.backwards else replies

    def step(self, may_refuse: bool = False) -> Outcome:
        for one in self.parts.values():
            one.free = one.free + one.way

        def advance(wanted: dict[str, PartRequest]) -> dict[str, Advanced]:
            return self._ordered({name: self.parts[name].advance(request) for name, request in wanted.items()})

        def correct(wanted: dict[str, Correction], first: First) -> dict[str, Advanced]:
            return self._ordered({name: self.parts[name].correct(one) for name, one in wanted.items()})

        return self.loop.solve(advance, correct, DT, may_refuse)
