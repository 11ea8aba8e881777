"""What `friction_field` of a scene's bodies means, in words."""

from softseam_protocol.scene.friction_field import FrictionFieldSpec
from softseam_protocol.scene.scene import Scene


def in_words(field: FrictionFieldSpec) -> str:
    """How friction varies over one body."""
    return f"varies by {100.0 * field.spread:.3g} % over {1e3 * field.length:.3g} mm (seed {field.seed})"


def uneven_friction(scene: Scene) -> str:
    """The same of all bodies on which it varies; '' where there are none."""
    fields = {name: body.uneven_friction for name, body in scene.bodies.items()}
    told = {name: in_words(field) for name, field in fields.items() if field is not None}
    return "; ".join(words if scene.one is not None else f"{name}: {words}" for name, words in told.items())
