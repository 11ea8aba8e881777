"""A cube of eight cells between two plates that close on it: the scene of the client's tests."""

SCENE = """\
softseam: 1
name: cube
step: 0.01
body:
  shape: {kind: block, size: [0.02, 0.02, 0.02]}
  cell: 0.01
  material: {kind: neo_hookean, young: 2.0e4, poisson: 0.45, density: 1000}
tools:
  ground: {kind: plane, friction: 0.5}
  left: {kind: box, size: [0.01, 0.03, 0.03], position: [-0.0155, 0, 0.016], friction: 0.5}
  right: {kind: box, size: [0.01, 0.03, 0.03], position: [0.0155, 0, 0.016], friction: 0.5}
motion:
  - {tools: [left, right], close: 0.02, until: {time: 0.05}}
  - {hold: 0.05}
regions: {default: pbd, near: {model: fem, within: 0.004, split: always}}
quantities: [grip_force, peak_von_mises]
"""
CLOSE = {"left": [0.02, 0.0, 0.0], "right": [-0.02, 0.0, 0.0]}
