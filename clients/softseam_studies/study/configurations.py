"""What a sweep tries: methods on several cells, with several steps, elements, substeps, sweeps and regions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Literal

from softseam.choice import PARTS
from softseam.duration import fem_step, xpbd_step
from softseam_protocol.scene.bodies import block_of
from softseam_protocol.scene.spec import Vector
from softseam_studies.study.frame import Counts, Frame, Grading, is_viscous

Method = Literal["FEM", "FEM, other elements", "XPBD", "PBD", "hybrid", "as it is"]
METHODS: tuple[Method, ...] = ("FEM", "FEM, other elements", "XPBD", "PBD", "hybrid", "as it is")

Factors = tuple[float, ...]

SWIFT = ("hex27", "hex27_reduced")
"""the default element and a softer one of its cost"""
OTHERS = ("hex27_full", "hex8", "hex8_bbar", "tet4", "tet10")
"""elements besides the default: locking cures, low orders, tetrahedra"""
TOWARDS_EDGES = ((4, 1.0, 8), (4, 1.0, 4), (4, 1.5, 4), (6, 1.0, 4), (6, 4.0, 4))
"""cells across whose borders lie at tools' edges, how thin they are there, and the multiple of the scene's step"""
FEW_TOWARDS_EDGES, BY_EDGES, THIN, LONG = (2, 4), 2, 4.0, (8, 4)
"""cells across where a tool presses; in the mean in a piece that tools' edges make of a face; how many times thinner
these are at edges along some axes; the multiples of the scene's step"""
IDLE: tuple[tuple[int, Factors], ...] = ((2, (8, 4, 2)), (3, (6, 4, 2)), (4, (6, 5, 4, 3, 2)))
"""cells across and multiples of the scene's step that are tried with one cell along the axis that nothing acts along,
and with two where half of them is solved for"""

SUBSTEPS = (1, 2, 4, 8, 16, 32, 64, 128)
"""of bodies of particles, a step"""

THINNER = 2.0
"""of few cells, those at the faces may be so much thinner: four then say more than four equal ones, for nothing"""


@dataclass(frozen=True)
class Configuration:
    """One way to simulate the scene: one marker of the chart."""

    key: str
    """names its file"""
    method: Method
    label: str
    settings: tuple[str, ...]
    seconds: float
    """rough wall time of a run [s]: for the order of the sweep and the time left"""
    fem: Fem | None = field(default=None, compare=False, repr=False)
    """what it is made from, where it is FEM alone"""


