"""Bytes that are no message: refused with the field and the reason, and whatever they are, they do no harm."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sample_messages import HEADER, TOOLS, advanced

from softseam_protocol.errors import DecodeError, EncodeError, SchemaMismatch
from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Advance, Advanced, Commit, Committed, Failure, Reply, Request
from softseam_protocol.messages.session import Observation, Step
from softseam_protocol.wire import codec
from softseam_protocol.wire.codec import decode, encode
from softseam_protocol.wire.descriptors import FIELDS, MESSAGES, PACKAGE, protobuf_class


def tampered(cls: type, message: Any, change: Any) -> bytes:
    """The bytes of `message` after `change(protobuf message)`."""
    wire = protobuf_class(cls.__name__).FromString(encode(message))
    change(wire)
    return bytes(wire.SerializeToString())


def _set(path: str, value: Any) -> Any:
    def change(wire: Any) -> None:
        *parents, last = path.split(".")
        for name in parents:
            wire = getattr(wire, name)
        if last == "shape":
            del wire.shape[:]
            wire.shape.extend(value)
        else:
            setattr(wire, last, value)

    return change


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (_set("coupling.x.dtype", "f4"), r"Coupled\.x: dtype 'f4' where 'f8' belongs"),
        (_set("coupling.x.dtype", "O"), r"Coupled\.x: dtype 'O'"),
        (_set("coupling.x.dtype", ">f8"), r"Coupled\.x: dtype"),
        (_set("coupling.x.shape", [12]), r"Coupled\.x: 1 axes"),
        (_set("coupling.x.shape", [2] * 100), r"Coupled\.x: 100 axes"),
        (_set("coupling.x.shape", [3, 4]), r"Coupled\.x: shape \(3, 4\)"),
        (_set("coupling.x.shape", [5, 3]), r"Coupled\.x: shape \(5, 3\) needs 120 bytes, but 96 came"),
        # 2**61 * 8 is 0 in 64 bits
        (
            _set("coupling.compliance.shape", [2**61, 1]),
            r"Coupled\.compliance: shape .* needs 18446744073709551616 bytes",
        ),
        (_set("coupling.compliance.shape", [2**63, 0]), r"Coupled\.compliance: shape .* too long"),
        (_set("coupling.x.data", b""), r"Coupled\.x: shape \(4, 3\) needs 96 bytes, but 0 came"),
        (_set("coupling.x.data", np.full(12, np.nan).tobytes()), r"Coupled\.x: entry 0 is nan"),
        (_set("coupling.x.data", np.full(12, -np.inf).tobytes()), r"Coupled\.x: entry 0 is -inf"),
        (_set("kinetic", float("nan")), r"Advanced\.kinetic: nan is not a finite number"),
        (lambda wire: wire.extras.update(slip=float("inf")), r"Advanced\.extras: inf"),
        (_set("status", "fine"), r"Advanced\.status: 'fine' is none of converged, refused"),
        (lambda wire: wire.alarms.update(odd="1"), r"Advanced\.alarms: 'odd' is none of"),
        (_set("header.step", -1), r"Advanced: Header\.step: -1 is less than 0"),
        (_set("header.session", "../../etc"), r"Header\.session: '\.\./\.\./etc' is not a name"),
        (_set("header.session", "a*"), r"Header\.session"),
        (lambda wire: wire.ClearField("header"), r"Advanced\.header: missing"),
        (lambda wire: wire.ClearField("wrench"), r"Advanced\.wrench: missing"),
    ],
)
def test_a_bad_field_is_named(change: Any, text: str) -> None:
    with pytest.raises(DecodeError, match=text):
        decode(tampered(Advanced, advanced(), change), Reply)


def test_negative_ids_are_refused_where_they_mean_nothing() -> None:
    # written by a sender that checks nothing
    wire = protobuf_class("Fields").FromString(b"")
    wire.message_type = "softseam.v4.Fields"
    wire.header.schema = SCHEMA_VERSION
    for name, shape in {"nodes": [2], "x": [0, 3], "v": [0, 3], "cauchy": [0, 8, 6], "points": [0], "point_x": [0, 3],
                        "contact_force": [0, 3], "contact_tool": [1]}.items():  # fmt: skip
        tensor = getattr(wire, name)
        tensor.dtype = "i4" if name in ("nodes", "points", "contact_tool") else "f8"
        tensor.shape.extend(shape)
    wire.contact_tool.data = np.array([-1], np.int32).tobytes()
    wire.nodes.data = np.array([0, 7], np.int32).tobytes()
    decode(wire.SerializeToString())
    wire.nodes.data = np.array([3, -1], np.int32).tobytes()
    with pytest.raises(DecodeError, match=r"Fields\.nodes: entry 1 is -1, less than 0"):
        decode(wire.SerializeToString())


def test_another_schema_version_is_a_mismatch() -> None:
    newer = encode(Committed(HEADER)).replace(b"softseam.v4.", b"softseam.v5.")
    with pytest.raises(SchemaMismatch, match="schema version 5, this one speaks 4: install the same version"):
        decode(newer, Reply)
    with pytest.raises(SchemaMismatch, match="schema version 7"):
        decode(encode(Committed(dataclasses.replace(HEADER, schema=7))), Reply)


def test_a_foreign_message_is_named() -> None:
    with pytest.raises(DecodeError, match="type Committed where one of these belongs: Configure, Advance"):
        decode(encode(Committed(HEADER)), Request)
    with pytest.raises(DecodeError, match="type Committed where one of these belongs: Commit"):
        decode(encode(Committed(HEADER)), Commit)
    with pytest.raises(DecodeError, match=r"unknown message type 'softseam\.v4\.Nonsense'"):
        decode(b"\x0a\x14softseam.v4.Nonsense", Request)
    for foreign in (b"", b"hello", b"{}", b"\x00" * 100, encode(Committed(HEADER))[1:]):
        with pytest.raises(DecodeError, match="not a softseam message"):
            decode(foreign, Request)


def test_an_oversized_message_is_refused_before_it_is_parsed(monkeypatch: pytest.MonkeyPatch) -> None:
    data = encode(advanced(75))
    monkeypatch.setattr(codec, "MAX_BYTES", len(data) - 1)
    with pytest.raises(DecodeError, match="more than the"):
        decode(data, Advanced)
    with pytest.raises(EncodeError, match="more than the"):
        encode(advanced(75))


# ---- fuzz ---------------------------------------------------------------------------------------------------

_SAMPLES = [
    encode(advanced(3)),
    encode(Advance(HEADER, 0.01, np.ones((3, 3)), TOOLS)),
    encode(Step(HEADER, 1, False, {"left": np.ones(3)})),
    encode(Failure(FailureKind.STALE, "text")),
]


def harmless(data: bytes) -> None:
    """Decode; whatever gets through has honest arrays."""
    try:
        message = decode(data)
    except (DecodeError, SchemaMismatch):
        return
    for field in FIELDS[type(message)]:
        if field.is_array and not field.container:
            value = getattr(message, field.name)
            assert value.dtype == field.of.dtype and value.ndim == len(field.of.shape)
            assert not np.isnan(value).any()


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=300))
@example(b"\x0a")
@example(b"\x0a\x80")
@example(b"\x0b" * 200)
def test_random_bytes_do_no_harm(data: bytes) -> None:
    harmless(data)


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(sorted(MESSAGES)), st.binary(max_size=300))
def test_random_bytes_after_a_true_name_do_no_harm(name: str, data: bytes) -> None:
    full = f"{PACKAGE}.{name}".encode()
    harmless(b"\x0a" + bytes([len(full)]) + full + data)


@pytest.mark.parametrize("index", range(len(_SAMPLES)))
def test_every_truncation_does_no_harm(index: int) -> None:
    sample = _SAMPLES[index]
    for length in range(len(sample)):
        harmless(sample[:length])


@settings(max_examples=500, deadline=None)
@given(
    st.sampled_from(_SAMPLES), st.lists(st.tuples(st.integers(0, 2**16), st.integers(1, 255)), min_size=1, max_size=8)
)
def test_flipped_bits_do_no_harm(sample: bytes, flips: list[tuple[int, int]]) -> None:
    data = bytearray(sample)
    for place, mask in flips:
        data[place % len(data)] ^= mask
    harmless(bytes(data))


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(_SAMPLES), st.sampled_from(_SAMPLES), st.integers(0, 2**16), st.integers(0, 2**16))
def test_spliced_messages_do_no_harm(a: bytes, b: bytes, i: int, j: int) -> None:
    harmless(a[: i % len(a)] + b[j % len(b) :])


def test_nested_messages_are_checked_too() -> None:
    def change(wire: Any) -> None:
        wire.tools.position.data = np.full(6, np.nan).tobytes()

    advance = Advance(HEADER, 0.01, np.ones((3, 3)), TOOLS)
    with pytest.raises(DecodeError, match=r"Advance: ToolMotion\.position: entry 0 is nan"):
        decode(tampered(Advance, advance, change), Request)
    assert Observation in FIELDS
