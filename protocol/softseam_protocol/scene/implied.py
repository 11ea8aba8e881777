"""The model that a scene means by its own words, where its regions name none."""

from collections.abc import Sequence

from softseam_protocol.models import ModelKind, taking, that
from softseam_protocol.scene.bodies import AnyBody
from softseam_protocol.scene.models import ModelsSpec


def implied_model(body: AnyBody, models: ModelsSpec, symmetry: Sequence[str]) -> tuple[ModelKind, str] | None:
    """A model and why it is meant; None where the scene leaves open which.

    Whoever sets one model's keys alone means that model: with the other they would do nothing.
    """
    cells = body.in_cells
    if cells is None:
        return body.usual_model, body.no_cells.removesuffix(", not cells")
    if body.tetrahedral:
        able = taking("tetrahedra")
        return able[0], f"only {' and '.join(able)} takes tetrahedra of a file for cells"
    if symmetry:
        able = that(lambda facts: facts.one_side)
        return able[0], f"only {' and '.join(able)} solves for one side (symmetry)"
    changed = {name: keys for name, keys in models.changed(cells).items() if keys}
    if len(changed) != 1:
        return None
    ((name, keys),) = changed.items()
    others = " and of ".join(f"models.{other}" for other in ModelsSpec.model_fields if other != name)
    model, *_ = that(lambda facts: f"{name}.{keys[0]}" in facts.reads)
    return model, f"the scene sets models.{name}.{keys[0]}, and nothing of {others}"
