"""Entity paths of a replay, in one place."""

from __future__ import annotations

WORLD = "/world"
NEAR = "/world/body/near"
FAR = "/world/body/far"
GRID = "/world/body/cells"
STRESS = "/world/body/stress"
GHOST = "/world/body/ghost"
TOOLS = "/world/tools"
FORCES = "/world/forces"
CONTACT = "/world/forces/contact"
MULTIPLIER = "/world/forces/seam"
SEAM_NODES = "/world/forces/seam_nodes"
SCALE = "/legend/scale"
SUMMARY = "/summary"
LOG = "/log"
CURVES = "/curves"
