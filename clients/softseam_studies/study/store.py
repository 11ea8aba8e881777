"""Files that hold finished work: written all or nothing, and refused by name where they are not what they should be."""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from softseam.errors import BadInput
from softseam.report import write_json
from softseam_studies.study.measure import Outcome

VERSION = 1
"""of what the files hold; another version is foreign"""


@dataclass(frozen=True)
class Identity:
    """What finished work belongs to; work of another identity is never mixed in."""

    scene: str
    """hash of the scene"""
    code: str
    """digest of the solvers' sources"""
    machine: str = ""
    """processor and cores, where they matter"""

    @property
    def folder(self) -> str:
        """Names a folder for its work, so that work of another identity lies elsewhere and is found again."""
        return f"{self.scene[:12]}-{self.code[:8]}-{hashlib.sha256(self.machine.encode()).hexdigest()[:8]}"


class Store:
    """A folder of finished pieces of work, one JSON file each."""

    def __init__(
        self,
        folder: Path,
        identity: Identity,
        remedy: str,
        *,
        writer: str = "softseam chart",
        other: str = "another scene",
    ) -> None:
        """The folder is made with the first file.

        remedy  what to do about a file that is refused, e.g. 'start anew with --fresh'
        writer  the command whose files these are
        other   what a file belongs to whose `Identity.scene` is not ours
        """
        self.folder, self._identity, self._remedy = folder, identity, remedy
        self._writer, self._other = writer, other

    def path(self, name: str) -> Path:
        return self.folder / f"{name}.json"

    def names(self, prefix: str) -> list[str]:
        """Of finished pieces that begin so."""
        return sorted(path.stem for path in self.folder.glob(f"{prefix}*.json"))

    def read(self, name: str) -> dict[str, Any] | None:
        """A finished piece, or None where there is none. Raises BadInput, naming a corrupt or foreign file."""
        path = self.path(name)
        try:
            text = path.read_text(encoding="utf-8")
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, UnicodeDecodeError) as error:
            raise self.refused(name, f"cannot be read ({error})") from None
        try:
            document = json.loads(text)
        except ValueError:
            raise self.refused(name, "is corrupt: it is not JSON") from None
        if not isinstance(document, dict) or not {"softseam_chart", "identity", "digest", "data"} <= document.keys():
            raise self.refused(name, f"was not written by {self._writer}")
        if document["softseam_chart"] != VERSION:
            raise self.refused(name, f"was written by another version of {self._writer}")
        data = document["data"]
        if not isinstance(data, dict) or document["digest"] != _digest(data):
            raise self.refused(name, "is corrupt: its contents do not match its digest")
        for part, ours in asdict(self._identity).items():
            theirs = dict(document["identity"]).get(part)
            if theirs != ours:
                whose = {"scene": self._other, "code": "other code", "machine": f"another machine ({theirs})"}
                raise self.refused(name, f"belongs to {whose[part]}")
        return data

    def outcome(self, name: str) -> Outcome | None:
        """A finished run, or None where there is none. Raises BadInput as `read`."""
        data = self.read(name)
        try:
            return None if data is None else Outcome.from_json(data)
        except (KeyError, TypeError, ValueError) as error:
            raise self.refused(name, f"is corrupt ({error})") from None

    def write(self, name: str, data: Mapping[str, Any]) -> None:
        """Keep a finished piece; a reader never sees half of it. Raises BadInput where it cannot be written."""
        document = {
            "softseam_chart": VERSION,
            "identity": asdict(self._identity),
            "digest": _digest(data),
            "data": dict(data),
        }
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_json(document, self.path(name))
        except OSError as error:
            is_cache = cache_folder().parent in self.folder.parents
            elsewhere = ": set XDG_CACHE_HOME to a folder that can be written to" if is_cache else ""
            raise BadInput(f"cannot write {self.path(name)}: {error.strerror}{elsewhere}") from None

    def clear(self) -> None:
        """Forget all finished pieces."""
        for path in self.folder.glob("*.json"):
            path.unlink(missing_ok=True)

    def refused(self, name: str, why: str) -> BadInput:
        """The error about a file that cannot be used."""
        return BadInput(f"{self.path(name)} {why}: delete it, or {self._remedy}")


def _digest(data: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def cache_folder() -> Path:
    """Where references are stored: $XDG_CACHE_HOME/softseam/references, or ~/.cache/softseam/references."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "softseam" / "references"
