"""Certificates for a router and services that other machines reach, by `openssl`: an authority, and one of the host.

Files of your own are used in their place: `ca.pem`, `host.pem` (with the hosts in subjectAltName) and `host.key` in the
folder `tls` of the keys' folder.
"""

import ipaddress
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from softseam_protocol.bus.keys import CERTIFICATES, CLIENT, make_keys, write_keys
from softseam_protocol.errors import BadKey

_NEW_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
_AUTHORITY_DAYS, _HOST_DAYS = "3650", "397"
_HERE = ("localhost", "127.0.0.1", "::1")
_HOST = re.compile(r"[A-Za-z0-9.:-]+")


def prepare(hosts: Sequence[str], renew: bool) -> Path:
    """Make what is missing of keys, a certificate for `hosts` (names, numbers) if there are any, and `renew` passwords.

    Returns the file to hand to clients. Raises BadKey.
    """

    def fill(folder: Path) -> None:
        if hosts:
            _certify(folder, hosts)
        write_keys(folder, keep=not renew and (folder / f"{CLIENT}.key").exists())

    return make_keys(fill, anew=True) / f"{CLIENT}.key"  # whole, for services may be waiting for it


def _certify(folder: Path, hosts: Sequence[str]) -> None:
    """An authority, where there is none, and a new certificate: files that were handed out before stay good."""
    for host in hosts:
        if not _HOST.fullmatch(host):
            raise BadKey(f"{host!r} is no host: give the name, or the number, by which others reach this machine")
    tls, made = folder / CERTIFICATES, Path(tempfile.mkdtemp(prefix=".tls-", dir=folder))
    try:
        if (tls / "ca.pem").exists() and not (tls / "ca.key").exists():
            raise BadKey(f"{tls} holds files of your own: replace them yourself, then run `softseam keys`")
        if (tls / "ca.key").exists():
            for name in ("ca.pem", "ca.key"):
                shutil.copy2(tls / name, made / name)
        else:
            _openssl(made, "req", "-x509", *_NEW_KEY, "-keyout", "ca.key", "-out", "ca.pem", "-days", _AUTHORITY_DAYS,
                     "-subj", "/CN=softseam authority")  # fmt: skip
        names = ",".join(f"{_kind(host)}:{host}" for host in dict.fromkeys((*hosts, *_HERE)))
        (made / "names").write_text(f"subjectAltName={names}\nbasicConstraints=CA:FALSE\n", encoding="ascii")
        _openssl(made, "req", *_NEW_KEY, "-keyout", "host.key", "-out", "host.csr", "-subj", "/CN=softseam")
        _openssl(made, "x509", "-req", "-in", "host.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial",
                 "-days", _HOST_DAYS, "-extfile", "names", "-out", "host.pem")  # fmt: skip
        tls.mkdir(mode=0o700, exist_ok=True)
        for path in sorted(made.iterdir()):
            path.replace(tls / path.name)  # one by one: who starts meanwhile finds all
    finally:
        shutil.rmtree(made, ignore_errors=True)


def _kind(host: str) -> str:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return "DNS"
    return "IP"


def _openssl(folder: Path, *args: str) -> None:
    """Run it there. Raises BadKey."""
    try:
        subprocess.run(("openssl", *args), cwd=folder, check=True, capture_output=True, text=True)
    except FileNotFoundError:
        raise BadKey("certificates are made by openssl, which is not installed") from None
    except subprocess.CalledProcessError as error:
        raise BadKey(f"openssl {args[0]}: {error.stderr.strip()}") from None
