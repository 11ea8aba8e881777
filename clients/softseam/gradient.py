"""Gradients of a loss by what a run depends on: names of inputs, and what comes back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam.errors import BadInput, not_among
from softseam.losses import Loss, Run, Slope
from softseam_protocol.scene.command import Command

Floats = NDArray[np.float64]


class Crossed(NamedTuple):
    """A contact that nearly opened, closed, stuck or slipped as a step ended: beyond it the derivative is another."""

    step: int
    """from 0"""
    tool: str
    margin: float
    """relative change of forces that it takes [1]"""


class Asked(NamedTuple):
    """What a gradient is of, by what, and of which run; see `Session.gradient`."""

    loss: Loss
    names: Sequence[str]
    commands: Sequence[Command] | None
    steps: int | None
    within: float


@dataclass(frozen=True)
class Gradient:
    """A loss, and its derivatives."""

    value: float
    """of the loss"""
    by: Mapping[str, float | Floats]
    """by each name that was asked for: a number, (3,) of `velocity` and `position`, (s, 3) of `way.TOOL`"""
    crossed: tuple[Crossed, ...]
    """contacts near a change: where there are any, differences across them differ from the derivative"""
    run: Run
    seconds_forward: float
    """the run took [s]"""
    seconds_backward: float
    """the derivatives took [s]"""

    def __getitem__(self, name: str) -> float | Floats:
        return self.by[name]


def inputs_of(tools: Sequence[str]) -> list[str]:
    """Names of all that a gradient may be by."""
    each = [f"{what}.{tool}" for what in ("friction", "way") for tool in tools]
    return ["young", "friction", *each, "velocity", "position"]


def check_inputs(names: Sequence[str], tools: Sequence[str]) -> None:
    """Raises BadInput for a name that is no input."""
    if isinstance(names, str):
        raise BadInput(f"wrt={names!r} is one name: give a list of names, e.g. wrt=[{names!r}]")
    known = inputs_of(tools)
    if not names:
        raise BadInput(f"wrt is empty: name what the gradient is by: {', '.join(known)}")
    for name in names:
        if name not in known:
            raise BadInput(f"a gradient cannot be by {not_among(str(name), known)}")


def checked_slope(slope: Slope, run: Run) -> tuple[Floats, Floats, Floats]:
    """Derivatives of a loss by forces (s, t, 3), by positions (s, n, 3), and by those at the start (n, 3).

    Raises BadInput for other shapes, and for what is not finite.
    """
    tools, n_steps = list(run.force), len(run.time)
    force = np.zeros((n_steps, len(tools), 3))
    for tool, by_force in slope.force.items():
        if tool not in tools:
            raise BadInput(
                f"the loss has a slope by the force on {tool!r}; the scene has: {', '.join(tools) or 'none'}"
            )
        force[:, tools.index(tool)] = _shaped(by_force, (n_steps, 3), f"by the force on {tool!r}")
    positions = _shaped(slope.positions, run.positions.shape, "by positions")
    return force, positions, _shaped(slope.start, run.start.shape, "by positions at the start")


def _shaped(given: Floats | None, shape: tuple[int, ...], what: str) -> Floats:
    """Finite numbers of this shape, zeros where nothing is given. Raises BadInput."""
    if given is None:
        return np.zeros(shape)
    array = np.ascontiguousarray(given, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise BadInput(f"the loss's slope {what} must be finite, of shape {shape}; it has shape {array.shape}")
    return array
