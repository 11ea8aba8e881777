"""Beyond this machine: what is not encrypted is refused, and what is wrong with a certificate is told."""

from __future__ import annotations

import re
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import strangers
from asked import free_endpoint, served, until

from softseam_protocol.bus.certificates import prepare
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import CLIENT, SERVICE, read_key
from softseam_protocol.errors import BadKey, BusError, KeyRefused, NoKey
from softseam_protocol.topics import Keys
from softseam_services.__main__ import show_health
from softseam_services.bus_options import BusOptions

KEY = Keys().orchestrator
SOON = 0.5

pytestmark = pytest.mark.kernels  # openssl is another process


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    place = tmp_path / "keys"
    monkeypatch.setenv("SOFTSEAM_KEYS", str(place))
    return place


def encrypted() -> str:
    return free_endpoint().replace("tcp/", "tls/")


@pytest.fixture
def endpoint(folder: Path) -> Iterator[str]:
    """A router that shows a certificate."""
    prepare(("lab.example",), renew=False)
    where = encrypted()
    with Router(where):
        yield where


def certify_anew(folder: Path, days: str, names: str) -> None:
    """Another certificate of the host, by the same authority."""
    tls = folder / "tls"
    (tls / "names").write_text(f"subjectAltName={names}\n")
    command = (
        "openssl x509 -req -in host.csr -CA ca.pem -CAkey ca.key -CAcreateserial -extfile names -out host.pem -days"
    )
    subprocess.run((*command.split(), days), cwd=tls, check=True, capture_output=True)


@pytest.mark.parametrize("endpoint", ["tcp/0.0.0.0:0", "tcp/[::]:7447", "udp/192.0.2.7:7447", "tcp/lab.example:7447"])
def test_who_would_listen_to_other_machines_in_the_clear_is_refused(endpoint: str) -> None:
    refused = (
        f"^{re.escape(endpoint)} is open to other machines: run `softseam keys --host NAME`, then give tls/HOST:PORT$"
    )
    with pytest.raises(BusError, match=refused):
        Router(endpoint)
    with pytest.raises(BusError, match=refused):
        BusOptions(listen=endpoint).open()


def test_who_would_connect_to_another_machine_in_the_clear_is_refused() -> None:
    with pytest.raises(
        BusError, match=r"^tcp/lab\.example:7447: .*encrypted: connect to tls/HOST:PORT.*keys --host NAME"
    ):
        Bus("tcp/lab.example:7447")


def test_without_a_certificate_the_remedy_is_named(folder: Path) -> None:
    with pytest.raises(BusError, match=r"needs a certificate.*softseam keys --host NAME"):
        Router(encrypted())
    with pytest.raises(BusError, match=r"client\.key has no certificate.*softseam keys --host NAME"):
        Bus(encrypted(), SOON)


