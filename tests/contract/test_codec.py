"""The codec: every message goes there and back, and no bytes whatever do harm."""

from __future__ import annotations

import dataclasses
import functools
import string
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from softseam_protocol import codec
from softseam_protocol.codec import decode, encode, file_descriptor_set, full_name, peek
from softseam_protocol.descriptors import FIELDS, MESSAGES, PACKAGE, Field, protobuf_class
from softseam_protocol.errors import DecodeError, EncodeError, SchemaMismatch
from softseam_protocol.messages import (
    SCHEMA_VERSION,
    Advance,
    Advanced,
    Array,
    Bundle,
    Commit,
    Committed,
    Failure,
    Header,
    Observation,
    Reply,
    Request,
    Step,
    ToolMotion,
)

HEADER = Header(SCHEMA_VERSION, "s", "near", 0, 3, 1, 0.02)


def advanced(n_seam: int = 4, **changes: Any) -> Advanced:
    rng = np.random.default_rng(1)
    message = Advanced(
        HEADER, "converged", rng.random((n_seam, 3)), np.zeros((0, 0)), rng.random((3, 6)), 1.0, 2.0, 3.0, 4.0, 5.0,
        rng.random(3), rng.random(3), 0.1, 0.2, 5, 6, 0.1, rng.random(64), rng.random((2, 3)),
    )  # fmt: skip
    return dataclasses.replace(message, **changes)


# ---- every message, any content ----------------------------------------------------------------------------

_NAMES = st.text(string.ascii_letters + string.digits + "_-", max_size=64)


_SPECIAL = [0.0, -0.0, 5e-324, 1.0, -1e308, 1e308]


def _array(array: Array) -> st.SearchStrategy[Any]:
    def fill(lengths: list[int], seed: int) -> Any:
        rng = np.random.default_rng(seed)
        shape = [n if fixed is None else fixed for n, fixed in zip(lengths, array.shape, strict=True)]
        if array.dtype.kind == "f":
            return rng.choice([*_SPECIAL, *rng.normal(size=6)], shape)
        ends = np.iinfo(array.dtype)
        low = ends.min if array.least is None else array.least
        return rng.integers(low, ends.max, shape, array.dtype, endpoint=True)

    lengths = st.lists(st.integers(0, 4), min_size=len(array.shape), max_size=len(array.shape))
    return st.builds(fill, lengths, st.integers(0, 2**32))


def _value(field: Field) -> st.SearchStrategy[Any]:
    if isinstance(field.of, Array):
        one = _array(field.of)
    elif field.is_message:
        one = st.deferred(lambda: messages(field.of))
    elif field.of is int:
        one = st.integers(-(2**63) if field.least is None else field.least, 2**63 - 1)
    elif field.of is str:
        one = _NAMES if field.named else st.text(max_size=20)
    else:
        one = {float: st.floats(allow_nan=False, allow_infinity=False), bool: st.booleans(), bytes: st.binary()}[
            field.of
        ]
    if field.container == "list":
        return st.lists(one, max_size=2)
    if field.container == "map":
        return st.dictionaries(st.text(max_size=8), one, max_size=2)
    return st.none() | one if field.optional else one


@functools.cache
def messages(cls: type) -> st.SearchStrategy[Any]:
    fields = {f.name: _value(f) for f in FIELDS[cls]}
    if cls is Header:
        fields["schema"] = st.just(SCHEMA_VERSION)
    return st.builds(cls, **fields)


