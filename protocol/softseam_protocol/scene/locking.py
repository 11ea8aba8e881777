"""Elements that are too stiff for a scene's material."""

from softseam_protocol.models import some_read
from softseam_protocol.scene.kinds import element_warning
from softseam_protocol.scene.scene import Scene


def locking(scene: Scene) -> str:
    """That FEM's element locks with the material of a scene's body; '' where it does not, or FEM has no part."""
    near, body = scene.regions.near, scene.body
    if not body.has_cells or not some_read((scene.regions.default, near.model if near else None), "fem.element"):
        return ""
    return element_warning(
        scene.models.fem.element, max(material.poisson for material in body.cell_materials), body.tetrahedral
    )
