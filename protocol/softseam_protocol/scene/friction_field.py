"""How friction varies over a body's surface."""

from pydantic import Field

from softseam_protocol.scene.spec import Positive, Spec

LARGEST_SPREAD = 1.0


class FrictionFieldSpec(Spec):
    """A factor on every tool's `friction`, a smooth random field over the body's surface whose mean is 1."""

    spread: float = Field(ge=0.0, le=LARGEST_SPREAD, description="standard deviation of the factor [1]")
    length: Positive = Field(
        description="distance over which it varies: so far apart the correlation of its logarithm is exp(-1/2) [m]"
    )
    seed: int = Field(default=0, ge=0, description="another seed gives another field of this spread and length")

    @property
    def in_words(self) -> str:
        """How friction varies over the body."""
        return f"varies by {100.0 * self.spread:.3g} % over {1e3 * self.length:.3g} mm (seed {self.seed})"
