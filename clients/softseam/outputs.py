"""Files that a command is to leave behind: refused before it begins where they would take another file's place, or
cannot be written."""

import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from softseam.errors import BadInput

Named = tuple[str, Path]
"""an option, e.g. --report, and the file or folder that it names"""


def check_outputs(files: Sequence[Named], folders: Sequence[Named] = (), *, inputs: Mapping[str, Path]) -> None:
    """Make the folders that outputs need, and try to write into them. Raises BadInput.

    inputs   files that the command reads, by what they are, e.g. 'the scene'
    """
    for option, path in (*files, *folders):
        for what, used in inputs.items():
            if _same(path, used):
                raise BadInput(f"{option} {path}: that is {what}, which would be lost: choose another name")
    taken: list[Named] = []
    for option, path in (*files, *folders):
        for other, before in taken:
            if _same(path, before):
                raise BadInput(f"{option} {path}: {other} is to be written there, too: choose another name")
        taken.append((option, path))
    for option, path in files:
        if (kind := _kind(path)) and not stat.S_ISREG(kind):
            what = "a folder" if stat.S_ISDIR(kind) else "no plain file"
            raise BadInput(f"{option} {path}: cannot write there, it is {what}: name a file")
    for option, path in folders:
        if (kind := _kind(path)) and not stat.S_ISDIR(kind):
            raise BadInput(f"{option} {path}: cannot write into it, it is a file: name a folder")
    for option, path in files:
        _try(option, path, path.parent, path.name)
    for option, path in folders:
        _try(option, path, path, "any")


def check_ending(option: str, path: Path, ending: str, what: str) -> None:
    """Raise BadInput where a file's name does not end as that of what is written to it."""
    if path.suffix != ending:
        raise BadInput(f"{option} {path}: the name of {what} ends in {ending}")


def cannot_write(path: Path | str, error: OSError) -> BadInput:
    """The error to raise where a file could not be written."""
    return BadInput(f"cannot write {path}: {error.strerror or error}")


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A name beside a file, of the same ending, for what is to take its place once it is written: nobody sees half of
    it. Raises OSError."""
    fresh = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield fresh
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)


def write_whole(path: Path, text: str) -> Path:
    """Write a file, all or nothing; returns its path. Raises OSError."""
    with whole(path) as fresh:
        fresh.write_text(text, encoding="utf-8")
    return path


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:  # one of them is not there yet
        return one.resolve() == other.resolve()


def _kind(path: Path) -> int:
    """What is there, as stat.S_ISREG and others ask; 0 where nothing is."""
    try:
        return path.stat().st_mode
    except OSError:  # why it cannot be reached, `_try` finds out
        return 0


def _try(option: str, path: Path, folder: Path, name: str) -> None:
    """Write a little beside the file that is to come, as it will be written: who may do what, only the system knows."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{option} {path}: cannot make the folder {folder}: {error.strerror or error}") from None
    fresh = folder / f".{name}.{os.getpid()}"
    try:
        with fresh.open("wb") as stream:
            stream.write(bytes(4096))
    except OSError as error:
        raise BadInput(
            f"{option} {path}: cannot write there ({error.strerror or error}): choose a folder that you may write to, "
            "with room left"
        ) from None
    finally:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)
