"""Writes to the 3D view from the web process's own thread do not touch viser's loop."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from tests.waiting import wait_for
from web.view.server import ViewServer

WAIT = 10.0  # s: a bound, not an expectation


@pytest.fixture
def server() -> Iterator[ViewServer]:
    made = ViewServer()
    yield made
    made.stop()


def test_only_visers_loop_touches_who_waits_for_a_write(server: ViewServer) -> None:
    buffer: Any = server.viser._websock_server._broadcast_buffer
    event, going = buffer.message_event, threading.Event()

    async def next_write() -> bool:
        event.clear()
        return bool(await event.wait())

    waiting = asyncio.run_coroutine_threadsafe(next_write(), buffer.event_loop)
    wait_for(lambda: len(event._waiters) == 1, WAIT, "a waiting task")
    buffer.event_loop.call_soon_threadsafe(going.wait, WAIT)
    server.viser.scene.add_frame("/written")
    assert [one.done() for one in event._waiters] == [False]
    assert event.is_set()  # viser must see it at once
    going.set()
    assert waiting.result(WAIT)


def test_writes_of_an_atomic_block_wake_at_its_end(server: ViewServer) -> None:
    buffer: Any = server.viser._websock_server._broadcast_buffer
    frame = server.viser.scene.add_frame("/moved")

    async def next_write() -> bool:
        buffer.message_event.clear()
        return bool(await buffer.message_event.wait())

    waiting = asyncio.run_coroutine_threadsafe(next_write(), buffer.event_loop)
    wait_for(lambda: len(buffer.message_event._waiters) == 1, WAIT, "a waiting task")
    with server.viser.atomic():
        frame.position = (1.0, 2.0, 3.0)
        assert not waiting.done()
    assert waiting.result(WAIT)
