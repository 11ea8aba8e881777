"""A scene of three bodies that do not touch: tofu in two models, which tools lift, a jelly, a sheet that hangs."""

from __future__ import annotations

import json

from softseam_protocol.scene import marked_yaml
from softseam_protocol.scene.file import parse_scene
from softseam_protocol.scene.scene import Scene

TEXT = """
softseam: 1
name: several
step: 0.01
bodies:
  tofu:
    shape: {kind: block, size: [0.05, 0.05, 0.05]}
    cell: 0.0125
    material: {kind: neo_hookean, young: 20000.0, poisson: 0.45, density: 1050}
    regions: {default: pbd, near: {model: fem, within: 0.006, split: always}}
  jelly:
    shape: {kind: block, size: [0.03, 0.03, 0.03]}
    position: [0.1, 0, 0]
    cell: 0.015
    material: {kind: neo_hookean, young: 10000.0, poisson: 0.4, density: 1000}
    regions: {default: fem}
  nori:
    kind: sheet
    size: [0.05, 0.05]
    position: [0, 0.1, 0.05]
    divisions: [8, 8]
    density: 0.1
    stretch: 100
    bending: 1.0e-6
    fixed: [{min: [-1, 0.12, 0], max: [1, 1, 1]}]
tools:
  ground: {kind: plane, friction: 0.5}
  left: {kind: box, size: [0.01, 0.05, 0.04], position: [-0.035, 0, 0.025], friction: 0.6}
  right: {kind: box, size: [0.01, 0.05, 0.04], position: [0.035, 0, 0.025], friction: 0.6}
motion:
  - {tools: [left, right], close: 0.05, until: {compression: 0.1}}
  - {tools: [left, right], move: [0, 0, 0.01], speed: 0.1}
probes:
  middle: [0, 0, 0.025]
  wobble: [0.1, 0, 0.02]
quantities: [peak_von_mises, grip_force, worst_stretch]
"""
NAMES = ("jelly", "nori", "tofu")


def several() -> Scene:
    """All of them."""
    return parse_scene(TEXT)


def alone(name: str) -> Scene:
    """One of them, as the body of a scene with the same tools and motion."""
    data = marked_yaml.parse(TEXT).data
    body = data.pop("bodies")[name]
    if (regions := body.pop("regions", None)) is not None:
        data["regions"] = regions
    particles = name == "nori"
    data["quantities"] = ["worst_stretch"] if particles else ["peak_von_mises", "grip_force"]
    del data["probes"]
    return parse_scene(json.dumps({**data, "body": body}))
