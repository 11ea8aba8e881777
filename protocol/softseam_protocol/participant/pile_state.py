"""The snapshot of a pile: those of its bodies, one after the other, each after its length."""

from collections.abc import Iterable

_LENGTH = 8
"""bytes of a length, little-endian"""


def join_states(states: Iterable[bytes]) -> bytes:
    """One snapshot of several bodies'."""
    return b"".join(len(state).to_bytes(_LENGTH, "little") + state for state in states)


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
