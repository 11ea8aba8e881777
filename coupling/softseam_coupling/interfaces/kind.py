"""What a kind of interface between two bodies brings: rows, made anew as each step begins."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Ids = NDArray[np.int64]
Mask = NDArray[np.bool_]
Pair = tuple[Floats, Floats]
"""of the nodes of the first body and of the second (n_a, 3), (n_b, 3)"""

__all__ = ["Kind", "Meeting", "Rows", "Surface"]

_NONE, _NO_ROWS = np.zeros(0), np.zeros((0, 3))


class Surface(Protocol):
    """A closed surface of p points that follow nodes of a body, of which s may move, t triangles between some of
    them."""

    @property
    def nodes(self) -> Ints:
        """That the points follow, ascending, but for those that are clamped (s,)."""

    @property
    def weights(self) -> csr_array:
        """By which they do (p, s) [1]."""

    @property
    def triangles(self) -> Ints:
        """Points, counter-clockwise from outside (t, 3)."""

    @property
    def area(self) -> Floats:
        """That each point stands for (p,) [m^2]."""

    @property
    def among(self) -> Ints:
        """Patches into which each may be gathered, around places of nodes (p, k), below `n_patches`."""

    @property
    def part(self) -> Floats:
        """And how much it is of each, by how near (p, k) [1]."""

    @property
    def n_patches(self) -> int:
        """How many these are."""

    @property
    def upon(self) -> Ints:
        """Corners between which each point is, whose normals make its own (p, 3)."""

    @property
    def upon_share(self) -> Floats:
        """And their shares (p, 3) [1]."""

    @property
    def rounded(self) -> Mask:
        """Whether the surface is smooth around each corner of a triangle: between such corners normals go over into one
        another, at others the triangle has its own (t, 3)."""

    @property
    def through_cells(self) -> bool:
        """Whether it runs through cells, in place of along their faces."""

    @property
    def spacing(self) -> float:
        """Of the nodes [m]."""

    @property
    def yields(self) -> float:
        """How far it sinks in under a pressure [m/Pa]."""

    def places(self, x: Floats) -> Floats:
        """Of the points, with the nodes at x (s, 3) [m] (p, 3)."""

    def within(self, triangle: Ids, share: Floats) -> tuple[csr_array, Floats]:
        """Weights (q, s) by which places in these triangles (q,), with shares (q, 3) in their corners, follow the
        nodes, and what clamped nodes add (q, 3) [m]."""


@dataclass(frozen=True)
class Meeting:
    """A body as an interface meets it: N nodes."""

    x_rest: Floats
    """(N, 3) [m]"""
    fixed: Mask
    """clamped ones, which no interface moves (N,)"""
    surface: Callable[[], Surface] | None = None
    """what makes it; None of a body that has none for others"""
    forces_at_end: bool = True
    """whether its model's contact forces act as a step ends, see `MODELS`"""


@dataclass(frozen=True)
class Rows:
    """The conditions of a step: c rows on n_a and n_b nodes,

        g = w_a x_a - w_b x_b - offset + C lambda = 0,                                                            (1)

    whose multipliers lambda are forces on the first body [N]. A row without compliance C is a constraint; one with
    C = 1/k a spring of stiffness k; one with a normal n presses the bodies apart, along n alone, where n . g would be
    negative otherwise, and with friction mu also across it, by no more than mu times that, against how it slides."""

    weights: Pair
    """w_a (c, n_a) and w_b (c, n_b) [1]"""
    offset: Floats
    """(c, 3) [m]"""
    compliance: Floats = field(default_factory=lambda: _NONE)
    """C of each row (c,) [m/N]; empty: none"""
    normal: Floats = field(default_factory=lambda: _NO_ROWS)
    """unit vectors from the second body to the first (c, 3) [1], zero of rows that hold; empty: all hold"""
    friction: Floats = field(default_factory=lambda: _NONE)
    """mu of rows that press (c,) [1]; empty: none"""
    ids: Ids | None = None
    """names of rows that come and go, each once in a step, 0 and more (c,): a row's multiplier is predicted by what it
    was under its id; None: rows are as many in every step"""


class Kind(Protocol):
    """One interface, for one run. Built from its specification and both bodies. Rows with ids may be others in each
    step, or none."""

    nodes: tuple[Ints, Ints]
    """the nodes of each body that it acts on, ascending, none of them clamped (n_a,), (n_b,)"""

    def rows(self, x: Pair, dt: float) -> Rows:
        """The rows of a step of dt [s] that begins with the nodes at x [m]; asked again where it is taken again."""

    def commit(self, x: Pair, multipliers: Floats, dt: float) -> None:
        """The step came to x [m] under these multipliers (c, 3) [N] of the rows that it made last."""

    def save(self) -> dict[str, Floats]:
        """Everything that evolves, for a snapshot."""

    def load(self, arrays: Mapping[str, Floats]) -> None:
        """Continue from `save`. Raises KeyError or ValueError where these are of others."""
