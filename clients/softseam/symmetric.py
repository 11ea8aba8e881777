"""What `symmetry` of a scene means for its figures, in words."""

from softseam_protocol.scene.scene import Scene

PARTS = ("all", "a half", "a quarter", "an eighth")
"""of a body, by the number of planes of symmetry"""


def symmetric(scene: Scene) -> str:
    """What FEM solves for; '' where the scene says no symmetry."""
    if not scene.symmetry:
        return ""
    part = PARTS[len(scene.symmetry)]
    axes = " and ".join(scene.symmetry)
    return f"in {axes}: where fem has all cells it solves for {part} of them; figures are the whole's"
