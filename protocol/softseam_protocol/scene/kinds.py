"""Materials, elements and integrators by name, and which of them may meet."""

from dataclasses import dataclass
from typing import Literal

from softseam_protocol.table import Table

SeamScheme = str
"""a row of SCHEMES"""
ElementKind = str
"""a row of ELEMENTS"""
IntegratorKind = str
"""a row of INTEGRATORS"""
Functions = Literal["hex27", "hex8", "tet4", "tet10"]
"""what a cell's 27 nodes are interpolated with: quadratic, trilinear in octants, on their tetrahedra, on the cell's"""


@dataclass(frozen=True)
class ElementFacts:
    """functions         between nodes
    stiff_from        Poisson's ratio from which it is off by 5 % and more on coarse cells, having no cure against
                      locking [1]
    stress_at_points  it gives an octant's stress at its Gauss point, not its mean over the octant
    """

    functions: Functions
    stiff_from: float = 0.5
    stress_at_points: bool = False


ELEMENTS: Table[ElementFacts] = Table(
    "elements",
    {
        "hex27": ElementFacts("hex27", stress_at_points=True),
        "hex27_full": ElementFacts("hex27", stiff_from=0.45),
        "hex27_reduced": ElementFacts("hex27", stress_at_points=True),
        "hex8": ElementFacts("hex8"),
        "hex8_bbar": ElementFacts("hex8"),
        "hex8_full": ElementFacts("hex8", stiff_from=0.4),
        "hex8_reduced": ElementFacts("hex8"),
        "tet4": ElementFacts("tet4", stiff_from=0.3),
        "tet4_fbar": ElementFacts("tet4"),
        "tet10": ElementFacts("tet10", stiff_from=0.45),
    },
)
"""what a scene says of an element; services build it (softseam_services.fem.elements.ELEMENTS)"""

IN_BLOCKS: ElementKind = "hex27"
IN_MESHES: ElementKind = "hex27_reduced"
ON_TETRAHEDRA: ElementKind = "tet10"
"""FEM's element where a scene names none: in a block and a file's own hexahedra, in cells that a mesh's surface cuts,
which are else too stiff where tools press (docs/decisions/17), and on a file's tetrahedra"""
_STIFF_THERE: dict[ElementKind, tuple[float, str]] = {
    "tet10": (0.49, "mesh more finely"),
    "tet4": (0.3, "use tet10 or tet4_fbar"),
}
"""Poisson's ratio from which elements of a file's tetrahedra are off by 5 % and more on coarse ones, and what to do"""


@dataclass(frozen=True)
class SchemeFacts:
    """What a coupling loop can meet.

    like             another scheme, of whose integrators it takes all: it closes the same gap under the same
                     multipliers; '' where it has a row of its own in IntegratorFacts.seams
    least_exchanges  that a step needs, where it settles at all
    why_exchanges    what they are for
    """

    like: str = ""
    least_exchanges: int = 1
    why_exchanges: str = ""


SCHEMES: Table[SchemeFacts] = Table(
    "seam schemes",
    {
        "position": SchemeFacts(),
        "staggered": SchemeFacts(
            least_exchanges=3, why_exchanges="asks the far side once and the near side twice at least"
        ),
    },
)
"""what a scene says of a coupling loop; the coupling builds it (softseam_coupling.loops.LOOPS)"""


@dataclass(frozen=True)
class IntegratorFacts:
    """What an integrator of FEM can meet.

    seams         coupling schemes that give it no energy (docs/results/verification.md); of staggered, no more
                  than the scheme itself does
    meets_tools   a point that hits a tool comes to rest
    viscous       it takes up the viscosity of a material and the drag of a body, or has no use for them
    radius        scenes may say how much it keeps of the fastest oscillations
    no_seam       why it cannot meet any seam; '' where it can, or where a seam would give it energy
    no_error      why it has no substeps by error; '' where it may
    moves         bodies have inertia; else something must hold them
    """

    seams: frozenset[SeamScheme] = frozenset()
    meets_tools: bool = False
    viscous: bool = False
    radius: bool = False
    no_seam: str = ""
    no_error: str = ""
    moves: bool = True


INTEGRATORS: Table[IntegratorFacts] = Table(
    "integrators",
    {
        "implicit_euler": IntegratorFacts(frozenset({"position", "staggered"}), meets_tools=True, viscous=True),
        "midpoint": IntegratorFacts(frozenset({"position"}), meets_tools=True, viscous=True, radius=True),
        "bdf2": IntegratorFacts(meets_tools=True),
        "newmark": IntegratorFacts(),
        "generalised_alpha": IntegratorFacts(meets_tools=True, radius=True),
        "symplectic_euler": IntegratorFacts(
            no_seam="it solves no equations", no_error="divides steps by what is stable"
        ),
        "static": IntegratorFacts(
            meets_tools=True,
            viscous=True,
            no_seam="the far side moves in time",
            no_error="makes no error in time",
            moves=False,
        ),
    },
)
"""what a scene says of an integrator; services have its coefficients (softseam_services.fem.integrators.table)"""

_NOT_FOUND = "it is not among those that were found stable"
_GIVES_ENERGY: dict[SeamScheme, str] = {
    "position": "a multiplier that is constant over the step gives it energy",
    "staggered": "the control is to fail for one reason alone",
}


def integrator_problem(name: IntegratorKind, seam: SeamScheme | None, tools: bool, clamped: bool) -> str:
    """Why FEM's integrator cannot meet the scene's seam, tools or free body, and what to do; '' where it can."""
    facts = INTEGRATORS[name]
    if not facts.moves and not clamped:
        return f"{name} needs something that holds the body from the start: clamp nodes (body.fixed), or use bdf2"
    seam = seam and (SCHEMES[seam].like or seam)
    if seam is not None and seam not in facts.seams:
        *most, last = [other for other, able in INTEGRATORS.items() if seam in able.seams]
        use = f"{', '.join(most)} or {last}" if most else last
        why = facts.no_seam or _GIVES_ENERGY.get(seam, _NOT_FOUND)
        return f"{name} cannot meet a seam, {why}: use {use}, or give all cells to fem without regions.near"
    if tools and not facts.meets_tools:
        why = facts.no_seam or "points that hit one gain energy"
        able = ", ".join(other for other, each in INTEGRATORS.items() if each.meets_tools)
        return f"{name} cannot meet tools, {why}: use one of {able}"
    return ""


def element_warning(name: ElementKind, poisson: float, tetrahedral: bool = False) -> str:
    """What a user of this element should know at this Poisson's ratio, and what to do; '' where nothing.

    tetrahedral: cells are tetrahedra of a file
    """
    if tetrahedral:
        stiff_from, remedy = _STIFF_THERE.get(name, (0.5, ""))
        said = f"{name} is too stiff on coarse tetrahedra at a Poisson's ratio of {poisson:g}: {remedy}"
        return said if poisson >= stiff_from else ""
    if poisson < ELEMENTS[name].stiff_from:
        return ""
    return f"{name} is too stiff on coarse cells at a Poisson's ratio of {poisson:g}: use hex27, hex8 or hex8_bbar"
