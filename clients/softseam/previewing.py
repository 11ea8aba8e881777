"""A picture of a scene before it is simulated."""

from pathlib import Path

from softseam.embedded import preview
from softseam.errors import missing_extra
from softseam.outputs import cannot_write, check_ending
from softseam_protocol.messages.participant import Bundle


def draw_preview(bundle: Bundle, path: Path) -> Path:
    """Draw bodies, tools, their ways, and the faces with which they touch, to a .png; returns its path.

    Simulates nothing. Raises SceneRefused for a scene that cannot be simulated, BadInput where the file cannot be
    written, and MissingExtra.
    """
    check_ending("picture", path, ".png", "a picture")
    try:
        from softseam.view.scene_picture import draw_scene
    except ImportError as error:
        raise missing_extra(error, "drawing a scene") from error
    scene, ahead = preview(bundle)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return draw_scene(scene, ahead.surfaces, ahead.position, ahead.orientation, ahead.touch, path)
    except OSError as error:
        raise cannot_write(path, error) from None
