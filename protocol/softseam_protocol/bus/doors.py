"""Doors of the bus, as settings of zenoh: whom listeners let in, what a router lets each do, what leaves a machine."""

import base64
import ipaddress
import re
import socket
import time
from collections.abc import Iterable, Mapping

from softseam_protocol.bus.keys import CERTIFICATES, CLIENT, ROLES, ROUTER_ADMITS, SERVICE, SERVICES_ADMIT, VIEWER, Key
from softseam_protocol.errors import BusError, KeyRefused, NoRouter
from softseam_protocol.topics import DEFAULT_ENDPOINT, EVERY_NODE, ROOT

_USER, _TLS = "transport/auth/usrpwd/", "transport/link/tls/"
_ENCRYPTED = frozenset(("tls", "quic"))
_HOST_PORT = re.compile(r"(?:tcp|udp|ws|tls|quic)/([^?#]+):(\d{1,5})(?:[?#].*)?")
_OTHER = re.compile(r"(?!(?:tcp|udp|ws|tls|quic)/)[^/?#]+/[^?#]+.*")
_PROBE = 1
"""longest wait for a sign of what listens somewhere [s]"""
_DAY = 24 * 60 * 60

Settings = Mapping[str, object]

_LIVE = f"{ROOT}/*/@live/**"
_ASKED = [f"{ROOT}/*/orchestrator/request"]
_SEEN = [f"{ROOT}/*/session/*/*", f"{ROOT}/*/progress/*/*"]
_TOKENS = ["liveliness_token", "liveliness_query", "declare_liveliness_subscriber"]
_ALL = ["put", "delete", "declare_subscriber", "query", "reply", "declare_queryable", *_TOKENS]
_RULES: dict[str, tuple[tuple[str, ...], list[str], list[str], list[str]]] = {
    # who may; which way, seen from the router; what; where: zenoh's ** does not match what begins with @
    "everything": ((SERVICE,), ["ingress", "egress"], _ALL, [f"{ROOT}/**", _LIVE, EVERY_NODE]),
    "ask": ((CLIENT,), ["ingress"], ["query"], _ASKED),
    "be answered": ((CLIENT,), ["egress"], ["reply", "declare_queryable"], _ASKED),  # else zenoh soon asks nobody
    "live": ((CLIENT,), ["ingress"], ["liveliness_token"], [f"{ROOT}/*/@live/client/session/*"]),
    "look": ((CLIENT, VIEWER), ["ingress"], ["declare_subscriber"], _SEEN),
    "see": ((CLIENT, VIEWER), ["egress"], ["put"], _SEEN),
    "look who lives": ((CLIENT, VIEWER), ["ingress"], _TOKENS[1:], [_LIVE]),
    "see who lives": ((CLIENT, VIEWER), ["egress"], ["liveliness_token", "reply"], [_LIVE]),
}
_ACCESS = {
    "enabled": True,
    "default_permission": "deny",
    "rules": [
        {"id": name, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": keys}
        for name, (_, flows, messages, keys) in _RULES.items()
    ],
    "subjects": [{"id": role, "usernames": [role]} for role in ROLES],
    "policies": [{"rules": [name], "subjects": list(who)} for name, (who, *_) in _RULES.items()],
}


def settings_of(key: Key, connect: Iterable[str], listen: Iterable[str], router: bool = False) -> Settings:
    """How a session joins by a key, and whom it lets in where it listens. Raises BusError."""
    settings: dict[str, object] = {f"{_USER}user": key.role, f"{_USER}password": key.password}
    tls = key.path.with_name(CERTIFICATES)
    if listen:
        settings[f"{_USER}dictionary_file"] = str(key.path.with_name(ROUTER_ADMITS if router else SERVICES_ADMIT))
    if not any(map(_encrypted, (*connect, *listen))):
        # all are on this machine and reach each other: of two that are introduced one connects; where both do, the link
        # may break and not come back
        settings["scouting/gossip/autoconnect_strategy"] = {"peer": {"to_peer": "greater-zid"}}
    if router:
        settings["access_control"] = _ACCESS
    if key.authority:
        settings[f"{_TLS}root_ca_certificate_base64"] = base64.b64encode(key.authority.encode()).decode()
        # zenoh introduces services to each other by numbers of hosts, which no certificate of ours names
        settings[f"{_TLS}verify_name_on_connect"] = not (key.role == SERVICE and (tls / "ca.key").exists())
    elif encrypted := list(filter(_encrypted, connect)):
        raise BusError(
            f"{encrypted[0]}: {key.path} has no certificate to know the router by: have a client.key handed to you "
            "from where `softseam keys --host NAME` was run"
        )
    if encrypted := list(filter(_encrypted, listen)):
        if not (tls / "host.pem").exists():
            raise BusError(f"{encrypted[0]} needs a certificate in {tls}: run `softseam keys --host NAME`")
        settings[f"{_TLS}listen_private_key"] = str(tls / "host.key")
        settings[f"{_TLS}listen_certificate"] = str(tls / "host.pem")
        settings[f"{_TLS}close_link_on_expiration"] = True
    return settings


def check_endpoints(connect: Iterable[str], listen: Iterable[str]) -> None:
    """Raise BusError for what is no endpoint, or leaves this machine and is not encrypted."""
    for endpoint in (*connect, *listen):
        if _address(endpoint) is None and not _OTHER.fullmatch(endpoint):
            # zenoh says so in terms of its own, or tries to reach it all the same
            raise BusError(f"{endpoint!r} is no endpoint: give tcp/HOST:PORT, such as {DEFAULT_ENDPOINT}")
    for endpoint in filter(_leaves, listen):
        raise BusError(
            f"{endpoint} is open to other machines: run `softseam keys --host NAME`, then give tls/HOST:PORT"
        )
    for endpoint in filter(_leaves, connect):
        raise BusError(
            f"{endpoint}: beyond this machine the bus is encrypted: connect to tls/HOST:PORT, which `softseam keys "
            "--host NAME` prepares there"
        )


def _address(endpoint: str) -> tuple[str, int] | None:
    """Host and port; None for an endpoint that has none."""
    found = _HOST_PORT.fullmatch(endpoint)
    return (found[1].strip("[]"), int(found[2])) if found and int(found[2]) < 2**16 else None


def _encrypted(endpoint: str) -> bool:
    return endpoint.partition("/")[0] in _ENCRYPTED


def _leaves(endpoint: str) -> bool:
    """Whether what is sent there in the clear leaves this machine, or comes from elsewhere."""
    address = _address(endpoint)
    if address is None or _encrypted(endpoint):
        return False
    try:
        return not ipaddress.ip_address(address[0]).is_loopback
    except ValueError:
        return address[0] != "localhost"


# ---- why nobody answers ------------------------------------------------------------------------------------


def unanswered(endpoints: Iterable[str], waited: float, key: Key | None) -> BusError | None:
    """Why a session could not be opened, for which zenoh has one sentence; None where there is a router, but no key."""
    for endpoint in endpoints:
        try:
            _connected(endpoint).close()
        except OSError:
            continue
        return None if key is None else KeyRefused(_refusal(endpoint, key))
    return NoRouter(
        f"no router answers at {', '.join(endpoints)} within {waited:g} s: start one with `softseam up` or "
        "`softseam serve router`, or name another endpoint"
    )


def _refusal(endpoint: str, key: Key) -> str:
    """Why somebody who listens there does not let this key in."""
    import ssl

    encrypted = _encrypted(endpoint)
    try:
        _shown_until(endpoint, key.authority if encrypted else "")
        if not encrypted:
            return f"{endpoint}: what listens there is encrypted: connect to tls/{endpoint.partition('/')[2]}"
    except ssl.SSLCertVerificationError as error:
        return f"{endpoint}: its certificate is not accepted: {error.verify_message.rstrip('.')}"
    except OSError:
        if encrypted:
            return f"{endpoint}: what listens there is not encrypted: it is not the router that your key is of"
    return (
        f"the router at {endpoint} does not let {key.path} in: its keys are others. Set SOFTSEAM_KEYS to the keys of "
        "who started it, or to its client.key; or what listens there hangs, or is no router"
    )


def days_left(endpoints: Iterable[str], key: Key) -> float | None:
    """For how long the router's certificate is good [days]; None where it shows none, or is slow to."""
    try:
        ends = [_shown_until(endpoint, key.authority) for endpoint in endpoints if _encrypted(endpoint)]
    except OSError:
        return None
    return (min(ends) - time.time()) / _DAY if ends else None


def _shown_until(endpoint: str, authority: str) -> float:
    """When the certificate that is shown there ends [s since 1970], 0 without an authority to check it by.

    Raises OSError, ssl.SSLCertVerificationError among them.
    """
    import ssl

    context = ssl.create_default_context(cadata=authority or None)
    if not authority:
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    address = _address(endpoint)
    with _connected(endpoint) as plain, context.wrap_socket(plain, server_hostname=address and address[0]) as link:
        ends = (link.getpeercert() or {}).get("notAfter")
    return ssl.cert_time_to_seconds(str(ends)) if ends else 0.0


def _connected(endpoint: str) -> socket.socket:
    """A connection by TCP. Raises OSError, also for an endpoint that has none."""
    address = _address(endpoint)
    if address is None:
        raise OSError(f"{endpoint} is not reached by TCP")
    return socket.create_connection(address, _PROBE)
