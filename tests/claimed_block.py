"""A block between two plates of which claims are made, and its sibling."""

from __future__ import annotations

from pathlib import Path

from softseam.claims.sibling import Sibling, sibling_of
from softseam.session import open_as_given
from softseam_protocol.scene.scene import Scene

BLOCK = """\
softseam: 1
name: cube
gravity: [0, 0, 0]
step: 0.01
body:
  shape: {kind: block, size: [0.04, 0.04, 0.02]}
  cell: 0.01
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
tools:
  left: {kind: box, size: [0.01, 0.05, 0.03], position: [-0.0252, 0, 0.01], friction: 0.6}
  right: {kind: box, size: [0.01, 0.05, 0.03], position: [0.0252, 0, 0.01], friction: 0.6}
motion:
  - {tools: [left, right], close: 0.02, until: {compression: 0.06}}
regions: {default: fem}
quantities: [grip_force, compression]
"""


def write_block(folder: Path) -> str:
    """The path of its scene."""
    path = folder / "cube.yaml"
    path.write_text(BLOCK)
    return str(path)


def sibling(scene: str | Path | Scene, *settings: str) -> Sibling:
    with open_as_given(scene, settings=settings) as session:
        session.reset()
        return sibling_of(session.scene, session.last.frames)
