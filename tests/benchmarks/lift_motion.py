"""The lift of docs/results/lifts.md: what two plates do, for softseam and for MuJoCo. Needs nothing but Python."""

from __future__ import annotations

ACT = 0.04
"""between two actions [s]"""
APART, HALF, HEIGHT = 0.032, 0.045, 0.044
"""from the cube's middle to a plate's, half of a plate's edge, height of its middle [m]: 2 mm clear"""
PHASES = ((5, 0.0, 0.0), (8, 0.00575 / (8 * ACT), 0.0), (8, 0.0, 0.0), (15, 0.0, 0.03 / (15 * ACT)), (4, 0.0, 0.0))
"""actions, and how fast each plate closes and rises in them [m/s]: settle, squeeze by 15 %, hold, lift by 3 cm, hold"""
SPEEDS = [(close, rise) for actions, close, rise in PHASES for _ in range(actions)]
"""of each action"""
HELD, LIFTED = 21, 40
"""actions after which forces are compared: squeezed on the ground, and in the air"""
