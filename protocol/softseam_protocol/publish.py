"""What other languages and editors read: `softseam.proto`, `scene.schema.json`, and the lock of field numbers.

python -m softseam_protocol.publish        writes them, run from the repository's root
"""

import sys
from pathlib import Path

from softseam_protocol.messages.arrays import Array
from softseam_protocol.scene.file import scene_schema
from softseam_protocol.wire.descriptors import FIELDS, PACKAGE, Field, shape_text, type_text

PROTO = Path("protocol/softseam_protocol/softseam.proto")
SCHEMA = Path("docs/scene.schema.json")
LOCK = Path("tests/contract/fields.lock")

_PREAMBLE = f"""\
// Written by `python -m softseam_protocol.publish` from messages/: do not edit.
//
// message_type is set on the outermost message only, to its full name, e.g. "{PACKAGE}.Advance".
// Every comment such as f8 (n, 3) is what the Tensor of that field must be.

syntax = "proto3";

package {PACKAGE};

// A C-contiguous, little-endian array; dtype is f8, i4 or i1.
message Tensor {{
  string dtype = 1;
  repeated uint64 shape = 2;
  bytes data = 3;
}}
"""


def _rule(field: Field) -> str:
    """What decoding checks beyond the type, as a comment."""
    if isinstance(field.of, Array):
        least = f", at least {field.of.least}" if field.of.least is not None else ""
        return f"  // {shape_text(field.of)}{least}"
    if field.key is not str:
        return f"  // keys are of: {', '.join(field.key)}"
    if field.least is not None:
        return f"  // at least {field.least}"
    if field.is_enum:
        return f"  // one of: {', '.join(field.of)}"
    if field.named:
        also = ", or two of these and a dot" if field.named.dotted else ""
        return f"  // letters, digits, _ and -, at most 64{also}"
    return "  // may be absent" if field.optional else ""


def proto_text() -> str:
    """The messages as a .proto file."""
    parts = [_PREAMBLE]
    for cls, fields in FIELDS.items():
        comment = "".join(f"// {line.strip()}\n" for line in _summary(cls))
        lines = ["  string message_type = 1;"]
        lines += [f"  {type_text(f)} {f.name} = {f.number};{_rule(f)}" for f in fields]
        parts.append(f"{comment}message {cls.__name__} {{\n" + "\n".join(lines) + "\n}\n")
    return "\n".join(parts)


def _summary(cls: type) -> list[str]:
    doc = cls.__doc__ or ""
    # a dataclass without a docstring gets its signature for one
    return [] if doc.startswith(cls.__name__ + "(") else doc.strip().splitlines()[:1]


def field_lines() -> list[str]:
    """One line a field: what may never change once published."""
    return [f"{cls.__name__}.{f.name} = {f.number}: {type_text(f)}" for cls, fields in FIELDS.items() for f in fields]


def broken_promises(published: list[str], current: list[str]) -> list[str]:
    """Published fields that are gone, renumbered or of another type."""
    return sorted(set(published) - set(current))


def publish(root: Path) -> list[Path]:
    """Write the files below `root`; raises ValueError if a published field has changed."""
    lock = root / LOCK
    published = lock.read_text().splitlines() if lock.exists() else []
    current = field_lines()
    broken = broken_promises(published, current)
    if broken:
        raise ValueError("published fields have changed, append new ones instead: " + "; ".join(broken))
    written = []
    for path, text in ((PROTO, proto_text()), (SCHEMA, scene_schema()), (LOCK, "\n".join(current) + "\n")):
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text)
        written.append(root / path)
    return written


def main() -> int:
    if not PROTO.parent.is_dir():
        print("run this from the repository's root", file=sys.stderr)
        return 2
    try:
        for path in publish(Path()):
            print(path)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
