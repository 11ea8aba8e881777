"""Keys of the bus: made whole, each user's own, and each way in which one does not fit has its own words."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from asked import free_endpoint, served, until

from softseam_protocol.bus.certificates import prepare
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import CLIENT, ROLES, SERVICE, VIEWER, make_keys, read_key
from softseam_protocol.errors import BadKey, BusError, KeyRefused, NoKey, NoReply, NoRouter
from softseam_protocol.topics import Keys

KEY = Keys().orchestrator
SOON = 0.5


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the keys of a test are; not made yet."""
    place = tmp_path / "state" / "keys"
    monkeypatch.setenv("SOFTSEAM_KEYS", str(place))
    return place


@pytest.fixture
def elsewhere(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A router with keys of its own; this process looks for its keys in another folder."""
    where = free_endpoint()
    with Router(where):
        monkeypatch.setenv("SOFTSEAM_KEYS", str(tmp_path / "mine"))
        yield where


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


def test_the_first_router_makes_all_keys_and_nobody_else_reads_them(folder: Path) -> None:
    with Router(free_endpoint()):
        made = {role: read_key(role).password for role in ROLES}
    assert len(set(made.values())) == 3 and min(map(len, made.values())) >= 32
    assert mode(folder) == 0o700
    assert {mode(path) for path in folder.iterdir()} == {0o600}
    with Router(free_endpoint()):
        assert made == {role: read_key(role).password for role in ROLES}


def test_by_default_keys_are_among_a_user_s_states(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOFTSEAM_KEYS")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert make_keys() == tmp_path / "softseam" / "keys"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert make_keys() == tmp_path / "home" / ".local" / "state" / "softseam" / "keys"


def test_a_folder_that_comes_while_it_is_looked_for_is_read(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen, look = [], Path.is_file

    def late(path: Path) -> bool:
        seen.append(path)
        if len(seen) > 1:
            return look(path)
        monkeypatch.setattr(Path, "is_file", look)
        make_keys()
        return False

    monkeypatch.setattr(Path, "is_file", late)
    assert read_key(CLIENT).role == CLIENT
    assert seen == [folder]


def test_of_many_that_make_keys_at_once_all_have_the_same(folder: Path) -> None:
    start, found = threading.Barrier(8), []

    def make() -> None:
        start.wait()
        make_keys()
        found.append(tuple(read_key(role).password for role in ROLES))

    threads = [threading.Thread(target=make) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8 and len(set(found)) == 1
    assert list(folder.parent.iterdir()) == [folder]


def test_keys_are_made_all_or_none(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is full after the first of them leaves nothing, and the next router makes all."""
    replace, written = Path.replace, []

    def full(path: Path, target: Path) -> Path:
        written.append(target)
        if len(written) == 2:
            raise OSError(28, "No space left on device")
        return replace(path, target)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", full)
        with pytest.raises(BadKey, match="No space left"):
            make_keys()
    assert list(folder.parent.iterdir()) == []
    make_keys()
    assert all(read_key(role) for role in ROLES)


def test_a_folder_of_something_else_is_left_alone(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "letters").touch()
    with pytest.raises(BadKey, match=r"lacks service\.key"):
        Router(free_endpoint())
    assert [path.name for path in folder.iterdir()] == ["letters"]


def test_no_key_a_wrong_one_an_unreadable_one_and_no_router_are_four_messages(elsewhere: str, tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    said: list[pytest.ExceptionInfo[BusError]] = []
    with pytest.raises(NoRouter, match="softseam up") as none:
        Bus(free_endpoint(), SOON)
    said.append(none)
    with pytest.raises(NoKey, match=f"no key at {mine}.*SOFTSEAM_KEYS") as absent:
        Bus(elsewhere, SOON)
    said.append(absent)
    make_keys()
    with pytest.raises(KeyRefused, match=f"{elsewhere} does not let {mine}/client.key in") as wrong:
        Bus(elsewhere, SOON)
    said.append(wrong)
    mine.chmod(0o755)
    with pytest.raises(BadKey, match=f"others may read {mine}.*chmod") as unreadable:
        Bus(elsewhere, SOON)
    said.append(unreadable)
    assert len({type(each.value) for each in said}) == 4
    assert all("\n" not in str(each.value) for each in said)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda path: path.chmod(0o644), "others may read"),
        (lambda path: path.write_bytes(b"\xff\xfe"), "is no key"),
        (lambda path: path.write_text(""), "is no key"),
        (lambda path: path.write_text("client:\n"), "is no key"),
        (lambda path: path.write_text("king:abc\n"), "is no key"),
        (lambda path: path.write_text("viewer:abc\n"), "the key of a viewer"),
    ],
)
def test_a_key_that_cannot_be_used_says_why(folder: Path, spoil: object, says: str) -> None:
    make_keys()
    assert callable(spoil)
    spoil(folder / "client.key")
    with pytest.raises(BadKey, match=says):
        read_key(CLIENT)


@pytest.mark.parametrize("what", ["folder", "file"])
def test_a_key_of_another_user_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    make_keys()
    monkeypatch.setenv("SOFTSEAM_KEYS", str(folder if what == "folder" else folder / "client.key"))
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    with pytest.raises(BadKey, match="another user"):
        read_key(CLIENT)
    if what == "folder":
        with pytest.raises(BadKey, match="another user"):
            make_keys()


def test_one_file_is_all_that_a_client_is_handed(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A client's may ask, a viewer's may not, and none of them serves."""
    where = free_endpoint()
    with Router(where), Bus(where, role=SERVICE) as service:
        service.serve({KEY: bytes}).start()
        for role in (CLIENT, VIEWER):
            handed = tmp_path / f"handed.{role}"
            handed.write_bytes((folder / f"{role}.key").read_bytes())
            handed.chmod(0o600)
        monkeypatch.setenv("SOFTSEAM_KEYS", str(tmp_path / "handed.client"))
        with Bus(where) as client:
            assert until(lambda: served(client, KEY))
        with pytest.raises(BadKey, match="key of a client, who may not do what a service does"):
            Bus(where, role=SERVICE)
        with pytest.raises(BadKey, match=r"lacks service\.key"):
            Router(free_endpoint())
        monkeypatch.setenv("SOFTSEAM_KEYS", str(tmp_path / "handed.viewer"))
        with pytest.raises(BadKey, match="key of a viewer"):
            Bus(where)
        with Bus(where, role=VIEWER) as viewer, pytest.raises(NoReply):
            viewer.request(KEY, b"", 1.0)


def test_new_passwords_shut_out_old_ones(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    where, old = free_endpoint(), tmp_path / "old.key"
    with Router(where):
        old.write_bytes((folder / "client.key").read_bytes())
        old.chmod(0o600)
    assert prepare((), renew=True) == folder / "client.key"
    with Router(where):
        Bus(where).close()
        monkeypatch.setenv("SOFTSEAM_KEYS", str(old))
        with pytest.raises(KeyRefused):
            Bus(where, SOON)


def test_a_client_of_one_deployment_s_keys_is_nobody_at_another(elsewhere: str) -> None:
    """Whose keys are others; on one router deployments are names."""
    with Router(free_endpoint()), pytest.raises(KeyRefused):
        Bus(elsewhere, SOON)


def test_a_client_waits_for_keys_that_are_about_to_be_made(folder: Path) -> None:
    where = free_endpoint()
    opened: list[Bus | BusError] = []

    def wait() -> None:
        try:
            opened.append(Bus(where, connect_timeout=10.0))
        except BusError as error:
            opened.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    with Router(where):
        thread.join(10.0)
        assert isinstance(opened[0], Bus)
        opened[0].close()
