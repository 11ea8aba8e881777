"""From coarse to fine: the stages of a training, and when it goes on from one to the next."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Stage:
    """Pieces of XPBD with cells of one size. The last stage of a training lasts to its end."""

    cell: float
    """edge [m]"""
    part: float = 0.0
    """of the training's actions that must be over before the next stage begins"""
    success: float = 0.0
    """of the last episodes that must succeed, too"""

    @property
    def settings(self) -> tuple[str, ...]:
        """Of the scene, as `softseam run --set` takes them."""
        return (f"body.cell=[{self.cell!r}, {self.cell!r}, {self.cell!r}]",)

    def over(self, part: float, success: float) -> bool:
        """Whether the next stage may begin, after a part of the training's actions."""
        return part >= self.part and success >= self.success

    def __str__(self) -> str:
        return f"cells of {1e3 * self.cell:.3g} mm"


COARSE_TO_FINE = (Stage(0.05 / 3.0, part=2.0 / 3.0, success=0.95), Stage(0.01))
"""of TofuLift: two thirds on pieces of 64 nodes, which take a fourth of the time of the 216 that end it"""
