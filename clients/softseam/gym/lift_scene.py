"""Scenes of lifts: what a body is lifted by, and how; of TofuLift, a piece of tofu, for each of the two models."""

from typing import Literal

from softseam.gym.task_env import ACT

HEIGHT = 0.03
"""to lift the body by, which ends an episode [m]"""
CRUSHED = 0.5
"""compression that ends it, too; FEM in a rigid box is right up to 0.6"""
STEPS = 80
"""of an episode at most"""
SPEED = 0.05
"""of a pad at an action of 1 [m/s]"""
PADS = ("left", "right")
THICKNESS = 0.01
"""of a pad [m]"""
BELOW = 1e-3
"""how far pads reach below a piece, which stands on something small [m]"""
QUANTITIES = "quantities=[grip_force, lift_height, slip, peak_von_mises, compression]"
SUBSTEPS = 40
"""of XPBD in an action, 1 ms each: stable for all that `Randomise` draws by default (docs/decisions/54)"""

LiftModel = Literal["fem", "xpbd"]
BY_FEM: LiftModel = "fem"
BY_XPBD: LiftModel = "xpbd"

_OF_MODEL: dict[LiftModel, tuple[str, ...]] = {
    # 2x2x2 cells of 27 nodes: within 5 % of the truth (docs/results/chart.md), the fastest that is
    BY_FEM: ("body.cell=[0.025, 0.025, 0.025]",),
    # 5x5x5 cells, each one block; without the viscosity, which implicit steps of FEM do not show either
    BY_XPBD: (
        "body.cell=[0.01, 0.01, 0.01]",
        "body.material.retardation_time=0",
        f"models.pbd={{coarse: {{boxes: [{{min: [-1, -1, -1], max: [1, 1, 1]}}]}}, substeps: {SUBSTEPS}}}",
    ),
}


def times_of(step: float) -> list[str]:
    """Settings of any lift; step [s]."""
    return [f"step={step!r}", f"duration={STEPS * ACT!r}", QUANTITIES]


def settings_of(model: LiftModel, step: float) -> list[str]:
    """What the scene tofu_grasp is changed by, as `softseam run --set` takes it; step [s]."""
    found = [*times_of(step), *_OF_MODEL[model]]
    for name, side in zip(PADS, (-1.0, 1.0), strict=True):
        # Larger than any piece, so that no point slips off an edge, and clear of the largest.
        size, height = [THICKNESS, 0.09, 0.09], 0.5 * 0.09 - BELOW
        found += [f"tools.{name}.size={size}", f"tools.{name}.position=[{0.048 * side}, 0, {height}]"]
    return found
