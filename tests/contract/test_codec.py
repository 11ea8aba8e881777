"""The codec: every message goes there and back, and no bytes whatever do harm."""

from __future__ import annotations

import dataclasses
import functools
import string
import subprocess
import sys
from typing import Any, cast

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sample_messages import HEADER, TOOLS, advanced

from softseam_protocol.errors import DecodeError, EncodeError
from softseam_protocol.messages.arrays import Array
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import FailureKind
from softseam_protocol.messages.participant import Advance, Advanced, Bundle, Coupled, Failure
from softseam_protocol.messages.session import Step
from softseam_protocol.wire.codec import decode, encode, file_descriptor_set, full_name, peek
from softseam_protocol.wire.descriptors import FIELDS, MESSAGES, Field, protobuf_class

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
    elif field.is_enum:
        one = st.sampled_from(list(field.of))
    elif field.of is str:
        one = _NAMES if field.named else st.text(max_size=20)
    else:
        one = {float: st.floats(allow_nan=False, allow_infinity=False), bool: st.booleans(), bytes: st.binary()}[
            field.of
        ]
    if field.container == "list":
        return st.lists(one, max_size=2)
    if field.container == "map":
        keys = st.text(max_size=8) if field.key is str else st.sampled_from(list(field.key))
        return st.dictionaries(keys, one, max_size=2)
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
        assert (
            read.message_type == "softseam.v4.Advanced" and read.header.step == 3 and read.extras["n_contacts"] == 5.0
        )
        assert list(read.coupling.x.shape) == [4, 3] and read.coupling.x.dtype == "f8"
        np.testing.assert_array_equal(np.frombuffer(read.coupling.x.data).reshape(4, 3), message.coupling.x)
        # and what a foreigner writes is read by us, whatever the order of its fields
        moved = read.SerializeToString()
        first = 2 + len("softseam.v4.Advanced")
        assert same(decode(moved, Advanced), message)
        assert same(decode(moved[first:] + moved[:first], Advanced), message)


@pytest.mark.kernels
def test_equal_messages_have_equal_bytes_in_every_process() -> None:
    """A repeated request is recognised by its bytes; protobuf orders maps differently in each process."""
    program = (
        "import sys\nfrom softseam_protocol.wire.codec import encode\n"
        "from softseam_protocol.messages.participant import Bundle\n"
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
    assert same(decode(encode(advanced(coupling=Coupled(x))), Advanced).coupling.x, np.ascontiguousarray(x))
    assert same(decode(encode(advanced(coupling=Coupled(f))), Advanced).coupling.x, np.ascontiguousarray(f))


def test_an_absent_scalar_means_its_default() -> None:
    """Fields appended later must not change what older senders meant."""
    wire = protobuf_class("Step").FromString(encode(Step(HEADER, 1, True, {}, fields=False)))
    assert decode(wire.SerializeToString(), Step).fields is False
    wire.ClearField("fields")
    assert decode(wire.SerializeToString(), Step).fields is True


def test_an_absent_array_means_its_default() -> None:
    """An array appended later has a default, which stands for it in the messages of older senders."""
    messages: tuple[Any, ...] = (Coupled(), Advance(HEADER, 0.01, np.ones((3, 3)), TOOLS))
    for message in messages:
        cls = type(message)
        appended = [field for field in FIELDS[cls] if field.is_array and field.make_default is not None]
        assert appended
        for field in appended:
            full = np.ones(tuple(2 if n is None else n for n in field.of.shape), dtype=field.of.dtype)
            told = encode(dataclasses.replace(message, **{field.name: full}))
            wire = protobuf_class(cls.__name__).FromString(told)
            assert wire.HasField(field.name)
            assert same(getattr(decode(told, cls), field.name), full)
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
        ({"wrench": np.zeros((4, 2))}, r"Advanced\.wrench: shape \(4, 2\) where f8 \(n, 6\) belongs"),
        (
            {"wrench": np.zeros((4, 6), np.float32)},
            r"Advanced\.wrench: float32 \(4, 6\) where f8 \(n, 6\) belongs",
        ),
        ({"wrench": np.zeros((4, 6), ">f8")}, r"Advanced\.wrench"),
        ({"coupling": Coupled(cast(Any, [[1.0, 2.0, 3.0]]))}, r"Coupled\.x: list where f8"),
        ({"momentum": np.zeros((1, 3))}, r"Advanced\.momentum"),
        ({"kinetic": "1"}, r"Advanced\.kinetic"),
        ({"kinetic": None}, r"Advanced\.kinetic"),
        ({"extras": {"slip": "1"}}, r"Advanced"),
        ({"header": dataclasses.replace(HEADER, step=2**63)}, r"Header\.step"),
        ({"status": b"\xff"}, r"Advanced\.status"),
        ({"status": "\ud800"}, r"Advanced"),
        ({"header": None}, r"Advanced\.header: NoneType where Header belongs"),
        ({"header": Failure(FailureKind.INVALID, "b")}, r"Advanced\.header: Failure where Header belongs"),
    ],
)
def test_a_wrong_field_of_ours_is_named(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(EncodeError, match=text):
        encode(advanced(**changes))


def test_only_messages_are_encoded() -> None:
    with pytest.raises(EncodeError, match="dict is not a message"):
        encode({})
