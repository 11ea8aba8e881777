"""Entity paths of a replay, in one place."""

from dataclasses import dataclass

WORLD = "/world"
TOOLS = "/world/tools"
SCALE = "/legend/scale"
SUMMARY = "/summary"
LOG = "/log"
CURVES = "/curves"


@dataclass(frozen=True)
class BodyPaths:
    """Those of one body."""

    body: str

    def _of(self, what: str) -> str:
        return f"{WORLD}/bodies/{self.body}/{what}"

    @property
    def near(self) -> str:
        return self._of("near")

    @property
    def far(self) -> str:
        return self._of("far")

    @property
    def cells(self) -> str:
        return self._of("cells")

    @property
    def stress(self) -> str:
        return self._of("stress")

    @property
    def energy(self) -> str:
        return self._of("energy")

    @property
    def error(self) -> str:
        return self._of("error")

    @property
    def inclusions(self) -> str:
        return self._of("inclusions")

    @property
    def ghost(self) -> str:
        return self._of("ghost")

    @property
    def forces(self) -> str:
        """All of its forces."""
        return self._of("forces")

    @property
    def contact(self) -> str:
        return self._of("forces/contact")

    @property
    def multiplier(self) -> str:
        return self._of("forces/seam")

    @property
    def seam_nodes(self) -> str:
        return self._of("forces/seam_nodes")
