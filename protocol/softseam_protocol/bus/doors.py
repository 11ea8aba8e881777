"""Doors of the bus, as settings of zenoh: whom listeners let in, what a router lets each do, what leaves a machine."""

import base64
import ipaddress
import re
import socket
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from softseam_protocol.bus.keys import CERTIFICATES, CLIENT, ROLES, ROUTER_ADMITS, SERVICE, SERVICES_ADMIT, VIEWER, Key
from softseam_protocol.errors import BusError, KeyRefused, NoRouter
from softseam_protocol.topics import DEFAULT_ENDPOINT, EVERY_NODE, ROOT

_USER = "transport/auth/usrpwd/"
_TLS = "transport/link/tls/"
_ENCRYPTED = frozenset(("tls", "quic"))
_OF_HOSTS = frozenset(("tcp", "udp", "ws")) | _ENCRYPTED
_HOST_PORT = re.compile(r"[a-z]+/([^?#]+):(\d{1,5})([?#].*)?")
_OTHER = re.compile(r"[^/?#]+/[^?#]+.*")
_PROBE = 1.0
"""longest wait for a sign of what listens somewhere [s]"""

_DAY = 24 * 60 * 60

Settings = Mapping[str, object]

_LIVE = f"{ROOT}/*/@live/**"
_ASKED = [f"{ROOT}/*/orchestrator/request"]
_SEEN = [f"{ROOT}/*/session/*/*", f"{ROOT}/*/progress/*/*"]
_TOKENS = ["liveliness_token", "liveliness_query", "declare_liveliness_subscriber"]
_ALL = ["put", "delete", "declare_subscriber", "query", "reply", "declare_queryable", *_TOKENS]
_BOTH = ["ingress", "egress"]
_RULES: dict[str, tuple[tuple[str, ...], list[str], list[str], list[str]]] = {
    # name: who may; which way, seen from the router; what; where. zenoh's ** does not match what begins with @
    "everything": ((SERVICE,), _BOTH, _ALL, [f"{ROOT}/**", _LIVE, EVERY_NODE]),
    "ask": ((CLIENT,), ["ingress"], ["query"], _ASKED),
    "be answered": ((CLIENT,), ["egress"], ["reply", "declare_queryable"], _ASKED),  # else zenoh soon asks nobody
    "live": ((CLIENT,), ["ingress"], ["liveliness_token"], [f"{ROOT}/*/@live/client/session/*"]),
    "look": ((CLIENT, VIEWER), ["ingress"], ["declare_subscriber"], _SEEN),
    "see": ((CLIENT, VIEWER), ["egress"], ["put"], _SEEN),
    "look who lives": ((CLIENT, VIEWER), ["ingress"], _TOKENS[1:], [_LIVE]),
    "see who lives": ((CLIENT, VIEWER), ["egress"], ["liveliness_token", "reply"], [_LIVE]),
}


