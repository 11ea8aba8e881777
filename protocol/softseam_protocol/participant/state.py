"""The state of a part as a value: nobody writes to it, so that what is taken back or repeated is so to the bit."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Coupled

Floats = NDArray[np.float64]

_DIGEST = 16
"""bytes at the end of saved states"""
_LENGTH = 8
"""bytes of a length before each state of a pile, little-endian"""


class NotFinite(ValueError):
    """A state, or what is said of it, holds NaN or infinity."""


@dataclass(frozen=True)
class State:
    """Everything that a part's future depends on (n nodes)."""

    x: Floats
    """positions (n, 3) [m]"""
    v: Floats
    """velocities (n, 3) [m/s]"""
    own: Floats = field(default_factory=lambda: np.zeros(0))
    """what else evolves, as variables of a material; of the same shape in every state"""
    advanced: Mapping[str, Any] = field(default_factory=dict)
    """fields of `Advanced` that say more of the step than the defaults, as the wrench on tools; empty where nothing
    touches: a step that says more is redone in place of corrected, and it is not saved"""
    fields: Mapping[str, Any] = field(default_factory=dict)
    """fields of `Fields`, likewise, as contact forces"""


def sound(state: State, like: State) -> State:
    """A copy that nobody can write to. Raises TypeError where its shapes are not those of `like`, and NotFinite."""
    arrays: dict[str, Any] = {}
    for name in ("x", "v", "own"):
        array = np.array(getattr(state, name), dtype=np.float64, order="C")
        wanted = getattr(like, name).shape
        if array.shape != wanted:
            raise TypeError(f"State.{name} of shape {array.shape}: this part's is {wanted}")
        if not np.isfinite(array).all():
            raise NotFinite(f"State.{name} is not finite")
        array.setflags(write=False)
        arrays[name] = array
    return replace(state, **arrays)


def finite(reported: Any) -> None:
    """Raises NotFinite for the first field of a message that holds NaN, or infinity where it is no distance."""
    for one in fields(reported):
        value = getattr(reported, one.name)
        if isinstance(value, dict):
            value = np.array([each for each in value.values() if isinstance(each, float)])
        if isinstance(value, Coupled):
            finite(value)
        elif isinstance(value, float | np.ndarray):
            bad = np.isnan(value) if one.name == "cell_distance" else ~np.isfinite(value)
            if bad.any():
                raise NotFinite(f"{type(reported).__name__}.{one.name} is not finite")


def save(states: Sequence[State], more: float, kind: bytes) -> bytes:
    """States and a number as bytes, with a digest that only parts of this kind (at most 64 bytes) read."""
    arrays = [array for state in states for array in (state.x, state.v, state.own)]
    data = b"".join(array.tobytes() for array in (*arrays, np.array([more])))
    return data + _digest(data, kind)


def load(data: bytes, like: State, n_states: int, kind: bytes) -> tuple[list[State], float]:
    """What `save` was given. Raises ValueError for other bytes, or those of another kind."""
    data, digest = data[:-_DIGEST], data[-_DIGEST:]
    shapes = [like.x.shape, like.v.shape, like.own.shape] * n_states
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
    if len(data) != 8 * (ends[-1] + 1) or digest != _digest(data, kind):
        raise ValueError("these bytes are no state of this part: send what a snapshot of it gave")
    *arrays, more = np.split(np.frombuffer(data), ends)
    x, v, own = ([a.reshape(shape) for a, shape in zip(arrays[i::3], shapes[i::3], strict=True)] for i in range(3))
    return [sound(State(*one), like) for one in zip(x, v, own, strict=True)], float(more[0])


def _digest(data: bytes, kind: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=_DIGEST, key=kind).digest()


def join_states(states: Iterable[bytes]) -> bytes:
    """One snapshot of a pile, of those of its bodies."""
    return b"".join(piece for state in states for piece in (len(state).to_bytes(_LENGTH, "little"), state))


def split_states(state: bytes) -> list[bytes]:
    """The snapshots that `join_states` joined. Raises ValueError where bytes are missing.

    >>> split_states(join_states([b"one", b""]))
    [b'one', b'']
    """
    parts, at = [], 0
    while at < len(state):
        begin = at + _LENGTH
        end = begin + int.from_bytes(state[at:begin], "little")
        if end > len(state):
            raise ValueError("the snapshot of a pile ends too early: restore the bytes that `snapshot` returned")
        parts.append(state[begin:end])
        at = end
    return parts
