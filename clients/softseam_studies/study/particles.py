"""The reference of a body of particles: the scene's own particles, with ever shorter substeps.

How many particles there are is the body's own, as a weave is a cloth's: a reference is the limit in time alone.
"""

from softseam_studies.study.configurations import Configuration, particles
from softseam_studies.study.levels import Levels

FIRST = 16
"""substeps of a step that the sequence begins with: with fewer, stiff springs stretch by more than they hang"""


class ParticleLevels(Levels):
    """Levels that differ in the length of substeps; each has the scene's own step, which tools move by."""

    def sequence(self) -> tuple[int, ...]:
        return (1,)

    def n_cells(self, across: float) -> int:
        return 1

    def configuration(self, across: float, step: float) -> Configuration:
        return particles(self.frame, self.frame.scene.step, round(FIRST * self.frame.scene.step / step))
