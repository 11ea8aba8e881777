"""What became of the body, in a word and a sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softseam.columns import Columns
from softseam_protocol.scene import Scene
from softseam_protocol.scene_motion import MovePhase, ReleasePhase

_RISE = 0.002
"""tools that rise less than this lift nothing [m]"""
_LOST = 0.05
"""part of the largest force below which tools have lost the body"""


@dataclass(frozen=True)
class Verdict:
    """outcome: 'lifted', 'dropped', 'missed', 'finished' or 'unfinished'."""

    outcome: str
    text: str


def judge(scene: Scene, columns: Columns, done: bool) -> Verdict:
    """Lifted or dropped, where tools went up with the body between them; else whether the run came to its end.

    Dropped: in the end the tools that rose press on it with less than 5 % of their largest force, or the body's lowest
    point rose by less than half of the tools' rise and slip explains at least half of the difference. A long body that
    hangs from the tools with one end on the ground is not dropped.
    """
    end = "" if done else f", but the run ends early at {columns.last('time'):.3g} s"
    if not len(columns):
        return Verdict("unfinished", "no step was taken")
    movers = {name for phase in scene.motion if isinstance(phase, MovePhase) for name in phase.tools}
    rises = [(columns[f"tool.{name}.z"], name) for name in sorted(movers)]
    if any(isinstance(phase, ReleasePhase) for phase in scene.motion):
        rises = []  # what is let go is not lifted
    rise = max((float(z[-1] - z.min()) for z, _ in rises), default=0.0)
    if rise < _RISE:
        return Verdict("finished" if done else "unfinished", f"the run came to its end{end}" if done else end[6:])
    height = columns["quantity.lift_height"]
    forces = [np.stack([columns[f"tool.{name}.f{axis}"] for axis in "xyz"]) for _, name in rises]
    force = sum(np.linalg.norm(each, axis=0) for each in forces)
    touched, touches = bool(force.max() > 0.0), bool(force[-1] > _LOST * force.max())
    risen = float(height[-1]) if np.isfinite(height[-1]) else (rise if touches else 0.0)
    slip = columns["quantity.slip"]
    slip = slip[np.isfinite(slip)]
    # the largest so far: a point that has slid out of the tools' reach no longer counts in the last step
    slid = not len(slip) or slip.max() >= 0.5 * (rise - risen)
    figures = f"the tools rose by {1e3 * rise:.1f} mm, the body by {1e3 * risen:.1f} mm"
    if not touched:
        return Verdict("missed", f"the tools never touched the body: {figures}{end}")
    if not touches or (risen < 0.5 * rise and slid):
        return Verdict("dropped", f"dropped: {figures}{end}")
    return Verdict("lifted", f"lifted: {figures}{end}")
