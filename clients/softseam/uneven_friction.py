"""What `friction_field` of a scene's bodies means, in words."""

from softseam_protocol.scene.scene import Scene


def uneven_friction(scene: Scene) -> str:
    """How friction varies over the bodies on which it does; '' where there are none."""
    fields = {name: body.uneven_friction for name, body in scene.bodies.items()}
    found = {name: field.in_words for name, field in fields.items() if field is not None}
    return "; ".join(words if scene.one is not None else f"{name}: {words}" for name, words in found.items())
