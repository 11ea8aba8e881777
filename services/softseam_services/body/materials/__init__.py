"""One file a material; the table has one row a kind of the scene file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from softseam_protocol.scene import MaterialSpec
from softseam_services.body.body import Material
from softseam_services.body.materials import linear, neo_hookean

__all__ = ["MATERIALS", "MaterialLaw", "build_material"]


@dataclass(frozen=True)
class MaterialLaw:
    """Kernels of one material; each takes F (3, 3), mu, lambda."""

    energy: Callable[..., Any]
    stress: Callable[..., Any]
    cauchy: Callable[..., Any]
    tangent: Callable[..., Any]


MATERIALS = {
    "neo_hookean": MaterialLaw(neo_hookean.energy, neo_hookean.stress, neo_hookean.cauchy, neo_hookean.tangent),
    "linear": MaterialLaw(linear.energy, linear.stress, linear.cauchy, linear.tangent),
}


def build_material(spec: MaterialSpec) -> Material:
    """Lame constants: mu = E/(2(1 + nu)), lambda = E nu/((1 + nu)(1 - 2 nu))."""
    young, poisson = spec.young, spec.poisson
    return Material(
        kind=spec.kind,
        mu=young / (2.0 * (1.0 + poisson)),
        lambda_=young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
        density=spec.density,
    )
