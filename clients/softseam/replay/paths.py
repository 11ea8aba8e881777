"""Entity paths of a replay, in one place."""

WORLD = "/world"
TOOLS = "/world/tools"
PAIRS = "/world/pairs"
SCALE = "/legend/scale"
SUMMARY = "/summary"
LOG = "/log"
CURVES = "/curves"


class BodyPaths:
    """Those of one body; `forces` has all of its forces below it."""

    def __init__(self, body: str) -> None:
        at = f"{WORLD}/bodies/{body}"
        self.near, self.far, self.cells, self.inclusions = (
            f"{at}/{it}" for it in ("near", "far", "cells", "inclusions")
        )
        self.stress, self.energy, self.error = f"{at}/stress", f"{at}/energy", f"{at}/error"
        self.ghost, self.forces = f"{at}/ghost", f"{at}/forces"
        self.contact, self.multiplier = f"{self.forces}/contact", f"{self.forces}/seam"
        self.seam_nodes = f"{self.forces}/seam_nodes"
