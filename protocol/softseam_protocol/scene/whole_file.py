"""A mesh file and what it needs of the files beside it, as one content: a participant elsewhere gets no folder."""

import base64
import json
from pathlib import Path
from typing import Any
from urllib.parse import unquote

MAX_FILE_BYTES = 128 * 2**20


class Unreadable(Exception):
    """A file that cannot be read, by its path and why."""

    def __init__(self, path: Path, reason: str) -> None:
        self.path = path
        super().__init__(f"{path} {reason}")


def whole_file(path: Path) -> bytes:
    """Content of a mesh file. Raises Unreadable.

    TetGen's .node and .ele are one after the other, whichever of them is named; a .gltf has its buffers in it, of files
    in its own folder.
    """
    if path.suffix.lower() in (".node", ".ele"):
        return b"\n".join(_read(path.with_suffix(suffix)) for suffix in (".node", ".ele"))
    data = _read(path)
    if path.suffix.lower() == ".gltf":
        return _with_buffers(path, data)
    return data


def _with_buffers(path: Path, data: bytes) -> bytes:
    """A document of glTF with its buffers' files in it; as it is where it is none. Raises Unreadable."""
    try:
        document: Any = json.loads(data)
        buffers = [each for each in document.get("buffers", []) if not each.get("uri", "data:").startswith("data:")]
    except (ValueError, AttributeError):
        return data  # who reads it says what is wrong
    for each in buffers:
        named = Path(unquote(each["uri"]))
        if ":" in each["uri"] or named.is_absolute() or ".." in named.parts:
            raise Unreadable(path, f"names {each['uri']!r}: only files of its own folder are read, export it as .glb")
        each["uri"] = "data:application/octet-stream;base64," + base64.b64encode(_read(path.parent / named)).decode()
    whole = json.dumps(document).encode() if buffers else data
    if len(whole) > MAX_FILE_BYTES:
        raise Unreadable(path, f"is larger than {MAX_FILE_BYTES} bytes with its buffers")
    return whole


def _read(path: Path) -> bytes:
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise Unreadable(path, f"is larger than {MAX_FILE_BYTES} bytes")
        return path.read_bytes()
    except OSError as error:
        raise Unreadable(path, f"cannot be read: {error.strerror}") from None
