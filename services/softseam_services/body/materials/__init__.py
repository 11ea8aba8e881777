"""One file a material; the table has one row a kind of the scene file."""

from collections.abc import Iterable
from dataclasses import replace
from math import inf

import numpy as np

from softseam_protocol.scene.materials import MaterialSpec, MooneyRivlinMaterial
from softseam_protocol.table import Table
from softseam_services.body.body import Floats, Material
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.errors import LawError
from softseam_services.body.materials import point
from softseam_services.body.materials.law import Law
from softseam_services.body.materials.relaxation import BRANCHES, SIX, YIELDS

__all__ = ["LAWS", "Law", "LawError", "build_material", "build_materials"]


def _elastic(spec: MaterialSpec, elastic: ElasticConstants) -> tuple[float, ...]:
    """mu, lambda [Pa]."""
    return elastic.mu, elastic.lambda_


def _mooney_rivlin(spec: MooneyRivlinMaterial, elastic: ElasticConstants) -> tuple[float, ...]:
    """mu, lambda [Pa], ratio [1]."""
    return elastic.mu, elastic.lambda_, spec.ratio


LAWS: Table[Law] = Table(
    "material laws",
    {
        "neo_hookean": Law(_elastic, inline=point.NEO_HOOKEAN, splits=True),
        "linear": Law(_elastic, inline=point.LINEAR, splits=True, small=True),
        "corotated": Law(_elastic, inline=point.COROTATED),
        "st_venant_kirchhoff": Law(_elastic, inline=point.ST_VENANT_KIRCHHOFF),
        "stable_neo_hookean": Law(_elastic, inline=point.STABLE_NEO_HOOKEAN),
        "mooney_rivlin": Law(_mooney_rivlin, inline=point.MOONEY_RIVLIN),
    },
)
"""the law of each specification in softseam_protocol.scene.materials.MATERIALS"""


def build_material(spec: MaterialSpec) -> Material:
    """Elastic constants and the kernels' view of a scene's material. Raises MissingRow and LawError."""
    return build_materials([spec])[0]


def build_materials(specs: Iterable[MaterialSpec]) -> tuple[Material, ...]:
    """The same of one body's, all of which remember as many numbers as the one with most branches."""
    materials = [_built(spec) for spec in specs]
    most, yields = max(material.n_branches for material in materials), any(material.yielding for material in materials)
    if not most:
        return tuple(materials)
    return tuple(
        replace(
            each,
            n_state=SIX * (1 + most) + yields,
            respond=each.respond or -each.number,
            number=0,
            splits=_splits(each),
        )
        for each in materials
    )


def _splits(material: Material) -> bool:
    """Whether FEM's fast path knows it where it relaxes (fem/kernels/relaxing_cells.py)."""
    return material.splits and not material.small


def _built(spec: MaterialSpec) -> Material:
    elastic = ElasticConstants.from_young_poisson(spec.young, spec.poisson)
    law, branches = LAWS[spec.kind], tuple((branch.share, branch.time) for branch in spec.relaxation)
    slider = spec.plasticity
    if (branches or slider) and law.state:
        key = "relaxation" if branches else "plasticity"
        raise LawError(f"{spec.kind} has state of its own: leave body.material.{key} out")
    yielding = slider.share if slider else 0.0
    lasting = elastic.relaxed(yielding + sum(share for share, _ in branches))
    parameters = _with_branches(law.packed(spec, lasting), [(elastic.mu * share, time) for share, time in branches])
    if slider:
        at = BRANCHES + 2 * len(branches)
        parameters[at : at + 2] = elastic.mu * yielding, 0.0
        parameters[YIELDS:] = yielding * slider.yield_stress, slider.hardening
    return Material(
        kind=spec.kind,
        mu=elastic.mu,
        lambda_=elastic.lambda_,
        density=spec.density,
        number=law.number,
        parameters=parameters,
        splits=law.splits,
        small=law.small,
        retardation_time=spec.retardation_time,
        n_state=law.state,
        respond=law.address,
        relaxation=branches,
        yielding=yielding,
        strength=spec.strength or inf,
    )


def _with_branches(parameters: Floats, branches: list[tuple[float, float]]) -> Floats:
    """A law's parameters (MAX_PARAMETERS,), with mu [Pa] and time [s] of branches where `relaxation` looks for them.

    Raises LawError where the law's own are in their place.
    """
    if not branches:
        return parameters
    if parameters[BRANCHES:].any():
        raise LawError(f"a law with more than {BRANCHES} parameters has no room for branches that relax")
    own = np.ravel(branches)
    parameters[BRANCHES : BRANCHES + len(own)] = own
    return parameters
