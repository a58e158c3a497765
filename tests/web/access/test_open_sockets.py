"""A websocket whose session is over ends, whether its application and its peer notice or not."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from web.access import open_sockets
from web.access.database import AccessDatabase
from web.access.open_sockets import SIGNED_OUT, OpenSockets
from web.access.roles import Role
from web.access.sessions import Sessions


@pytest.fixture
def sessions(tmp_path: Path) -> Iterator[Sessions]:
    database = AccessDatabase(tmp_path)
    yield Sessions(database)
    database.close()


class Peer:
    """Other side of one socket."""

    def __init__(self, *, stalled: bool = False) -> None:
        self.frames: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self.sent: list[Any] = []
        self._stalled = stalled

    async def receive(self) -> dict[str, Any]:
        return await self.frames.get()

    async def send(self, message: Any) -> None:
        if self._stalled:
            await asyncio.Event().wait()
        self.sent.append(message)
        if message["type"] == "websocket.close":  # as uvicorn does
            await self.frames.put({"type": "websocket.disconnect", "code": message["code"]})


def serve(sessions: Sessions, app: Any, peer: Peer) -> tuple[OpenSockets, Any, asyncio.Task[None]]:
    sockets = OpenSockets(sessions)
    session = sessions.open("operator 1", Role.OPERATOR)
    served = sockets.serve(app, session, {}, peer.receive, peer.send)
    return sockets, session, asyncio.get_running_loop().create_task(served)


def test_frames_pass_until_the_session_ends_and_not_after(sessions: Sessions) -> None:
    heard: list[str] = []

    async def app(_: Any, receive: Any, send: Any) -> None:
        while (message := await receive())["type"] != "websocket.disconnect":
            heard.append(message["text"])
        heard.append(f"gone {message['code']}")
        with pytest.raises(OSError, match="signed out"):
            await send({"type": "websocket.send", "text": "too late"})

    async def scenario() -> list[Any]:
        peer = Peer()
        sockets, session, task = serve(sessions, app, peer)
        await peer.frames.put({"type": "websocket.receive", "text": "before"})
        while not heard:
            await asyncio.sleep(0)
        sockets.check()
        sessions.end(session)
        sockets.check()
        await peer.frames.put({"type": "websocket.receive", "text": "after"})
        await task
        return peer.sent

    assert asyncio.run(scenario()) == [
        {"type": "websocket.close", "code": SIGNED_OUT, "reason": "signed out"}
    ]
    assert heard == ["before", f"gone {SIGNED_OUT}"]


def test_an_application_that_does_not_notice_is_cancelled(
    sessions: Sessions, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its peer has stopped reading, so not even the close frame is sent."""
    monkeypatch.setattr(open_sockets, "GRACE", 0.0)
    released: list[str] = []

    async def app(_: Any, receive: Any, send: Any) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            released.append("sticks")

    async def scenario() -> None:
        sockets, session, task = serve(sessions, app, Peer(stalled=True))
        await asyncio.sleep(0)
        sessions.end(session)
        sockets.check()
        await task  # returns: the cancellation came from the guard and is over
        assert not task.cancelled()

    asyncio.run(scenario())
    assert released == ["sticks"]


def test_a_cancellation_from_outside_is_passed_on(sessions: Sessions) -> None:
    async def app(_: Any, receive: Any, send: Any) -> None:
        await asyncio.Event().wait()

    async def scenario() -> None:
        _, _, task = serve(sessions, app, Peer())
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(scenario())


def test_the_look_for_ended_sessions_is_often_enough() -> None:
    assert open_sockets.PERIOD + open_sockets.GRACE < 2.0


def test_a_session_with_too_many_sockets_gets_no_more_and_other_sessions_do(
    sessions: Sessions, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(open_sockets, "MOST", 2)

    async def app(_: Any, receive: Any, __: Any) -> None:
        await receive()

    async def run() -> None:
        peers = [Peer() for _ in range(4)]
        sockets, session, first = serve(sessions, app, peers[0])
        another = sessions.open("operator 2", Role.OPERATOR)
        served = [first]
        for peer, who in zip(peers[1:], (session, session, another), strict=True):
            work = sockets.serve(app, who, {"type": "websocket"}, peer.receive, peer.send)
            served.append(asyncio.get_running_loop().create_task(work))
        await served[2]
        (refusal,) = peers[2].sent
        assert refusal["code"] == 1008
        assert "operator 1 has 2 connections" in refusal["reason"]
        assert sockets.labels == {"operator 1", "operator 2"}
        for peer in (peers[0], peers[1], peers[3]):
            assert peer.sent == []
            peer.frames.put_nowait({"type": "websocket.disconnect", "code": 1000})
        await asyncio.gather(*served)

    asyncio.run(run())
