"""The model that a scene means by its own words, where its regions name none."""

from __future__ import annotations

from collections.abc import Sequence

from softseam_protocol.scene.bodies import AnyBody, BodySpec
from softseam_protocol.scene.kinds import ModelKind
from softseam_protocol.scene.models import FemSpec, ModelsSpec, PbdSpec


def implied_model(body: AnyBody, models: ModelsSpec, symmetry: Sequence[str]) -> tuple[ModelKind, str] | None:
    """A model and why it is meant; None where the scene leaves open which.

    Whoever sets one model's keys alone means that model: with the other they would do nothing.
    """
    if not isinstance(body, BodySpec):
        return "pbd", f"a {body.kind} is made of particles"
    if body.tetrahedral:
        return "fem", "only fem takes tetrahedra of a file for cells"
    if symmetry:
        return "fem", "only fem solves for one side (symmetry)"
    fem, pbd = _set(models.fem.of(body), FemSpec().of(body)), _set(models.pbd, PbdSpec())
    if fem and not pbd:
        return "fem", f"the scene sets models.fem.{fem[0]}, and nothing of models.pbd"
    if pbd and not fem:
        return "pbd", f"the scene sets models.pbd.{pbd[0]}, and nothing of models.fem"
    return None


def _set(spec: FemSpec | PbdSpec, default: FemSpec | PbdSpec) -> list[str]:
    """Keys that are not what they are in a scene without them."""
    fields = type(spec).model_fields
    return [field.alias or name for name, field in fields.items() if getattr(spec, name) != getattr(default, name)]
