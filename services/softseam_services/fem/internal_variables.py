"""What FEM cannot do yet with a material that has state."""

from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Body
from softseam_services.body.errors import SettingError

INTEGRATORS = ("implicit_euler", "static")
"""take internal forces at the end of the step, where the state that follows belongs"""


def check_internal_variables(body: Body, spec: FemSpec) -> None:
    """Raise SettingError, with its key and the remedy, for a body whose material has state."""
    kind = body.material.kind
    if spec.integrator not in INTEGRATORS:
        use = " or ".join(INTEGRATORS)
        raise SettingError(f"models.fem.integrator: {spec.integrator} does not know the state of {kind}: use {use}")
