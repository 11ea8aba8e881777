"""Tools, a core and a scene that are their own images in planes."""

from __future__ import annotations

from typing import Any

from softseam_protocol.scene.scene import Scene

TIPS = {"kind": "box", "size": (0.01, 0.024, 0.024), "friction": 0.6}
FINGERS = {
    "ground": {"kind": "plane", "friction": 0.4, "point": (0.3, -0.2, 0.0)},
    "left": {**TIPS, "position": (-0.0305, 0.0, 0.025)},
    "right": {**TIPS, "position": (0.0305, 0.0, 0.025)},
}
SPAN: list[dict[str, Any]] = [{"tools": ("left", "right"), "close": 0.02, "until": {"compression": 0.15}}]


def core(x: float) -> dict[str, Any]:
    """An inclusion of half the body's edges, its middle at this x [m]."""
    shape = {"kind": "box", "position": (x, 0.0, 0.025), "size": (0.025, 0.025, 0.025)}
    return {"shape": shape, "material": {"young": 2e5, "poisson": 0.4}}


def fine(scene: Scene, symmetry: str = "", **fem: Any) -> Scene:
    """Solved to the last digits that mean something; symmetry: axes."""
    spec = scene.models.fem.model_copy(update={"tolerance": 1e-10, "iterations": 200, **fem})
    models = scene.models.model_copy(update={"fem": spec})
    return scene.model_copy(update={"models": models, "symmetry": tuple(symmetry)})
