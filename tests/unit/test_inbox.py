"""The inbox: bounded, never blocks the sender, counts what it loses."""

from __future__ import annotations

import threading

from softseam_protocol.bus.inbox import Inbox


def test_what_does_not_fit_is_dropped_and_counted() -> None:
    inbox: Inbox[int] = Inbox(limit_bytes=10)
    for i in range(4):
        inbox.put(i, 4)
    assert (len(inbox), inbox.lost) == (2, 2)
    assert inbox.get(0.0) == 0
    inbox.put(9, 6)
    assert [inbox.get(0.0), inbox.get(0.0), inbox.get(0.0)] == [1, 9, None]


def test_latest_keeps_the_newest() -> None:
    inbox: Inbox[int] = Inbox(latest=True, limit_bytes=10)
    for i in range(4):
        inbox.put(i, 8)
    assert (inbox.get(0.0), inbox.get(0.0), inbox.lost) == (3, None, 0)


def test_close_wakes_a_waiting_reader_and_keeps_what_came() -> None:
    inbox: Inbox[int] = Inbox()
    woken: list[int | None] = []
    reader = threading.Thread(target=lambda: woken.append(inbox.get(30.0)))
    reader.start()
    inbox.close()
    reader.join(5.0)
    assert woken == [None] and inbox.closed
    inbox.put(1, 0)
    assert inbox.get(0.0) == 1
