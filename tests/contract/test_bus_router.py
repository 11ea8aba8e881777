"""A router that is not there, comes late, goes and comes back, or finds its port taken; and what is no endpoint."""

from __future__ import annotations

import re
import threading
import time

import pytest
from asked import free_endpoint, served, until

from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.errors import BusError, BusTimeout, NoReply, NoRouter, PortBusy
from softseam_protocol.topics import Keys

KEY = Keys("test").participant("fem")


def test_no_router_names_the_endpoint_and_the_remedy() -> None:
    """And soon: in one of three tries, for the machine may have other things to do."""
    where = free_endpoint()
    took: list[float] = []
    while not took or (min(took) >= 3.0 and len(took) < 3):
        began = time.monotonic()
        with pytest.raises(NoRouter, match=f"{where}.*softseam up"):
            Bus(where, connect_timeout=0.3)
        took.append(time.monotonic() - began)
    assert min(took) < 3.0


@pytest.mark.parametrize(
    "endpoint", ["nonsense", "tcp/localhost", "127.0.0.1:7447", "tcp/127.0.0.1:port", "tls/here:99999", "tcp/", ""]
)
def test_what_is_no_endpoint_is_told_what_one_looks_like(endpoint: str) -> None:
    told = re.escape(f"{endpoint!r} is no endpoint: give tcp/HOST:PORT, such as tcp/127.0.0.1:7447")
    for refused in (Bus, Router):
        with pytest.raises(BusError, match=f"^{told}$"):
            refused(endpoint)
    with pytest.raises(BusError, match=f"^{told}$"):
        Bus(free_endpoint(), extra={"mode": "peer", "listen/endpoints": [endpoint]})


def test_a_busy_port_names_the_endpoint_and_the_remedy() -> None:
    where = free_endpoint()
    with Router(where), pytest.raises(PortBusy, match=f"{where}.*in use"):
        Router(where)


def test_a_client_waits_for_a_router_that_comes_late() -> None:
    where = free_endpoint()
    connected: list[Bus] = []
    thread = threading.Thread(target=lambda: connected.append(Bus(where, connect_timeout=10.0)))
    thread.start()
    with Router(where):
        thread.join(10.0)
        assert len(connected) == 1
        connected[0].close()


def test_clients_survive_a_restart_of_the_router() -> None:
    where = free_endpoint()
    router = Router(where)
    with Bus(where, role=SERVICE) as asking, Bus(where, role=SERVICE) as answering:
        answering.serve({KEY: lambda payload: payload}).start()
        assert until(lambda: served(asking, KEY))
        router.close()
        with pytest.raises((NoReply, BusTimeout)):
            asking.request(KEY, b"x", 1.0)
        with Router(where):
            assert until(lambda: served(asking, KEY), 20.0)
            assert asking.request(KEY, b"y", 2.0) == b"y"
