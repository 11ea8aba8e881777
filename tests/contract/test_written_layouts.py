"""Messages written by learned layouts have the bytes that protobuf gives; the same is refused with the same text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softseam_protocol import codec
from softseam_protocol.codec import decode, encode
from softseam_protocol.errors import EncodeError
from softseam_protocol.messages import SCHEMA_VERSION, Advance, Advanced, Fields, Header, ToolMotion
from softseam_protocol.written_layouts import WrittenLayouts

CLASSES = (Advance, Advanced)

numbers = st.sampled_from([0.0, -0.0, 1.5, float("inf"), float("nan"), 5e-324]) | st.floats(width=64)
counts = st.sampled_from([0, 1, 127, 128, 16383, 16384, 2**28, 2**40]) | st.integers(0, 300)
shapes = st.sampled_from([0, 2])


@st.composite
def arrays(draw: st.DrawFn, *shape: int) -> Any:
    values = np.full(shape, draw(numbers))
    if values.size and draw(st.booleans()):
        return np.asfortranarray(np.repeat(values, 2, axis=0)[::2])  # whose bytes lie in another order
    return values


@st.composite
def headers(draw: st.DrawFn) -> Header:
    session, name = draw(st.sampled_from(["", "a", "run"])), draw(st.sampled_from(["near", "far"]))
    return Header(SCHEMA_VERSION, session, name, draw(counts), draw(counts), draw(counts), draw(numbers))


@st.composite
def advances(draw: st.DrawFn) -> Advance:
    s, t, anchor = draw(shapes), draw(shapes), draw(shapes)
    motion = ToolMotion(*(draw(arrays(t, width)) for width in (3, 4, 3, 4)))
    flag = draw(st.booleans())
    force, held = draw(arrays(s, 3)), draw(arrays(anchor, 3))
    stiffness = draw(arrays(3 * anchor, 3 * anchor))
    fields, start = draw(st.booleans()), draw(arrays(draw(shapes), 3))
    return Advance(draw(headers()), draw(numbers), force, motion, flag, held, stiffness, fields, start)


@st.composite
def advanceds(draw: st.DrawFn) -> Advanced:
    s, t = draw(shapes), draw(shapes)
    return Advanced(
        header=draw(headers()),
        status=draw(st.sampled_from(["converged", "", "not: über 3"])),
        seam_x=draw(arrays(s, 3)),
        compliance=draw(arrays(3 * s, 3 * s)),
        wrench=draw(arrays(t, 6)),
        kinetic=draw(numbers),
        strain=draw(numbers),
        gravity=draw(numbers),
        tool_work=draw(numbers),
        seam_work=draw(numbers),
        momentum=draw(arrays(3)),
        angular_momentum=draw(arrays(3)),
        penetration=draw(numbers),
        slip=draw(numbers),
        n_contacts=draw(counts),
        iterations=draw(counts),
        seconds=draw(numbers),
        cell_distance=draw(arrays(draw(shapes))),
        bounds=draw(arrays(2, 3)),
        seam_force=draw(arrays(s, 3)),
        fields=None,
        n_crushed=draw(counts),
        residual=draw(numbers),
        alarm=draw(st.sampled_from(["", "sweeps 2: über 3"])),
        seam_v=draw(arrays(draw(shapes), 3)),
    )


@pytest.fixture(autouse=True)
def nothing_learned() -> Iterator[None]:
    kept = codec._WRITTEN
    codec._WRITTEN = {cls: WrittenLayouts(cls) for cls in CLASSES}
    yield
    codec._WRITTEN = kept


def plain(message: Any) -> bytes | str:
    """The bytes that protobuf gives without anything learned, or the refusal's text."""
    kept, codec._WRITTEN = codec._WRITTEN, {}
    try:
        return written(message)
    finally:
        codec._WRITTEN = kept


def written(message: Any) -> bytes | str:
    try:
        return encode(message)
    except EncodeError as error:
        return str(error)


def learn(message: Any) -> None:
    """Teach the layout of this message."""
    for _ in range(4):
        encode(message)
    assert codec._WRITTEN[type(message)].write(message) == plain(message)


@settings(max_examples=150, deadline=None)
@given(known=advances() | advanceds(), others=st.lists(advances() | advanceds(), max_size=4))
def test_the_bytes_are_those_of_protobuf(known: Any, others: list[Any]) -> None:
    """Of any messages in any order: zeros of both signs, counts of any length, shapes, texts, orders in memory."""
    for message in [known] * 5 + others + [known]:
        assert written(message) == plain(message)


@settings(max_examples=150, deadline=None)
@given(known=advanceds(), data=st.data())
def test_a_message_that_differs_in_some_fields(known: Any, data: st.DataObject) -> None:
    """What is like a known message but for some fields: one number left out, one byte more, another shape."""
    names = [name for name in known.__dataclass_fields__ if name != "fields"]
    for _ in range(4):
        encode(known)
    for changed in data.draw(st.lists(st.sets(st.sampled_from(names), max_size=2), min_size=1, max_size=3)):
        change = {name: data.draw(like(known, name)) for name in sorted(changed)}
        message = replace(known, **change)
        assert written(message) == plain(message)


