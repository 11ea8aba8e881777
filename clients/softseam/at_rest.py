"""What a scene's quantities are before the first step, so that `reset` observes what the steps after it do."""

from __future__ import annotations

from softseam.stress import von_mises
from softseam_protocol.messages import Frame
from softseam_protocol.scene import BlockShape, BodySpec, Scene


def probed(scene: Scene) -> tuple[str, ...]:
    """What is observed of a scene's probes."""
    return tuple(f"{probe}.{what}" for probe in scene.probes for what in ("von_mises", "displacement"))


def at_rest(scene: Scene, frame: Frame | None) -> dict[str, float]:
    """Quantities of the start that need no step to be known: a body in cells is at rest.

    Left out are error indicators, which are relative to what is not there yet, and how far tools reach into the
    bounding box of a body that is no block.
    """
    if not isinstance(scene.body, BodySpec):
        return {}
    nothing = ("tip_deflection", *(("compression",) if isinstance(scene.body.shape, BlockShape) else ()))
    known = {name: 0.0 for name in nothing if name in scene.quantities}
    known |= dict.fromkeys(probed(scene), 0.0)
    if "peak_von_mises" in scene.quantities and frame is not None and len(frame.cauchy):
        known["peak_von_mises"] = float(von_mises(frame.cauchy).max())
    return known
