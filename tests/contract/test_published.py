"""What is published stays what it was, and says what the code does."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from google.protobuf import descriptor_pb2

from softseam_protocol import publish
from softseam_protocol.messages.header import Header
from softseam_protocol.publish import broken_promises, field_lines, proto_text
from softseam_protocol.scene.file import scene_schema
from softseam_protocol.topics import SESSION_TOPICS, Keys, table, topic_of
from softseam_protocol.wire.descriptors import MESSAGES, file_descriptor_set

ROOT = Path(__file__).parents[2]
REMEDY = "run `python -m softseam_protocol.publish`"


def test_the_proto_file_is_up_to_date() -> None:
    assert (ROOT / publish.PROTO).read_text() == proto_text(), REMEDY


def test_the_json_schema_is_up_to_date() -> None:
    assert (ROOT / publish.SCHEMA).read_text() == scene_schema(), REMEDY


def test_no_published_field_has_changed() -> None:
    locked = (ROOT / publish.LOCK).read_text().splitlines()
    assert not broken_promises(locked, field_lines()), "append fields, never change them"
    assert locked == field_lines(), REMEDY


@pytest.mark.parametrize(
    ("change", "broken"),
    [
        (lambda lines: lines[1:], True),
        (lambda lines: [lines[0].replace("= 2", "= 3"), *lines[1:]], True),
        (lambda lines: [lines[0].replace("int64", "double"), *lines[1:]], True),
        (lambda lines: [*lines, "Header.host = 9: string"], False),
    ],
)
def test_the_lock_sees_what_it_must(change: object, broken: bool) -> None:
    lines = field_lines()
    assert bool(broken_promises(lines, change(lines))) is broken  # type: ignore[operator]


def test_publishing_refuses_to_break_a_promise(tmp_path: Path) -> None:
    publish.publish(tmp_path)
    lock = tmp_path / publish.LOCK
    lock.write_text(lock.read_text() + "Header.gone = 99: string\n")
    with pytest.raises(ValueError, match=r"Header\.gone = 99"):
        publish.publish(tmp_path)


def test_the_proto_file_declares_what_recordings_embed() -> None:
    """The text and the descriptors are made by different code: compare them name by name."""
    (file,) = descriptor_pb2.FileDescriptorSet.FromString(file_descriptor_set(Header)).file
    embedded = {(m.name, f.name, f.number) for m in file.message_type for f in m.field}
    written = set()
    for name, body in re.findall(r"^message (\w+) \{\n(.*?)^\}", proto_text(), re.MULTILINE | re.DOTALL):
        for field, number in re.findall(r" (\w+) = (\d+);", body):
            written.add((name, field, int(number)))
    assert written == embedded
    assert {name for name, _, _ in written} == {"Tensor", *MESSAGES}


def test_the_json_schema_describes_phases_by_kind() -> None:
    schema = json.loads(scene_schema())
    assert schema["additionalProperties"] is False
    assert {"ClosePhase", "MovePhase", "HoldPhase", "BodySpec"} <= schema["$defs"].keys()


@pytest.mark.kernels
def test_importing_the_protocol_is_light() -> None:
    program = (
        "import sys, softseam_protocol; print([m for m in ('zenoh','numpy','pydantic','google') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"
    program = (
        "import sys, softseam_protocol.wire.codec, softseam_protocol.scene.file, softseam_protocol.topics;"
        "print('zenoh' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "False"


def test_every_key_has_one_row() -> None:
    rows = list(table())
    assert len({key for key, *_ in rows}) == len(rows)
    assert all(key.startswith("softseam/DEPLOYMENT/") for key, *_ in rows)
    recorded = {message for _, _, message, kept in rows if kept}
    assert {"Begin", "End", "StepReport", "Frame", "Event"} == recorded


def test_keys_can_be_read_back() -> None:
    keys = Keys("lab")
    assert all(topic_of(topic.message) is topic for topic in SESSION_TOPICS)
    assert keys.read_live("softseam/other/@live/client/c/1") is None
