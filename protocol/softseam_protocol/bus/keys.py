"""Keys: the passwords by which processes join the bus, in a folder that nobody else may read.

Each role has a file, one line ROLE:PASSWORD as zenoh's dictionaries have them, and below it the certificate of who
vouches for the router where the bus goes beyond one machine: one file is all that a client is handed.
"""

import os
import secrets
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from softseam_protocol.errors import BadKey, NoKey

ROLES = SERVICE, CLIENT, VIEWER = "service", "client", "viewer"
"""each may all that those after it may"""
ROUTER_ADMITS, SERVICES_ADMIT = "router.users", "service.users"
"""whom listeners let in: dictionaries of zenoh"""
CERTIFICATES = "tls"
"""folder in the folder of keys"""
_OTHERS = 0o077


@dataclass(frozen=True)
class Key:
    """What a process joins by."""

    role: str
    password: str = field(repr=False)
    authority: str
    """certificate that vouches for the router, PEM; empty where there is none"""
    path: Path


def key_place() -> Path:
    """SOFTSEAM_KEYS, which may name one file, or this user's own folder."""
    return Path(os.environ.get("SOFTSEAM_KEYS") or state_place() / "keys")


def state_place() -> Path:
    """Folder of what this user's processes keep: below $XDG_STATE_HOME, or ~/.local/state."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "softseam"


def read_key(role: str) -> Key:
    """The key of a role. Raises NoKey where there is none, BadKey where it cannot be used."""
    place = path = key_place()
    try:
        if not place.is_file():
            check_private(place)
            path = place / f"{role}.key"
        check_private(path)
        first, _, authority = path.read_text(encoding="ascii").partition("\n")
    except FileNotFoundError:
        raise NoKey(
            f"there is no key at {path}: `softseam up` makes keys on its own machine; for a router elsewhere set "
            "SOFTSEAM_KEYS to the client.key that you were handed"
        ) from None
    except OSError as error:
        raise BadKey(f"the key {path} cannot be read: {error.strerror}") from None
    except ValueError:
        first = authority = ""
    holder, _, password = first.partition(":")
    if holder not in ROLES or not password:
        raise BadKey(f"{path} is no key: have it handed to you anew")
    if ROLES.index(holder) > ROLES.index(role):
        raise BadKey(f"{path} is the key of a {holder}, who may not do what a {role} does")
    return Key(holder, password, authority, path)


def check_private(path: Path) -> None:
    """Raise BadKey where others can read or change it, OSError where it cannot be looked at."""
    if os.name != "posix":
        return
    found = path.stat()
    if found.st_uid != os.geteuid():
        raise BadKey(f"{path} belongs to another user: keys are each user's own")
    if found.st_mode & _OTHERS:
        raise BadKey(f"others may read {path}: chmod go= {path}, and softseam keys --renew where they may have done so")


def write_keys(folder: Path, keep: bool = False) -> None:
    """Write the files of all roles, with the authority's certificate and new passwords, or `keep` those that there are.

    Raises OSError.
    """
    vouches = folder / CERTIFICATES / "ca.pem"
    authority = vouches.read_text(encoding="ascii") if vouches.exists() else ""
    lines = {}
    for role in ROLES:
        path = folder / f"{role}.key"
        lines[role] = path.read_text().split("\n", 1)[0] if keep else f"{role}:{secrets.token_hex(16)}"
        _write(path, f"{lines[role]}\n{authority}")
    _write(folder / SERVICES_ADMIT, f"{lines[SERVICE]}\n")
    _write(folder / ROUTER_ADMITS, "".join(f"{line}\n" for line in lines.values()))


def make_keys(fill: Callable[[Path], None] = write_keys, anew: bool = False) -> Path:
    """The folder of all keys; where there are none yet they are made, all or none, by `fill`. Raises BadKey.

    anew  fill it also where there are keys
    """
    folder = key_place()
    whole = folder / f"{SERVICE}.key"
    try:
        if not whole.exists():
            folder.parent.mkdir(parents=True, exist_ok=True)
            made = Path(tempfile.mkdtemp(prefix=".keys-", dir=folder.parent))
            try:
                fill(made)
                made.rename(folder)
            except OSError:
                if not whole.exists():  # else another router was first
                    raise
            finally:
                shutil.rmtree(made, ignore_errors=True)
        elif anew:
            fill(folder)
        check_private(folder)
    except OSError as error:
        raise BadKey(
            f"a router needs all keys; {folder} lacks {whole.name} or cannot be written ({error.strerror}): name "
            "another folder by SOFTSEAM_KEYS"
        ) from None
    return folder


def _write(path: Path, text: str) -> None:
    """Replace a file by one that nobody else may read."""
    handle, name = tempfile.mkstemp(dir=path.parent)  # of mode 0600
    with os.fdopen(handle, "w", encoding="ascii") as file:
        file.write(text)
    Path(name).replace(path)