@dataclass(frozen=True)
class Fem:
    """FEM alone: its cells, step and scheme."""

    frame: Frame
    counts: Counts
    step: float
    """[s]"""
    element: str = "hex27"
    integrator: str = "implicit_euler"
    grading: Grading = 1.0
    """along all axes, or along x, y and z"""
    towards: tuple[str, ...] = ()

    @property
    def seconds(self) -> float:
        """Rough wall time of a run [s]."""
        swift = fem_seconds(self.frame, self.n_solved, self.step)
        return swift if self.element in SWIFT else 2.0 * swift

    @property
    def n_cells(self) -> int:
        """Of the body."""
        return self.frame.n_cells(self.counts)

    @property
    def n_solved(self) -> float:
        """Of these cells those that are solved for."""
        return self.frame.n_solved(self.counts)

    @property
    def family(self) -> tuple[str, str, bool, Vector, tuple[str, ...]]:
        """All but how many cells there are and the step: within it, what is finer takes longer."""
        gradings = self.grading if isinstance(self.grading, tuple) else (self.grading,) * 3
        return self.element, self.integrator, self.frame.follows, gradings, self.towards

    @property
    def cells(self) -> str:
        """Names its cells and scheme, without the step."""
        return f"{self.element} {self.integrator} {cells_named(self.frame, self.counts)}{self._graded}"

    @property
    def _graded(self) -> str:
        along = self.grading if isinstance(self.grading, tuple) else (self.grading,)
        graded = "" if self.grading == 1.0 else f" graded {'x'.join(f'{each:g}' for each in along)}"
        return (" to edges" if self.towards else "") + graded

    @property
    def settings(self) -> tuple[str, ...]:
        """That ask for it."""
        fem = f"models.fem={{element: {self.element}, integrator: {self.integrator}}}"
        cells = self.frame.cells(self.counts, self.grading, self.towards)
        return "regions={default: fem}", *cells, f"step={self.step:.9g}", fem, *self.frame.symmetry(self._axes)

    @property
    def _axes(self) -> tuple[int, ...]:
        """That it solves one side of; tetrahedra are divided otherwise on either side."""
        return () if self.element.startswith("tet") else self.frame.solved_across(self.counts)

    def finer(self) -> Fem:
        """On half as many cells more along each axis, but where one is enough for how free faces bulge."""
        one = (self.frame.idle, self.frame.even)
        return self._with(n if n == 1 and axis in one else n + max(1, n // 2) for axis, n in enumerate(self.counts))

    def cheaper(self) -> Iterator[Fem]:
        """With a longer step, a softer element, fewer cells."""
        yield replace(self, step=2.0 * self.step)
        if self.element == "hex27":
            yield replace(self, element="hex27_reduced")
        yield self._with(max(1, n - max(1, n // 3)) for n in self.counts)

    def _with(self, counts: Iterable[int]) -> Fem:
        x, y, z = counts
        return replace(self, counts=self.frame.folding((x, y, z), self.towards))

    def configuration(self) -> Configuration:
        """As the sweep tries it, and as a reference's level is."""
        named = "" if self.element == "hex27" else f" {self.element}"
        graded = self._graded
        how = "" if self.integrator == "implicit_euler" else f" {self.integrator}"
        method: Method = "FEM" if self.element in SWIFT else "FEM, other elements"
        cells = cells_named(self.frame, self.counts)
        part = f", {PARTS[len(self._axes)]} of it solved for" if self._axes else ""
        label = f"FEM{named} {cells}{graded}, {ms(self.step)}{how}{part}"
        key = f"fem-{self.element}-{self.integrator}-{cells}-{ms(self.step, '')}{graded}".replace(" ", "-")
        return Configuration(key, method, label, self.settings, self.seconds, self)


def configurations(frame: Frame) -> list[Configuration]:
    """The sweep of a scene, cheapest first; cells that two parts of it ask for are taken once."""
    if frame.body.has_cells:
        found = {c.key: c for c in (*_fem(frame), *_xpbd(frame), *_hybrid(frame), *_as_is(frame))}
    else:
        found = {c.key: c for c in (particles(frame, f * frame.scene.step, n) for f in (4, 2, 1) for n in SUBSTEPS)}
    return sorted(found.values(), key=lambda c: (c.seconds, c.key))


def _cells_and_factors(
    frame: Frame, given: Sequence[tuple[int, Factors]], own: Factors
) -> list[tuple[Counts, Factors]]:
    """Cells with the multiples of the scene's step that they are tried with: cubic ones, and about the scene's own."""
    cells = [(frame.across(count), factors) for count, factors in given]
    return cells if frame.own_to_borders is None else [*cells, (frame.own_to_borders, own)]


def _folding(
    frame: Frame, given: Sequence[tuple[int, Factors]], own: Factors, idle: tuple[int, int] | None = None
) -> list[tuple[Counts, Factors]]:
    """The same for FEM alone, which solves one side where it can; idle: an axis, and how many cells lie along it."""
    found: dict[Counts, Factors] = {}
    for counts, factors in _cells_and_factors(frame, given, own):
        x, y, z = frame.folding(counts)
        if idle is not None:
            x, y, z = (idle[1] if axis == idle[0] else count for axis, count in enumerate((x, y, z)))
        found[x, y, z] = tuple(dict.fromkeys((*found.get((x, y, z), ()), *factors)))
    return list(found.items())


def _fem(frame: Frame) -> Iterator[Configuration]:
    step, body = frame.scene.step, frame.body
    is_block = block_of(body) is not None and frame.ball is None

    def folded(across: int) -> Counts:
        return frame.folding(frame.across(across))

    cubic = ((1, (8, 4, 2, 1)), (2, (8, 4, 2, 1, 0.5)), (3, (4, 2, 1, 0.5)), (4, (2, 1, 0.5)), (6, (1, 0.5)))
    for counts, factors in _folding(frame, cubic, (4, 2, 1, 0.5)):
        for factor in factors:
            yield Fem(frame, counts, factor * step).configuration()
    if frame.even is not None:
        for across in (2, 3, 4):
            for cells in (folded(across), frame.folding(frame.level(across))):
                x, y, z = (1 if axis == frame.even else n for axis, n in enumerate(cells))
                for factor in (2, 1):
                    yield Fem(frame, (x, y, z), factor * step).configuration()
            yield Fem(frame, frame.folding(frame.level(across)), step).configuration()
    elif frame.idle is not None:
        # the quadratic functions of one cell follow how free faces bulge
        for few in (1, 2) if frame.idle in frame.mirrors else (1,):
            for counts, factors in _folding(frame, IDLE, (8, 6, 5, 4, 3, 2), (frame.idle, few)):
                for factor in factors:
                    yield Fem(frame, counts, factor * step, "hex27_reduced").configuration()
                    if is_block and max(counts) > 2:
                        yield Fem(frame, counts, factor * step, "hex27_reduced", grading=THINNER).configuration()
    softer = ((2, (8, 4)), (3, (4, 2)), (4, (2, 1)))
    for counts, factors in _folding(frame, softer, (8, 6, 5, 4, 3, 2)):
        for factor in factors:
            yield Fem(frame, counts, factor * step, "hex27_reduced").configuration()
    if is_block:
        # cells that are thinner at the faces, where stress peaks
        for grading, across, factors in ((4.0, 3, (4, 2, 1)), (8.0, 3, (2, 1)), (4.0, 4, (2,)), (4.0, 5, (1,))):
            for factor in factors:
                yield Fem(frame, folded(across), factor * step, grading=grading).configuration()
    if frame.edged and not frame.ball:
        for across, grading, factor in TOWARDS_EDGES:
            counts = frame.folding(frame.across(across), frame.edged)
            yield Fem(frame, counts, factor * step, grading=grading, towards=frame.edged).configuration()
    if frame.towards:
        for counts, thin in _few_towards_edges(frame, frame.towards):
            for factor in LONG:
                yield Fem(frame, counts, factor * step, grading=thin, towards=frame.towards).configuration()
    if frame.ball is not None:
        # equal cells, of which fewer will do where the ball is hardly stiffer
        equal = replace(frame, follows=False)
        for across, factors in ((2, (4, 2)), (3, (2,)), (4, (2,))):
            for factor in factors:
                yield Fem(equal, equal.across(across), factor * step).configuration()
    for element in OTHERS:
        for across in (2, 4):
            yield Fem(frame, folded(across), step, element).configuration()
    # without contact their second order shows; with it, it does not
    second: tuple[tuple[int, Factors], ...] = ((2, (1, 2)),)
    if not frame.scene.tools:
        second = ((1, (2, 4)), (2, (1, 2, 4)), (3, (2, 4)), (4, (2,)))
    for integrator in ("midpoint",) if is_viscous(frame.body) else ("midpoint", "bdf2"):
        for across, factors in second:
            for factor in factors:
                yield Fem(frame, folded(across), factor * step, integrator=integrator).configuration()


def _few_towards_edges(frame: Frame, towards: tuple[str, ...]) -> Iterator[tuple[Counts, Grading]]:
    """Cells, and how thin they are, that are few along a face between the edges of tools, and thin towards these along
    some axes only: stress beside an edge goes by the cells across it, and hardly by those along it or below."""
    pieces = [len(planes) + 1 for planes in frame.edges_inside(towards)]
    for across in FEW_TOWARDS_EDGES:
        along = zip(pieces, frame.across(across), strict=True)
        x, y, z = (BY_EDGES * n if n > 1 else few for n, few in along)
        by_axis = [(1.0, THIN) if n > 1 else (1.0,) for n in pieces]
        for grading in product(by_axis[0], by_axis[1], by_axis[2]):
            yield frame.folding((x, y, z), towards), grading if THIN in grading else 1.0


def _xpbd(frame: Frame) -> Iterator[Configuration]:
    step = frame.scene.step
    cubic = ((1, (8, 4, 2, 1)), (2, (8, 4, 2, 1)), (3, (8, 4, 2, 1)), (4, (4, 2, 1)), (6, (4, 1)), (8, (2,)))
    for counts, factors in _cells_and_factors(frame, cubic, (4, 2, 1)):
        for factor in factors:
            yield _xpbd_one(frame, counts, factor * step)
    if frame.ball is not None:
        equal = replace(frame, follows=False)
        for across, factor in ((2, 4), (4, 4), (4, 2)):
            yield _xpbd_one(equal, equal.across(across), factor * step)
    for across, substeps in ((2, 2), (2, 4), (2, 8), (2, 16), (4, 8), (4, 32)):
        yield _xpbd_one(frame, frame.across(across), step, f"substeps: {substeps}")
    for across, sweeps in ((2, 2), (2, 4), (4, 2), (4, 4)):
        yield _xpbd_one(frame, frame.across(across), step, f"sweeps: {sweeps}")
    for across, factor in ((2, 4), (3, 4), (4, 4), (4, 1), (6, 4)):
        yield _xpbd_one(frame, frame.across(across), factor * step, "hourglass: fitted")


def _xpbd_one(frame: Frame, counts: Counts, step: float, how: str = "") -> Configuration:
    cut = frame.symmetry(())
    settings = ("regions={default: pbd}", *frame.cells(counts), f"step={step:.9g}", f"models.pbd={{{how}}}", *cut)
    seconds = frame.length / step * xpbd_step(frame.n_cells(counts), step)
    cells = cells_named(frame, counts)
    label = f"XPBD {cells}, {ms(step)}{', ' if how else ''}{how.replace(':', '')}"
    key = f"xpbd-{cells}-{ms(step, '')}{'-' if how else ''}{how.replace(': ', '-')}".replace(" ", "-")
    return Configuration(key, "XPBD", label, settings, seconds)


def _hybrid(frame: Frame) -> Iterator[Configuration]:
    """The scene's own regions, narrower, wider, and beside one block a cell, always cut."""
    regions, step = frame.scene.regions, frame.scene.step
    frame = replace(frame, follows=False)
    if not regions.hybrid:
        return
    ways: dict[str, tuple[str, ...]] = {"": (), ", one block a cell": ("models.pbd.coarse={beyond: 0}",)}
    if regions.within is not None:
        for reach, words in ((0.5, ", half as wide"), (2.0, ", twice as wide")):
            ways[words] = (f"regions.near.within={reach * regions.within:.9g}",)
    for counts, factors in _cells_and_factors(frame, ((2, (2, 1)), (3, (2, 1)), (4, (2, 1))), (2, 1)):
        for words, region in ways.items():
            for factor in factors if words in ("", ", one block a cell") else (1,):
                cells = (*frame.cells(counts), *frame.symmetry(()))
                settings = ("regions.near.split=always", *cells, f"step={factor * step:.9g}", *region)
                label = f"hybrid {cells_named(frame, counts)}, {ms(factor * step)}{words}"
                seconds = 3.0 * fem_seconds(frame, frame.n_cells(counts), factor * step)
                way = words.replace(",", "").replace(" ", "-")
                key = f"hybrid-{cells_named(frame, counts)}-{ms(factor * step, '')}{way}"
                yield Configuration(key, "hybrid", label, settings, seconds)


def particles(frame: Frame, step: float, substeps: int) -> Configuration:
    """A body of particles with these steps [s], each of so many substeps."""
    settings = (f"models.pbd.substeps={substeps}", f"step={step:.9g}")
    seconds = frame.length / step * (5e-4 + 5e-5 * substeps)
    label, key = f"XPBD {ms(step)}, substeps {substeps}", f"particles-{ms(step, '')}-{substeps}"
    return Configuration(key, "XPBD", label, settings, seconds)


def _as_is(frame: Frame) -> Iterator[Configuration]:
    for factor in (4, 2, 1, 0.5):
        step = factor * frame.scene.step
        seconds = 2.0 * fem_seconds(frame, frame.n_cells(frame.own or frame.across(3)), step)
        label = f"as it is, {ms(step)}"
        yield Configuration(f"as-is-{ms(step, '')}", "as it is", label, (f"step={step:.9g}",), seconds)


def fem_seconds(frame: Frame, n_cells: float, step: float) -> float:
    """Rough wall time of FEM that solves for so many cells [s]."""
    return frame.length / step * fem_step(n_cells)


def cells_named(frame: Frame, counts: Counts) -> str:
    """Cells in a label."""
    if frame.ball is not None:
        return f"{frame.n_cells(counts)} round"
    return "x".join(str(count) for count in counts)


def ms(step: float, unit: str = " ms") -> str:
    """A step [s] in a label."""
    return f"{1e3 * step:.4g}{unit}"
