"""A run as a client sees it, in a form that two runs can be compared bit for bit."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import numpy as np

from softseam_protocol.messages.session import Frame, StepReport

_DIAGNOSTICS = {"seconds", "header"}
"""fields that say how a run went, not where the body is"""


def bits(value: object) -> object:
    """A message without its diagnostics as nested tuples; arrays become bytes."""
    if isinstance(value, np.ndarray):
        return (value.shape, str(value.dtype), value.tobytes())
    if isinstance(value, float):
        return np.float64(value).tobytes()
    if isinstance(value, dict):
        return tuple((key, bits(value[key])) for key in sorted(value))
    if is_dataclass(value) and not isinstance(value, type):
        return tuple((f.name, bits(getattr(value, f.name))) for f in fields(value) if f.name not in _DIAGNOSTICS)
    return value


def first_difference(one: list[StepReport], other: list[StepReport]) -> str:
    """Where two runs part, or an empty text."""
    if len(one) != len(other):
        return f"{len(one)} steps against {len(other)}"
    for n, (a, b) in enumerate(zip(one, other, strict=True)):
        for field in fields(StepReport):
            if field.name not in _DIAGNOSTICS and bits(getattr(a, field.name)) != bits(getattr(b, field.name)):
                return f"step {n}, {field.name}: {getattr(a, field.name)} against {getattr(b, field.name)}"
    return ""


def same_frame(one: Frame, other: Frame) -> bool:
    return bits(one) == bits(other)