def like(known: Advanced, name: str) -> st.SearchStrategy[Any]:
    """Another value of a field of its kind, and of arrays also of another length."""
    value = getattr(known, name)
    if isinstance(value, np.ndarray):
        if name in ("momentum", "angular_momentum", "bounds"):
            return arrays(*value.shape)
        square = name == "compliance"
        return st.sampled_from([0, 2, 6]).flatmap(lambda n: arrays(n, n) if square else arrays(n, *value.shape[1:]))
    if isinstance(value, str):
        return st.sampled_from(["converged", "", "not: über 3"])
    return headers() if isinstance(value, Header) else counts if isinstance(value, int) else numbers


def example(step: int = 7) -> Advanced:
    x = np.arange(6.0).reshape(2, 3)
    head = Header(SCHEMA_VERSION, "run", "near", 2, step, 0, 0.5)
    return Advanced(
        head,
        "converged",
        x,
        np.eye(6),
        np.ones((1, 6)),
        *(1.0, 2.0, 3.0, 0.0, 5.0),
        x[0],
        x[1],
        *(0.0, 1e-3, 4, 130, 2e-3),
        np.ones(3),
        x,
    )


@pytest.mark.parametrize(
    "change",
    [
        {"kinetic": "much"},
        {"kinetic": 3},
        {"kinetic": None},
        {"kinetic": True},
        {"kinetic": np.bool_(True)},
        {"kinetic": np.float32(0.1)},
        {"kinetic": np.array(0.1)},
        {"kinetic": np.array([0.1])},
        {"kinetic": np.array([0.1, 0.2])},
        {"kinetic": -0.0},
        {"kinetic": 10**400},
        {"tool_work": True},
        {"tool_work": False},
        {"tool_work": -0.0},
        {"tool_work": "0"},
        {"tool_work": np.bool_(False)},
        {"tool_work": np.array(0.0)},
        {"tool_work": np.float32(0.1)},
        {"n_crushed": 127},
        {"n_crushed": 128},
        {"n_crushed": None},
        {"n_contacts": 0},
        {"n_contacts": 4.0},
        {"n_contacts": np.int64(5)},
        {"n_contacts": True},
        {"n_contacts": -1},
        {"iterations": "130"},
        {"iterations": np.float64(131.0)},
        {"iterations": np.uint8(131)},
        {"status": b"converged"},
        {"status": None},
        {"seam_x": np.zeros((2, 3), np.float32)},
        {"seam_x": np.zeros((2, 3), ">f8")},
        {"seam_x": np.zeros((2, 3)).tolist()},
        {"seam_x": np.ma.zeros((2, 3))},
        {"momentum": np.zeros(4)},
        {"seam_force": None},
        {"seam_force": np.zeros((0, 4))},
        {"seam_force": np.zeros((0, 3), np.int32)},
        {"header": None},
        {"header": Header(1, "run", "near", 2, 7, False, 0.5)},
        {"header": Header(1.0, "run", "near", 2, 7, 0, 0.5)},  # type: ignore[arg-type]
        {"header": Header(1, ["run"], "near", 2, 7, 0, 0.5)},  # type: ignore[arg-type]
        {"header": Header(1, "run", "near", 2, 7, 0.0, 0.5)},  # type: ignore[arg-type]
        {"fields": "all"},
    ],
    ids=str,
)
def test_what_is_not_what_it_is_declared_to_be(change: dict[str, Any]) -> None:
    """It gets the bytes, or the refusal, that it gets from the codec."""
    known = example()
    learn(known)
    message = replace(known, **change)
    assert written(message) == plain(message)


def test_layouts_are_learned_and_used() -> None:
    """From the fifth message on, for every sender; a change of shape or length is learned as well."""
    layouts = WrittenLayouts(Advanced)
    known = []
    for step in [*range(1, 9), *range(200, 208)]:
        for name in ("near", "far"):
            message = example(step)
            message = replace(message, header=replace(message.header, participant=name))
            data = layouts.write(message)
            known.append(data is not None)
            assert data in (None, plain(message))
            if data is None:
                layouts.meet(encode(message), message)
    assert known == ([False] * 8 + [True] * 8) * 2


def test_senders_are_forgotten_when_there_are_many() -> None:
    layouts = WrittenLayouts(Advanced)
    for n in range(200):
        message = replace(example(), header=Header(SCHEMA_VERSION, f"s{n}", "near", 2, 7, 0, 0.5))
        for _ in range(4):
            layouts.meet(encode(message), message)
        assert layouts.write(message) == plain(message)
        assert len(layouts._learned.known) <= 64


def test_messages_with_fields_are_left_to_the_codec() -> None:
    """They are written as ever, however often they come, and keep nobody from learning."""
    ids, none = np.arange(2, dtype=np.int32), np.zeros((0, 3))
    seen = Fields(example().header, ids, none[:0], none, np.zeros((0, 8, 6)), ids, none, none, ids)
    message = replace(example(), fields=seen)
    for _ in range(20):
        assert encode(message) == plain(message)
        assert codec._WRITTEN[Advanced].write(message) is None
    learn(example())
    assert encode(message) == plain(message)
    assert decode(encode(message), Advanced).fields is not None
