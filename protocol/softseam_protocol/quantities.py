"""What steps report: quantities by name, with their units and meanings.

Services measure them (`softseam_services.orchestrator.quantities`): each row here has one there, which is checked when
a simulation starts.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Literal

from softseam_protocol.scene.spec import RowOf
from softseam_protocol.table import Table


@dataclass(frozen=True)
class Quantity:
    """One number a step."""

    unit: str
    """SI; 1 for a ratio, or what it is a share of"""
    meaning: str
    """one line"""
    of: Literal["any", "cells", "particles"] = "any"
    """bodies that have it"""
    always: bool = False
    """reported wherever what it needs is at hand, asked for or not"""
    at_rest: float | None = None
    """before the first step, where that needs no measuring; None: measured then, if it can be without a step"""
    group: Literal["grip", "shape", "error"] = "shape"
    """with which others it is drawn"""
    of_strength: bool = False
    """of bodies with a material that says its strength"""
    settles: bool = True
    """whether it has a limit as cells shrink; at edges of tools and clamps a largest stress has none"""


def _of_particles(unit: str, meaning: str) -> Quantity:
    return Quantity(unit, meaning, of="particles", always=True, at_rest=0.0)


def _indicator(unit: str, meaning: str) -> Quantity:
    return Quantity(unit, meaning, of="cells", always=True, group="error")


QUANTITIES: Table[Quantity] = Table(
    "quantities",
    {
        "grip_force": Quantity(
            "N",
            "mean force on the tools that close, against the ways on which they do",
            always=True,
            at_rest=0.0,
            group="grip",
        ),
        "lift_height": Quantity(
            "m",
            "how far the centre of mass has risen since tools that touch it moved up; without gravity the lowest point",
            always=True,
            at_rest=0.0,
            group="grip",
        ),
        "slip": Quantity(
            "m",
            "farthest that a touching point has slid along a tool, or had when tools lost it",
            always=True,
            at_rest=0.0,
            group="grip",
        ),
        "peak_von_mises": Quantity(
            "Pa",
            "largest von Mises stress of any octant of a cell",
            of="cells",
            always=True,
            group="grip",
            settles=False,
        ),
        "stress_over_strength": Quantity(
            "of breaking",
            "largest von Mises stress of any octant over its material's strength, of materials that say one: 1 breaks",
            of="cells",
            always=True,
            of_strength=True,
            group="grip",
            settles=False,
        ),
        "von_mises_p99": Quantity(
            "Pa", "von Mises stress that 99 % of the body's volume stay below", of="cells", group="grip"
        ),
        "sag": Quantity("m", "how much lower the body is than at rest, top to bottom", always=True, at_rest=0.0),
        "compression": Quantity(
            "1",
            "how much narrower the body is between the tools that close than when all touched it, of that width",
            always=True,
            at_rest=0.0,
        ),
        "tip_deflection": Quantity(
            "m", "rise of the middle of the end farthest from what is fixed; negative downwards", at_rest=0.0
        ),
        "model_error": _indicator("1", "XPBD's estimated error against finite elements, energy norm"),
        "mesh_error": _indicator("1", "FEM's estimated error against smaller cells, energy norm"),
        "traction_jump": _indicator("Pa", "difference of the two sides' tractions, root mean square over the seam"),
        "constraint_residual": Quantity(
            "1",
            "how far the stress that XPBD's blocks apply is from what their shapes ask for, relative to it; 0 of FEM",
            of="cells",
            at_rest=0.0,
            group="error",
        ),
        "worst_stretch": _of_particles("1", "largest relative change of a spring's length, or strain of a tetrahedron"),
        "stretch_violation": _of_particles("1", "farthest that a spring is from its own law, relative to its length"),
        "stretch_violation_mean": _of_particles("1", "the same, mean over the springs"),
        "bending_violation": _of_particles("1", "farthest that a bend is from its own law, relative to the spacing"),
        "bending_violation_mean": _of_particles("1", "the same, mean over the bends"),
        "stretch_energy": _of_particles("J", "energy of the springs, or of the tetrahedra"),
        "bending_energy": _of_particles("J", "energy of the bends"),
        "held": _of_particles("particles", "how many particles tools hold"),
    },
)
QuantityName = Annotated[str, RowOf(QUANTITIES)]

PROBED: Table[Quantity] = Table(
    "quantities of probes",
    {
        "von_mises": Quantity("Pa", "von Mises stress at the probe", of="cells", at_rest=0.0),
        "displacement": Quantity("m", "how far the probe is from its place at rest", of="cells", at_rest=0.0),
    },
)
"""what is reported at each probe, as PROBE.von_mises"""


OF_TOOLS: Table[Quantity] = Table(
    "quantities of tools",
    {"force": Quantity("N", "size of the force between the tool and all bodies", at_rest=0.0, group="grip")},
)
"""what a report gives of each tool that is not one of two that close, as TOOL.force"""


def quantity(name: str) -> Quantity:
    """The row of a quantity, of one body's (BODY.NAME), of a probe's, or of a tool's. Raises MissingRow."""
    owner, _, what = name.rpartition(".")
    if owner and what in OF_TOOLS:
        return OF_TOOLS[what]
    return PROBED[what] if owner and what not in QUANTITIES else QUANTITIES[what]


def probed(probes: Iterable[str]) -> tuple[str, ...]:
    """Names of what is reported at probes."""
    return tuple(f"{probe}.{what}" for probe in probes for what in PROBED)
