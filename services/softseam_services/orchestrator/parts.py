"""A step in parts: the tools' motion cut up, the replies put together again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from softseam_protocol.messages import Advanced, ToolMotion


def parts_of(motion: ToolMotion, n: int) -> list[ToolMotion]:
    """Equal parts of a motion, one after the other; quaternions along the straight line, normalised."""

    def at(i: int) -> tuple[np.ndarray, np.ndarray]:
        if i == n:
            return motion.position_next, motion.orientation_next
        f = i / n
        turn = motion.orientation + f * (motion.orientation_next - motion.orientation)
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
        return motion.position + f * (motion.position_next - motion.position), turn

    poses = [at(i) for i in range(n + 1)]
    return [ToolMotion(*poses[i], *poses[i + 1]) for i in range(n)]


def sum_replies(parts: Sequence[Mapping[str, Advanced]]) -> dict[str, Advanced]:
    """The last part's replies, with the work and effort of all parts and their mean wrench."""
    return {
        name: replace(
            last,
            tool_work=sum(part[name].tool_work for part in parts),
            seam_work=sum(part[name].seam_work for part in parts),
            iterations=sum(part[name].iterations for part in parts),
            seconds=sum(part[name].seconds for part in parts),
            penetration=max(part[name].penetration for part in parts),
            n_substeps=sum(part[name].n_substeps for part in parts),
            n_rejected=sum(part[name].n_rejected for part in parts),
            step_error=max(part[name].step_error for part in parts),
            residual=max(part[name].residual for part in parts),
            alarm=next((part[name].alarm for part in parts if part[name].alarm), ""),
            wrench=np.mean([part[name].wrench for part in parts], axis=0),
        )
        for name, last in parts[-1].items()
    }
