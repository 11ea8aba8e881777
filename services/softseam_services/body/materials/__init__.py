"""One file a material; the table has one row a kind of the scene file."""

from __future__ import annotations

import numpy as np

from softseam_protocol.kinds import MaterialKind
from softseam_protocol.scene_materials import MaterialSpec
from softseam_services.body.body import Material
from softseam_services.body.elastic_constants import ElasticConstants
from softseam_services.body.materials import point

__all__ = ["MATERIALS", "build_material"]

MATERIALS: dict[MaterialKind, int] = {
    "neo_hookean": point.NEO_HOOKEAN,
    "linear": point.LINEAR,
    "corotated": point.COROTATED,
    "st_venant_kirchhoff": point.ST_VENANT_KIRCHHOFF,
    "stable_neo_hookean": point.STABLE_NEO_HOOKEAN,
    "mooney_rivlin": point.MOONEY_RIVLIN,
}
"""number by which `point` knows each kind"""


def build_material(spec: MaterialSpec) -> Material:
    """Elastic constants and the kernels' view of a scene's material."""
    elastic = ElasticConstants.from_young_poisson(spec.young, spec.poisson)
    parameters = np.zeros(point.N_PARAMETERS)
    parameters[:] = elastic.mu, elastic.lambda_, spec.ratio or 0.0
    return Material(
        kind=spec.kind,
        mu=elastic.mu,
        lambda_=elastic.lambda_,
        density=spec.density,
        number=MATERIALS[spec.kind],
        parameters=parameters,
        retardation_time=spec.retardation_time,
    )
