"""Models, materials, elements and integrators by name, and which of them may meet."""

from __future__ import annotations

from typing import Literal

ModelKind = Literal["fem", "pbd"]
SeamScheme = Literal["position", "ph", "staggered"]
SeamAcceleration = Literal["exact", "iqn_ils", "aitken", "constant"]
MaterialKind = Literal[
    "neo_hookean", "linear", "corotated", "st_venant_kirchhoff", "stable_neo_hookean", "mooney_rivlin"
]
ElementKind = Literal[
    "hex27",
    "hex27_full",
    "hex27_reduced",
    "hex8",
    "hex8_bbar",
    "hex8_full",
    "hex8_reduced",
    "tet4",
    "tet4_fbar",
    "tet10",
]
IntegratorKind = Literal[
    "implicit_euler", "midpoint", "bdf2", "newmark", "generalised_alpha", "symplectic_euler", "static"
]

SEAM_INTEGRATORS: dict[SeamScheme, tuple[IntegratorKind, ...]] = {
    "position": ("implicit_euler", "midpoint"),
    "ph": ("implicit_euler", "midpoint", "bdf2", "newmark", "generalised_alpha"),
    "staggered": ("implicit_euler",),
}
"""those that a scheme gives no energy (docs/results/verification.md); of staggered, no more than the scheme does"""
_GIVES_ENERGY: dict[SeamScheme, str] = {
    "position": "a multiplier that is constant over the step gives it energy",
    "ph": "it is not among those that were found stable",
    "staggered": "the control is to fail for one reason alone",
}
CONTACT_INTEGRATORS: tuple[IntegratorKind, ...] = (
    "implicit_euler",
    "midpoint",
    "bdf2",
    "generalised_alpha",
    "static",
)
"""those under which a point that hits a tool comes to rest"""

VISCOUS_INTEGRATORS: tuple[IntegratorKind, ...] = ("implicit_euler", "midpoint", "static")
"""those that take up the viscosity of a material, or have no use for it"""


def integrator_problem(name: IntegratorKind, seam: SeamScheme | None, tools: bool, clamped: bool) -> str:
    """Why FEM's integrator cannot meet the scene's seam, tools or free body, and what to do; '' where it can."""
    explicit = name == "symplectic_euler"
    if name == "static" and not clamped:
        return "static needs something that holds the body from the start: clamp nodes (body.fixed), or use bdf2"
    if seam is not None and name not in SEAM_INTEGRATORS[seam]:
        why = {"symplectic_euler": "it solves no equations", "static": "the far side moves in time"}.get(
            name, _GIVES_ENERGY[seam]
        )
        *most, last = SEAM_INTEGRATORS[seam]
        use = f"{', '.join(most)} or {last}" if most else last
        if name in SEAM_INTEGRATORS["ph"]:
            use += ", or seam: {scheme: ph}"
        return f"{name} cannot meet a seam, {why}: use {use}, or give all cells to fem without regions.near"
    if tools and name not in CONTACT_INTEGRATORS:
        why = "it solves no equations" if explicit else "points that hit one gain energy"
        return f"{name} cannot meet tools, {why}: use one of {', '.join(CONTACT_INTEGRATORS)}"
    return ""


STIFF_FROM: dict[ElementKind, float] = {"hex8_full": 0.4, "hex27_full": 0.45, "tet10": 0.45, "tet4": 0.3}
"""Poisson's ratio from which elements without a cure against locking are off by 5 % and more on coarse cells"""


def element_warning(name: ElementKind, poisson: float) -> str:
    """What a user of this element should know at this Poisson's ratio, and what to do; '' where nothing."""
    if poisson < STIFF_FROM.get(name, 0.5):
        return ""
    return f"{name} is too stiff on coarse cells at a Poisson's ratio of {poisson:g}: use hex27, hex8 or hex8_bbar"
