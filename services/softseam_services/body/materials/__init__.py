"""One file a material; the table has one row a kind of the scene file."""

from softseam_protocol.scene.materials import MaterialSpec, MooneyRivlinMaterial
from softseam_protocol.table import Table
from softseam_services.body.body import Material
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.errors import LawError
from softseam_services.body.materials import point
from softseam_services.body.materials.law import Law

__all__ = ["LAWS", "Law", "LawError", "build_material"]


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
    elastic = ElasticConstants.from_young_poisson(spec.young, spec.poisson)
    law = LAWS[spec.kind]
    return Material(
        kind=spec.kind,
        mu=elastic.mu,
        lambda_=elastic.lambda_,
        density=spec.density,
        number=law.number,
        parameters=law.packed(spec, elastic),
        splits=law.splits,
        small=law.small,
        retardation_time=spec.retardation_time,
        n_state=law.state,
        respond=law.address,
    )