def test_a_client_with_its_one_file_asks_a_service_over_encrypted_links(
    endpoint: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The services listen at every address, and find each other by numbers."""
    options = BusOptions(connect=endpoint, listen="tls/0.0.0.0:0")
    echo = Keys().echo("one")
    with options.open() as one, options.open() as other:
        one.serve({KEY: bytes, echo: bytes}).start()
        assert until(lambda: served(other, echo))
        handed = tmp_path / "client.key"
        handed.write_bytes((folder / "client.key").read_bytes())
        handed.chmod(0o600)
        monkeypatch.setenv("SOFTSEAM_KEYS", str(handed))
        with Bus(endpoint) as client:
            assert until(lambda: served(client, KEY))
            assert client.request(KEY, b"x", 2.0) == b"x"


def test_services_go_on_by_their_own_links_without_the_router(folder: Path) -> None:
    """Encrypted ones, at addresses that no certificate names."""
    prepare(("lab.example",), renew=False)
    options = BusOptions(connect=encrypted(), listen="tls/0.0.0.0:0")
    router = Router(options.connect)
    with options.open() as one, options.open() as other:
        one.serve({KEY: bytes}).start()
        assert until(lambda: served(other, KEY))
        time.sleep(1.0)  # until the router has introduced them
        router.close()
        assert until(lambda: served(other, KEY))


def test_an_encrypted_door_asks_for_a_password_too(endpoint: str) -> None:
    authority = read_key(CLIENT).authority
    assert strangers.join(endpoint, None, authority=authority) is None
    assert strangers.join(endpoint, ("client", "guess"), authority=authority) is None
    known = strangers.join(endpoint, ("client", read_key(CLIENT).password), authority=authority)
    assert known is not None
    known.close()


def test_clear_where_it_is_encrypted_and_the_other_way_round(endpoint: str) -> None:
    clear = endpoint.replace("tls/", "tcp/")
    with pytest.raises(KeyRefused, match=f"^{clear}: what listens there is encrypted: connect to {endpoint}$"):
        Bus(clear, SOON)
    plain = free_endpoint()
    with Router(plain), pytest.raises(KeyRefused, match="what listens there is not encrypted"):
        Bus(plain.replace("tcp/", "tls/"), SOON)


@pytest.mark.parametrize(
    ("days", "names", "says"),
    [("0", "IP:127.0.0.1", "certificate has expired"), ("9", "DNS:lab.example", "IP address mismatch")],
)
def test_a_certificate_that_is_over_or_another_host_s_is_told(folder: Path, days: str, names: str, says: str) -> None:
    prepare(("lab.example",), renew=False)
    certify_anew(folder, days, names)
    where = encrypted()
    time.sleep(1.1)  # until a certificate for no day is over
    with Router(where), pytest.raises(KeyRefused, match=f"^{where}: its certificate is not accepted: .*{says}"):
        Bus(where, SOON)


def test_a_foreign_certificate_is_told(endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOFTSEAM_KEYS", str(tmp_path / "foreign"))
    prepare(("lab.example",), renew=False)
    with pytest.raises(KeyRefused, match="its certificate is not accepted: "):
        Bus(endpoint, SOON)


def test_files_that_were_handed_out_outlive_the_certificate(folder: Path) -> None:
    first = prepare(("lab.example",), renew=False).read_text()
    shown = (folder / "tls" / "host.pem").read_text()
    assert prepare(("lab.example", "192.0.2.7"), renew=False).read_text() == first
    assert (folder / "tls" / "host.pem").read_text() != shown


def test_who_waits_for_keys_finds_them_whole(folder: Path) -> None:
    """With the certificate of who vouches for the router, which takes openssl a while."""
    found: list[str] = []

    def wait() -> None:
        while not found:
            with suppress(NoKey):
                found.append(read_key(CLIENT).authority)

    waiting = threading.Thread(target=wait)
    waiting.start()
    prepare(("lab.example",), renew=False)
    waiting.join()
    assert found == [(folder / "tls" / "ca.pem").read_text()]


def test_files_of_one_s_own_are_left_alone_and_handed_out(folder: Path) -> None:
    prepare(("lab.example",), renew=False)
    (folder / "tls" / "ca.key").unlink()
    with pytest.raises(BadKey, match="files of your own"):
        prepare(("lab.example",), renew=False)
    (folder / "tls" / "ca.pem").write_text("own\n")
    assert prepare((), renew=False).read_text().endswith("\nown\n")


@pytest.mark.parametrize("host", ["", "a b", "x\nbasicConstraints=CA:TRUE", "x,DNS:y", "/CN=x"])
def test_what_is_no_host_is_not_certified(folder: Path, host: str) -> None:
    with pytest.raises(BadKey, match="is no host"):
        prepare((host,), renew=False)
    assert not (folder / "tls").exists()


def test_health_tells_of_a_certificate_that_is_about_to_end(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    prepare(("lab.example",), renew=False)
    for days, ends in (("29", True), ("31", False)):
        certify_anew(folder, days, "IP:127.0.0.1")
        where = encrypted()
        with Router(where), Bus(where, role=SERVICE):
            assert show_health(BusOptions(where, ""), ("router",)) == 0
        said = capsys.readouterr().out
        assert ("its certificate ends in 29 days" in said) == ends, said