def same(a: Any, b: Any) -> bool:
    """Equality to the last bit, arrays and types included."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(v, b[k]) for k, v in a.items())
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and bool(a == b) and repr(a) == repr(b)


@pytest.mark.parametrize("cls", MESSAGES.values(), ids=MESSAGES)
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_every_message_goes_there_and_back(cls: type, data: st.DataObject) -> None:
    message = data.draw(messages(cls))
    encoded = encode(message)
    assert peek(encoded) is cls
    decoded: Any = decode(encoded, cls)
    assert same(decoded, message)
    assert encode(decoded) == encoded


@pytest.mark.parametrize("cls", MESSAGES.values(), ids=MESSAGES)
def test_an_embedded_descriptor_is_enough_to_read_a_payload(cls: type) -> None:
    """What a recording holds, read by someone who has nothing else: no file of ours, no package of ours."""
    files = descriptor_pb2.FileDescriptorSet.FromString(file_descriptor_set(cls))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    foreign = message_factory.GetMessageClass(pool.FindMessageTypeByName(full_name(cls)))
    assert [f.name for f in foreign.DESCRIPTOR.fields] == ["message_type", *(f.name for f in FIELDS[cls])]
    if cls is Advanced:
        message = advanced()
        read = foreign.FromString(encode(message))
        assert read.message_type == "softseam.v1.Advanced" and read.header.step == 3 and read.n_contacts == 5
        assert list(read.seam_x.shape) == [4, 3] and read.seam_x.dtype == "f8"
        np.testing.assert_array_equal(np.frombuffer(read.seam_x.data).reshape(4, 3), message.seam_x)
        # and what a foreigner writes is read by us, whatever the order of its fields
        moved = read.SerializeToString()
        first = 2 + len("softseam.v1.Advanced")
        assert same(decode(moved, Advanced), message)
        assert same(decode(moved[first:] + moved[:first], Advanced), message)


def test_equal_messages_have_equal_bytes_in_every_process() -> None:
    """A repeated request is recognised by its bytes; protobuf orders maps differently in each process."""
    program = (
        "import sys\nfrom softseam_protocol.codec import encode\nfrom softseam_protocol.messages import Bundle\n"
        "names = [f'file{i}' for i in range(50)]\n"
        "print(encode(Bundle('', {n: n.encode() for n in names[::int(sys.argv[1])]})).hex())"
    )
    runs = [
        subprocess.run([sys.executable, "-c", program, order], capture_output=True, text=True, timeout=60, check=True)
        for order in ("1", "-1", "1")
    ]
    assert len({run.stdout for run in runs}) == 1
    files = decode(bytes.fromhex(runs[0].stdout), Bundle).files
    assert list(files) == sorted(files)


def test_decoded_arrays_are_aligned_writable_and_contiguous() -> None:
    decoded: Advanced = decode(encode(advanced(75)), Advanced)
    for f in FIELDS[Advanced]:
        if f.is_array:
            flags = getattr(decoded, f.name).flags
            assert flags.c_contiguous and flags.aligned and flags.writeable


def test_strided_arrays_are_sent_in_c_order() -> None:
    x = np.arange(24.0).reshape(4, 6)[:, ::2]
    f = np.asfortranarray(np.arange(12.0).reshape(4, 3))
    assert same(decode(encode(advanced(seam_x=x)), Advanced).seam_x, np.ascontiguousarray(x))
    assert same(decode(encode(advanced(seam_x=f)), Advanced).seam_x, np.ascontiguousarray(f))


def test_an_absent_scalar_means_its_default() -> None:
    """Fields appended later must not change what older senders meant."""
    wire = protobuf_class("Step").FromString(encode(Step(HEADER, 1, True, {}, fields=False)))
    assert decode(wire.SerializeToString(), Step).fields is False
    wire.ClearField("fields")
    assert decode(wire.SerializeToString(), Step).fields is True


def test_an_absent_array_means_its_default() -> None:
    """An array appended later has a default, which stands for it in the messages of older senders."""
    messages: tuple[Any, ...] = (advanced(), Advance(HEADER, 0.01, np.ones((3, 3)), _TOOLS))
    for message in messages:
        cls = type(message)
        appended = [field for field in FIELDS[cls] if field.is_array and field.make_default is not None]
        assert appended
        for field in appended:
            full = tuple(2 if n is None else n for n in field.of.shape)
            told = encode(dataclasses.replace(message, **{field.name: np.ones(full)}))
            wire = protobuf_class(cls.__name__).FromString(told)
            assert wire.HasField(field.name)
            assert same(getattr(decode(told, cls), field.name), np.ones(full))
            wire.ClearField(field.name)
            assert same(getattr(decode(wire.SerializeToString(), cls), field.name), field.make_default())
            # and an empty default is not sent at all
            assert not protobuf_class(cls.__name__).FromString(encode(message)).HasField(field.name)
            with pytest.raises(EncodeError, match=f"{cls.__name__}.{field.name}"):
                encode(dataclasses.replace(message, **{field.name: np.zeros((0, 7, 7))}))


def test_distances_may_be_infinite_but_nothing_may_be_nan() -> None:
    far = np.full(3, np.inf)
    assert same(decode(encode(advanced(cell_distance=far)), Advanced).cell_distance, far)
    with pytest.raises(DecodeError, match=r"Advanced\.cell_distance: entry 0 is nan"):
        decode(encode(advanced(cell_distance=np.array([np.nan]))), Advanced)


def test_huge_but_finite_numbers_pass() -> None:
    """The fast test of finiteness overflows on them; the exact one decides."""
    huge = np.array([1e308, -1e308, 1e300])
    assert same(decode(encode(advanced(momentum=huge)), Advanced).momentum, huge)


# ---- wrong content of our own: EncodeError ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"seam_x": np.zeros((4, 2))}, r"Advanced\.seam_x: shape \(4, 2\) where f8 \(n, 3\) belongs"),
        ({"seam_x": np.zeros((4, 3), np.float32)}, r"Advanced\.seam_x: float32 \(4, 3\) where f8 \(n, 3\) belongs"),
        ({"seam_x": np.zeros((4, 3), ">f8")}, r"Advanced\.seam_x"),
        ({"seam_x": [[1.0, 2.0, 3.0]]}, r"Advanced\.seam_x: list where f8"),
        ({"momentum": np.zeros((1, 3))}, r"Advanced\.momentum"),
        ({"kinetic": "1"}, r"Advanced\.kinetic"),
        ({"kinetic": None}, r"Advanced\.kinetic"),
        ({"n_contacts": 1.5}, r"Advanced\.n_contacts"),
        ({"n_contacts": 2**63}, r"Advanced\.n_contacts"),
        ({"status": b"\xff"}, r"Advanced\.status"),
        ({"status": "\ud800"}, r"Advanced"),
        ({"header": None}, r"Advanced\.header: NoneType where Header belongs"),
        ({"header": Failure("a", "b")}, r"Advanced\.header: Failure where Header belongs"),
    ],
)
def test_a_wrong_field_of_ours_is_named(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(EncodeError, match=text):
        encode(advanced(**changes))


def test_only_messages_are_encoded() -> None:
    with pytest.raises(EncodeError, match="dict is not a message"):
        encode({})


# ---- wrong bytes: DecodeError -------------------------------------------------------------------------------


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
        (_set("seam_x.dtype", "f4"), r"Advanced\.seam_x: dtype 'f4' where 'f8' belongs"),
        (_set("seam_x.dtype", "O"), r"Advanced\.seam_x: dtype 'O'"),
        (_set("seam_x.dtype", ">f8"), r"Advanced\.seam_x: dtype"),
        (_set("seam_x.shape", [12]), r"Advanced\.seam_x: 1 axes"),
        (_set("seam_x.shape", [2] * 100), r"Advanced\.seam_x: 100 axes"),
        (_set("seam_x.shape", [3, 4]), r"Advanced\.seam_x: shape \(3, 4\)"),
        (_set("seam_x.shape", [5, 3]), r"Advanced\.seam_x: shape \(5, 3\) needs 120 bytes, but 96 came"),
        # 2**61 * 8 is 0 in 64 bits
        (_set("compliance.shape", [2**61, 1]), r"Advanced\.compliance: shape .* needs 18446744073709551616 bytes"),
        (_set("compliance.shape", [2**63, 0]), r"Advanced\.compliance: shape .* too long"),
        (_set("seam_x.data", b""), r"Advanced\.seam_x: shape \(4, 3\) needs 96 bytes, but 0 came"),
        (_set("seam_x.data", np.full(12, np.nan).tobytes()), r"Advanced\.seam_x: entry 0 is nan"),
        (_set("seam_x.data", np.full(12, -np.inf).tobytes()), r"Advanced\.seam_x: entry 0 is -inf"),
        (_set("kinetic", float("nan")), r"Advanced\.kinetic: nan is not a finite number"),
        (_set("slip", float("inf")), r"Advanced\.slip: inf"),
        (_set("n_contacts", -1), r"Advanced\.n_contacts: -1 is less than 0"),
        (_set("header.step", -1), r"Advanced: Header\.step: -1 is less than 0"),
        (_set("header.session", "../../etc"), r"Header\.session: '\.\./\.\./etc' is not a name"),
        (_set("header.session", "a*"), r"Header\.session"),
        (lambda wire: wire.ClearField("header"), r"Advanced\.header: missing"),
        (lambda wire: wire.ClearField("seam_x"), r"Advanced\.seam_x: missing"),
    ],
)
def test_a_bad_field_is_named(change: Any, text: str) -> None:
    with pytest.raises(DecodeError, match=text):
        decode(tampered(Advanced, advanced(), change), Reply)


def test_negative_ids_are_refused_where_they_mean_nothing() -> None:
    # written by a sender that checks nothing
    wire = protobuf_class("Fields").FromString(b"")
    wire.message_type = "softseam.v1.Fields"
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
    newer = encode(Committed(HEADER)).replace(b"softseam.v1.", b"softseam.v2.")
    with pytest.raises(SchemaMismatch, match="schema version 2, this one speaks 1: install the same version"):
        decode(newer, Reply)
    with pytest.raises(SchemaMismatch, match="schema version 7"):
        decode(encode(Committed(dataclasses.replace(HEADER, schema=7))), Reply)


def test_a_foreign_message_is_named() -> None:
    with pytest.raises(DecodeError, match="type Committed where one of these belongs: Configure, Advance"):
        decode(encode(Committed(HEADER)), Request)
    with pytest.raises(DecodeError, match="type Committed where one of these belongs: Commit"):
        decode(encode(Committed(HEADER)), Commit)
    with pytest.raises(DecodeError, match=r"unknown message type 'softseam\.v1\.Nonsense'"):
        decode(b"\x0a\x14softseam.v1.Nonsense", Request)
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

_TOOLS = ToolMotion(np.zeros((2, 3)), np.zeros((2, 4)), np.zeros((2, 3)), np.zeros((2, 4)))
_SAMPLES = [
    encode(advanced(3)),
    encode(Advance(HEADER, 0.01, np.ones((3, 3)), _TOOLS)),
    encode(Step(HEADER, 1, False, {"left": np.ones(3)})),
    encode(Failure("stale", "text")),
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

    advance = Advance(HEADER, 0.01, np.ones((3, 3)), _TOOLS)
    with pytest.raises(DecodeError, match=r"Advance: ToolMotion\.position: entry 0 is nan"):
        decode(tampered(Advance, advance, change), Request)
    assert Observation in FIELDS
