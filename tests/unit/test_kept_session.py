"""What is kept of a session is read again whole, or to its last whole record; nobody else may read it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from full_disk import files_up_to

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import Open, Reset, Step
from softseam_protocol.topics import Keys
from softseam_services.orchestrator import kept_session
from softseam_services.orchestrator.kept_session import FORGOTTEN, Base, Damaged, Entry, KeptSession, kept_sessions
from softseam_services.recorder import room


def header(number: int) -> Header:
    return Header(SCHEMA_VERSION, "abc", "", 0, 0, number, 0.0)


BASE = Base(Open(header(1), Bundle("scene", {"mesh": b"x" * 100})), 7, 120, 9, 20, b"state\n{}")
ENTRIES = [
    Entry(Reset(header(2), 3)),
    Entry(Step(header(3), 5, True, {}), 5, answer=b"said\n"),
    Entry(Step(header(4), 5, True, {}), 2, failed=True),
]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    folder = kept_sessions(Keys("mine"))
    assert folder is not None and folder.is_relative_to(tmp_path)
    return folder


def filled(folder: Path) -> KeptSession:
    kept = KeptSession(folder, "abc")
    kept.keep(BASE, ENTRIES[0])
    for entry in ENTRIES[1:]:
        kept.keep(None, entry)
    return kept


def test_what_is_kept_is_read_again(folder: Path) -> None:
    kept = filled(folder)
    assert kept.there and KeptSession(folder, "abc").read() == (BASE, ENTRIES)
    later = Base(BASE.opened, 7)
    kept.keep(later)
    kept.keep(None, ENTRIES[0])
    assert KeptSession(folder, "abc").read() == (later, ENTRIES[:1]), "in the place of all before"
    kept.discard()
    kept.discard()
    assert not kept.there and list(folder.iterdir()) == []


def test_nobody_else_may_read_it(folder: Path) -> None:
    """Whatever the process's mask."""
    before = os.umask(0)
    try:
        filled(folder)
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert [path.stat().st_mode & 0o777 for path in folder.iterdir()] == [0o600]
    folder.chmod(0o755)
    assert kept_sessions(Keys("mine")) == folder and folder.stat().st_mode & 0o777 == 0o700


def test_a_name_leads_to_no_other_folder(folder: Path) -> None:
    for name in ("../abc", "a/b", "", ".abc"):
        with pytest.raises(ValueError, match="is not a name"):
            KeptSession(folder, name)


@pytest.mark.parametrize("cut", [1, 10, 60])
def test_a_record_that_is_not_whole_ends_the_file(folder: Path, cut: int) -> None:
    """Its answer was never sent."""
    filled(folder)
    path = folder / "abc"
    path.write_bytes(path.read_bytes()[:-cut])
    assert KeptSession(folder, "abc").read() == (BASE, ENTRIES[:2])


@pytest.mark.parametrize("spoilt", [b"", b"{}", b"\xff" * 200])
def test_without_a_whole_base_it_is_damaged(folder: Path, spoilt: bytes) -> None:
    (folder / "abc").write_bytes(spoilt)
    with pytest.raises(Damaged, match="is damaged"):
        KeptSession(folder, "abc").read()


def test_on_a_full_disk_nothing_old_is_left(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An older state is none of the session: its client knows of a later one. Once there is room it is kept again."""
    kept = filled(folder)
    with files_up_to((folder / "abc").stat().st_size + 20), pytest.raises(OSError, match=r"disk is full|too large"):
        kept.keep(None, ENTRIES[1])
    assert list(folder.iterdir()) == []
    kept.keep(None, ENTRIES[1])  # without a base
    assert list(folder.iterdir()) == []
    with files_up_to(100), pytest.raises(OSError, match=r"disk is full|too large"):
        kept.keep(BASE)
    assert list(folder.iterdir()) == []
    monkeypatch.setattr(room, "FLOOR", 1 << 60)
    with pytest.raises(OSError, match="of its disk are free"):
        kept.keep(BASE)
    monkeypatch.undo()
    kept.keep(BASE)
    assert KeptSession(folder, "abc").read() == (BASE, [])


def test_it_is_no_larger_than_it_may(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = filled(folder)
    monkeypatch.setattr(kept_session, "MOST", (folder / "abc").stat().st_size + 10)
    with pytest.raises(OSError, match="it takes more than"):
        kept.keep(None, ENTRIES[1])
    assert not kept.there


def test_sessions_that_nobody_came_back_to_are_forgotten(folder: Path) -> None:
    filled(folder)
    (folder / "old").write_bytes(b"")
    long_ago = (folder / "old").stat().st_mtime - FORGOTTEN - 60.0
    os.utime(folder / "old", (long_ago, long_ago))
    kept_sessions(Keys("mine"))
    assert [path.name for path in folder.iterdir()] == ["abc"]


def test_where_there_is_no_folder_nothing_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "softseam").write_text("a file")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert kept_sessions(Keys("mine")) is None and "sessions end with this orchestrator" in caplog.text
    kept = KeptSession(None, "abc")
    kept.keep(BASE)
    kept.keep(None, ENTRIES[0])
    kept.discard()
    assert not kept.there and kept.since > 1e300