def access_control() -> Settings:
    """What the router lets each role do: nothing but this."""
    rules = [
        {"id": name, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": keys}
        for name, (_, flows, messages, keys) in _RULES.items()
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": role, "usernames": [role]} for role in ROLES],
        "policies": [{"rules": [name], "subjects": list(who)} for name, (who, *_) in _RULES.items()],
    }


def router_settings(key: Key, listen: Iterable[str], connect: Iterable[str]) -> Settings:
    """Of a router, to other routers a service. Raises BusError."""
    admits = {f"{_USER}dictionary_file": str(key.path.with_name(ROUTER_ADMITS)), "access_control": access_control()}
    return {**joining(key, connect), **admits, **_certificate(key, listen)}


def service_settings(key: Key, connect: Iterable[str], listen: Iterable[str]) -> Settings:
    """Of a service that others reach directly: only services do. Raises BusError."""
    admits = {f"{_USER}dictionary_file": str(key.path.with_name(SERVICES_ADMIT))}
    return {**joining(key, connect), **admits, **_certificate(key, listen)}


def joining(key: Key, connect: Iterable[str]) -> Settings:
    """Of whoever joins by a key. Raises BusError."""
    settings: dict[str, object] = {f"{_USER}user": key.role, f"{_USER}password": key.password}
    for endpoint in connect:
        if _encrypted(endpoint) and not key.authority:
            raise BusError(
                f"{endpoint}: {key.path} has no certificate to know the router by: have a client.key handed to you "
                "from where `softseam keys --host NAME` was run"
            )
    if key.authority:
        settings[f"{_TLS}root_ca_certificate_base64"] = base64.b64encode(key.authority.encode()).decode()
        # zenoh introduces services to each other by numbers of hosts, which no certificate of ours names
        ours = key.role == SERVICE and (_tls(key) / "ca.key").exists()
        settings[f"{_TLS}verify_name_on_connect"] = not ours
    return settings


def _certificate(key: Key, listen: Iterable[str]) -> Settings:
    """What a listener shows who it is by, where that goes beyond loopback. Raises BusError."""
    for endpoint in listen:
        if _encrypted(endpoint) and not (_tls(key) / "host.pem").exists():
            raise BusError(f"{endpoint} needs a certificate in {_tls(key)}: run `softseam keys --host NAME`")
    if not any(map(_encrypted, listen)):
        return {}
    return {
        f"{_TLS}listen_private_key": str(_tls(key) / "host.key"),
        f"{_TLS}listen_certificate": str(_tls(key) / "host.pem"),
        f"{_TLS}close_link_on_expiration": True,
    }


def _tls(key: Key) -> Path:
    return key.path.with_name(CERTIFICATES)


def _encrypted(endpoint: str) -> bool:
    return endpoint.partition("/")[0] in _ENCRYPTED


def beyond(endpoint: str) -> bool:
    """Whether what is sent there leaves this machine, or comes from elsewhere, for others to read."""
    found = _HOST_PORT.fullmatch(endpoint)
    if found is None or endpoint.partition("/")[0] not in _OF_HOSTS - _ENCRYPTED:
        return False
    try:
        return not ipaddress.ip_address(found[1].strip("[]")).is_loopback
    except ValueError:
        return found[1] != "localhost"


def check_endpoints(connect: Iterable[str], listen: Iterable[str] = ()) -> None:
    """Raise BusError for what is no endpoint, or leaves this machine and is not encrypted."""
    for endpoint in (*connect, *listen):
        _check_form(endpoint)
    for endpoint in filter(beyond, listen):
        raise BusError(
            f"{endpoint} is open to other machines: run `softseam keys --host NAME`, then give tls/HOST:PORT"
        )
    for endpoint in filter(beyond, connect):
        raise BusError(
            f"{endpoint}: beyond this machine the bus is encrypted: connect to tls/HOST:PORT, which `softseam keys "
            "--host NAME` prepares there"
        )


def _check_form(endpoint: str) -> None:
    """zenoh would say so in terms of its own, or try to reach it all the same."""
    if endpoint.partition("/")[0] in _OF_HOSTS:
        found = _HOST_PORT.fullmatch(endpoint)
        good = found is not None and int(found[2]) < 2**16
    else:
        good = _OTHER.fullmatch(endpoint) is not None
    if not good:
        raise BusError(f"{endpoint!r} is no endpoint: give tcp/HOST:PORT, such as {DEFAULT_ENDPOINT}")


# ---- why nobody answers ------------------------------------------------------------------------------------


def address(endpoint: str) -> tuple[str, int] | None:
    """Host and port of an endpoint that takes connections by TCP."""
    found = _HOST_PORT.fullmatch(endpoint)
    if found is None or endpoint.partition("/")[0] in ("udp", "quic"):
        return None
    return found[1].strip("[]"), int(found[2])


def listens(endpoint: str) -> bool:
    """Whether anybody takes connections there, as far as that can be known."""
    where = address(endpoint)
    if where is None:
        return False
    try:
        socket.create_connection(where, _PROBE).close()
    except OSError:
        return False
    return True


def refusal(endpoints: Sequence[str], key: Key, waited: float) -> BusError:
    """Why a session could not be opened, for which zenoh has one sentence."""
    there = [endpoint for endpoint in endpoints if listens(endpoint)]
    if not there:
        return nobody(endpoints, waited)
    why = _not_spoken(there[0], key.authority)
    return KeyRefused(
        f"{there[0]}: {why}"
        if why
        else f"the router at {there[0]} does not let {key.path} in: its keys are others. Set SOFTSEAM_KEYS to "
        "the keys of who started it, or to its client.key; or what listens there is no router of softseam"
    )


def nobody(endpoints: Sequence[str], waited: float) -> NoRouter:
    return NoRouter(
        f"no router answers at {', '.join(endpoints)} within {waited:g} s: start one with `softseam up` or "
        "`softseam serve router`, or name another endpoint"
    )


def _not_spoken(endpoint: str, authority: str) -> str:
    """What is wrong with the encryption there, '' where nothing is."""
    import ssl

    encrypted = _encrypted(endpoint)
    try:
        _shown_until(endpoint, authority if encrypted else "")
    except ssl.SSLCertVerificationError as error:
        return f"its certificate is not accepted: {error.verify_message.rstrip('.')}"
    except OSError:
        return (
            "what listens there is not encrypted, so it is not the router that you were given keys for"
            if encrypted
            else ""
        )
    return "" if encrypted else f"what listens there is encrypted: connect to tls/{endpoint.partition('/')[2]}"


def days_left(endpoints: Iterable[str], key: Key) -> float | None:
    """For how long the router's certificate is good [days]; None where it shows none. Raises OSError."""
    ends = [_shown_until(endpoint, key.authority) for endpoint in endpoints if _encrypted(endpoint)]
    return (min(ends) - time.time()) / _DAY if ends else None


def _shown_until(endpoint: str, authority: str) -> float:
    """When the certificate that an endpoint shows ends, in seconds since 1970; 0 without an authority to check it by.

    Raises OSError, ssl.SSLCertVerificationError among them.
    """
    import ssl

    context = ssl.create_default_context(cadata=authority or None)
    if not authority:
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    where = address(endpoint)
    if where is None:
        raise OSError(f"{endpoint} is not reached by TCP")
    with socket.create_connection(where, _PROBE) as plain, context.wrap_socket(plain, server_hostname=where[0]) as link:
        found = link.getpeercert() or {}
    return ssl.cert_time_to_seconds(str(found["notAfter"])) if "notAfter" in found else 0.0
