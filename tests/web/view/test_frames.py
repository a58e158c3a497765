"""Pages that keep up get one frame, packed once; a page that lags gets a separate one."""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import struct
from collections.abc import AsyncIterator
from typing import Any

import msgspec
import numpy as np
import pytest
import zstandard
from viser import _messages
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer

from web.view import frames as view_frames

PAGES = 5


class Page:
    """Other end of one client of viser, which stores its frames and can be slow."""

    def __init__(self) -> None:
        self.frames: list[bytes] = []
        self.awake = asyncio.Event()
        self.awake.set()
        self._came = asyncio.Condition()

    async def send(self, frame: bytes) -> None:
        await self.awake.wait()
        async with self._came:
            self.frames.append(frame)
            self._came.notify_all()

    async def has(self, position: float) -> None:
        """Wait for this position of `/vehicle`."""
        async with self._came, asyncio.timeout(10.0):
            await self._came.wait_for(lambda: position in self.seen)

    @property
    def seen(self) -> list[float]:
        """Return the positions of `/vehicle` in order."""
        messages = [m for frame in self.frames for m in unpacked(frame)["messages"]]
        return [m["position"][0] for m in messages if m["type"] == "SetPositionMessage"]


class Room:
    """Pages on one buffer, served as by viser."""

    def __init__(self) -> None:
        self.buffer = AsyncMessageBuffer(asyncio.get_running_loop(), persistent_messages=True)
        self._serving: list[asyncio.Task[None]] = []

    def enter(self) -> Page:
        page, number = Page(), len(self._serving)
        # As viser does: by the name in its own module.
        serving = _infra._message_producer(page, self.buffer, number)  # type: ignore[arg-type]
        self._serving.append(asyncio.create_task(serving))
        return page

    def move(self, x: float) -> None:
        self.buffer.push(_messages.SetPositionMessage("/vehicle", (x, 0.0, 0.0)))

    async def close(self) -> None:
        for task in self._serving:
            task.cancel()
        await asyncio.gather(*self._serving, return_exceptions=True)


@contextlib.asynccontextmanager
async def opened() -> AsyncIterator[Room]:
    room = Room()
    yield room
    await room.close()


@pytest.fixture(autouse=True)
def shared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_infra, "_message_producer", view_frames._viser_producer)
    view_frames.share_frames()


def unpacked(frame: bytes) -> dict[str, Any]:
    """Return the msgpack of one of viser's frames: two lengths of 8 bytes, then zstd."""
    size, packed = struct.unpack_from("<QQ", frame)
    inner = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed], size)
    found: dict[str, Any] = msgspec.msgpack.decode(inner)
    return found


def test_pages_that_keep_up_get_the_same_frame_packed_once() -> None:
    async def run() -> None:
        async with opened() as room:
            pages = [room.enter() for _ in range(PAGES)]
            for x in (1.0, 2.0, 3.0):
                room.move(x)
                for page in pages:
                    await page.has(x)
            for frames in zip(*(page.frames for page in pages), strict=True):
                assert len({id(frame) for frame in frames}) == 1

    asyncio.run(run())


def test_a_page_that_lags_gets_the_newest_and_holds_nobody_up() -> None:
    async def run() -> None:
        async with opened() as room:
            quick, slow = room.enter(), room.enter()
            room.move(0.0)
            await slow.has(0.0)
            slow.awake.clear()
            for x in range(1, 6):
                room.move(float(x))
                await quick.has(float(x))
            slow.awake.set()
            await slow.has(5.0)
            assert quick.seen == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
            assert slow.seen[-1] == 5.0
            assert len(slow.seen) <= 3, "one frame was under way when it fell asleep"

    asyncio.run(run())


def test_a_page_that_comes_later_gets_all_there_is_and_then_what_the_others_get() -> None:
    async def run() -> None:
        async with opened() as room:
            early = room.enter()
            room.buffer.push(_messages.RemoveSceneNodeMessage("/gone"))
            room.move(1.0)
            await early.has(1.0)
            late = room.enter()
            await late.has(1.0)
            assert unpacked(late.frames[0])["messages"][0]["name"] == "/gone"
            room.move(2.0)
            await early.has(2.0)
            await late.has(2.0)
            assert early.frames[-1] is late.frames[-1]

    asyncio.run(run())


def test_arrays_arrive_as_viser_packs_them() -> None:
    points = np.arange(12, dtype=np.float32).reshape(2, 2, 3)

    async def run() -> None:
        async with opened() as room:
            pages = [room.enter() for _ in range(2)]
            room.buffer.push(_messages.SceneNodeUpdateMessage("/flown/head", {"points": points}))
            room.move(1.0)
            for page in pages:
                await page.has(1.0)
                assert page.frames[0].endswith(points.tobytes())

    asyncio.run(run())


def test_the_producer_we_replace_is_called_as_ours_is() -> None:
    """A newer viser may change it: then the version range in pyproject.toml must exclude it."""
    ours, theirs = (
        list(inspect.signature(producer).parameters)
        for producer in (view_frames._produce, view_frames._viser_producer)
    )
    assert ours == theirs
    assert "_message_producer(" in inspect.getsource(_infra.WebsockServer._background_worker)
