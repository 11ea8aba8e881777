"""Layouts learned from messages change nothing but the time: same messages, same refusals as without them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softseam_protocol import codec
from softseam_protocol.codec import decode, encode
from softseam_protocol.errors import ProtocolError
from softseam_protocol.layouts import Layouts
from softseam_protocol.learned import Learned
from softseam_protocol.messages import SCHEMA_VERSION, Advance, Advanced, Fields, Header, ToolMotion

CLASSES = (Advance, Advanced)
Message = Advance | Advanced


def header(rng: np.random.Generator, step: int) -> Header:
    return Header(SCHEMA_VERSION, "session", "near", 2, step, int(rng.integers(0, 3)), float(rng.normal()))


def advance(rng: np.random.Generator, s: int = 4, step: int = 7) -> Advance:
    at, turn, then, turned = (rng.normal(size=(2, width)) for width in (3, 4, 3, 4))
    motion = ToolMotion(at, turn, then, turned)
    anchor = rng.normal(size=(s, 3)) if rng.integers(2) else np.zeros((0, 3))
    return Advance(header(rng, step), 0.01, rng.normal(size=(s, 3)), motion, bool(rng.integers(2)), anchor)


def advanced(rng: np.random.Generator, s: int = 4, step: int = 7) -> Advanced:
    """Numbers of a step, some of them zero, which leaves them out of the bytes; distances may be infinite."""
    some = [float(x) for x in rng.normal(size=8) * rng.integers(0, 2, size=8)]
    distance = rng.normal(size=5)
    distance[rng.integers(5)] = np.inf
    return Advanced(
        header=header(rng, step),
        status="converged",
        seam_x=rng.normal(size=(s, 3)),
        compliance=rng.normal(size=(3 * s, 3 * s)) if rng.integers(2) else np.zeros((0, 0)),
        wrench=rng.normal(size=(2, 6)),
        kinetic=some[0],
        strain=some[1],
        gravity=some[2],
        tool_work=some[3],
        seam_work=some[4],
        momentum=rng.normal(size=3),
        angular_momentum=rng.normal(size=3),
        penetration=some[5],
        slip=some[6],
        n_contacts=int(rng.integers(0, 400)),
        iterations=int(rng.integers(0, 3)),
        seconds=some[7],
        cell_distance=distance,
        bounds=rng.normal(size=(2, 3)),
    )


MAKERS: tuple[Callable[..., Message], ...] = (advance, advanced)


def bits(value: object) -> object:
    if isinstance(value, np.ndarray):
        flags = value.flags
        return value.shape, value.dtype, value.tobytes(), flags.c_contiguous, flags.aligned, flags.writeable
    if is_dataclass(value):
        return type(value), tuple(bits(getattr(value, field.name)) for field in fields(value))
    return type(value), value


def outcome(data: bytes) -> object:
    """What decoding gives: the message's bits, or the refusal's text."""
    try:
        return bits(decode(data, CLASSES))
    except ProtocolError as error:
        return type(error), str(error)


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bytes], object]]:
    """Decodes as if nothing had been learned."""
    layouts = codec._LAYOUTS

    def decode_anew(data: bytes) -> object:
        monkeypatch.setattr(codec, "_LAYOUTS", {})
        try:
            return outcome(data)
        finally:
            monkeypatch.setattr(codec, "_LAYOUTS", layouts)

    monkeypatch.setattr(codec, "_LAYOUTS", {cls: Layouts(cls) for cls in CLASSES})
    layouts = codec._LAYOUTS
    yield decode_anew


@pytest.mark.parametrize("make", MAKERS)
def test_the_same_messages_come_out(make: Callable[..., Message], without: Callable[[bytes], object]) -> None:
    """Random numbers, shapes that change, steps whose varints grow, zeros that are left out."""
    rng = np.random.default_rng(1)
    for n in range(400):
        message = make(rng, s=3 + n // 100, step=100 + n)
        data = encode(message)
        assert outcome(data) == without(data) == bits(message)


@pytest.mark.parametrize("make", MAKERS)
def test_layouts_are_learned_and_used(make: Callable[..., Message]) -> None:
    layouts = Layouts(make(np.random.default_rng(0)).__class__)
    met = [make(np.random.default_rng(5), step=step) for step in range(1, 10)]
    read = []
    for message in met:
        data = encode(message)
        read.append(layouts.read(data))
        if read[-1] is None:
            layouts.meet(data, message)
    assert [message is None for message in read] == [True] * 4 + [False] * 5
    assert [bits(message) for message in read[4:]] == [bits(message) for message in met[4:]]
    assert layouts.read(b"\0" * len(encode(met[0]))) is None


def test_what_is_seldom_met_is_forgotten() -> None:
    """Whoever sends messages of ever other lengths fills no memory."""
    learned: Learned[int, str] = Learned(4)
    for key in range(5000):
        learned.meet(key, lambda: "layout")
    assert len(learned._met) <= 1024 and not learned.known


@pytest.mark.parametrize("make", MAKERS)
def test_every_damaged_byte_is_judged_the_same(
    make: Callable[..., Message], without: Callable[[bytes], object]
) -> None:
    """Each byte of a message whose layout is known, changed in four ways: the same message or the same refusal."""
    data = encode(make(np.random.default_rng(3), s=2, step=300))
    for _ in range(5):
        decode(data)
    for at in range(len(data)):
        for change in (0x01, 0x7F, 0x80, 0xFF):
            damaged = bytearray(data)
            damaged[at] ^= change
            assert outcome(bytes(damaged)) == without(bytes(damaged)), (at, change)


@settings(max_examples=200, deadline=None)
@given(value=st.floats(width=64), where=st.sampled_from(["kinetic", "slip", "momentum", "seam_x", "cell_distance"]))
def test_numbers_that_are_not_finite_are_refused(value: float, where: str) -> None:
    """Also among numbers whose squares or sums overflow; distances may be infinite."""
    rng = np.random.default_rng(4)
    good = replace(advanced(rng), kinetic=1e308, slip=-1e308, strain=1.0)
    for _ in range(5):
        decode(encode(good))
    array = getattr(good, where)
    if isinstance(array, np.ndarray):
        changed = array.copy()
        changed.reshape(-1)[0] = value
        array = changed
    else:
        array = value
    message = replace(good, **{where: array})
    allowed = np.isfinite(value) or (where == "cell_distance" and value == np.inf)
    got = outcome(encode(message))
    assert (got == bits(message)) if allowed else (where in str(got) and "not a finite number" in str(got))


def test_messages_with_fields_are_left_to_the_codec(without: Callable[[bytes], object]) -> None:
    """They are decoded as ever, however often they come."""
    rng = np.random.default_rng(6)
    ids, none = np.arange(2, dtype=np.int32), np.zeros((0, 3))
    seen = Fields(header(rng, 1), ids, none[:0], none, np.zeros((0, 8, 6)), ids, none, none, ids)
    message = replace(advanced(rng), fields=seen)
    data = encode(message)
    for _ in range(20):
        assert outcome(data) == without(data) == bits(message)
