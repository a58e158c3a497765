"""`/ws/stick`: the sticks of one page, published to the station as `stick` (sensor_msgs/Joy).

A page sends 28 B at 50 Hz while its dead-man button is held: four float32 axes (forward, left,
up, yaw; -1 to 1), float32 1.0 for the button, the frame's number, and in the last frame the cause
why it stops. Each frame is answered with `{"n": number, "by": "station" or "web", "on": …,
"why": …}`: by the station if the frame was forwarded to it, otherwise by this process.

The button counts from a press with all sticks centred, until a cause drops it. Then it must be
released and pressed again, so that a page that was frozen does not resume flying by itself.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import struct
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import msgspec
from fastapi import WebSocket

from web.access.roles import Role, Session
from web.live.conversation import converse

_FRAME = struct.Struct("<5f2I")
SILENCE = 0.25  # s
CENTRED = 0.05
"""Largest deflection at which the button starts to count; a page sends exact zeros then."""
CAUSES = (
    "released",
    "the window lost focus",
    "the tab is hidden",
    "the pad was unplugged",
    "the page froze",
    "the replies were late",
    "the page was left",
    "its sticks are being set up",
    "the pad sent nothing for 0.5 s",
)
"""Reasons why a page releases the sticks, by the number in its frame."""
RELEASED, CLOSED = CAUSES[0], "the page closed"
REMEMBERED = 64  # frames whose answer may still arrive
WAITING = 20  # unsent answers to a page; older ones are dropped

Axes = tuple[float, float, float, float]
_CENTRE: Axes = (0.0, 0.0, 0.0, 0.0)
Answered = Callable[[bool, str], None]
"""Called with the station's answer: whether the vehicle gets a frame's sticks, and why not."""
_encode = msgspec.json.Encoder().encode


@dataclass(frozen=True, slots=True)
class Frame:
    axes: Axes
    held: bool
    number: int
    cause: str


def read_frame(raw: bytes) -> Frame:
    """Read a frame of the sticks. Raises ValueError for anything else."""
    if len(raw) != _FRAME.size:
        raise ValueError(f"{len(raw)} bytes; a stick frame has {_FRAME.size}")
    *axes, button, number, cause = _FRAME.unpack(raw)
    if not all(math.isfinite(a) for a in (*axes, button)):
        raise ValueError("a stick frame must be finite")
    if cause >= len(CAUSES):
        raise ValueError(f"a stick frame's cause is 0 to {len(CAUSES) - 1}, not {cause}")
    forward, left, up, yaw = (max(-1.0, min(1.0, a)) for a in axes)
    return Frame((forward, left, up, yaw), button > 0.5, number, CAUSES[cause])


class DeadManSwitch:
    """One page's button: whether it counts, or why it does not. It has no side effects."""

    def __init__(self) -> None:
        self.on = False
        self.why = "release the button first"  # while held and not on; "" = released
        self._last = -math.inf

    def take(self, frame: Frame, now: float) -> bool:
        """Handle a frame, and return whether the sticks are on with it."""
        silence, self._last = now - self._last, now
        if not frame.held:
            self.on, self.why = False, ""
        elif self.on and silence > SILENCE:
            self.refuse(f"the page was silent for {silence:.2f} s")
        elif not self.on and not self.why:
            if silence > SILENCE:
                self.refuse("release the button first")
            elif max(map(abs, frame.axes)) > CENTRED:
                self.refuse("centre all sticks, then press again")
            else:
                self.on = True
        return self.on

    def refuse(self, why: str) -> None:
        """Refuse the sticks until the button is released."""
        self.on, self.why = False, why


class StickOutput:
    """Output of the sticks, which lets one page through at a time.

    All methods are for the event loop's thread.

    Args:
        publish: called with (axes, enabled, requester); returns the stamp, in ns, by which the
            station will answer, or 0 if there is no station.
    """

    def __init__(
        self, publish: Callable[[Axes, bool, str], int], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._publish = publish
        self._clock = clock
        self._owner: object | None = None
        self._requester = ""
        self._until = -math.inf
        self._asked: OrderedDict[int, Answered] = OrderedDict()

    def send(self, switch: object, axes: Axes, requester: str, answered: Answered) -> bool:
        """Publish the sticks unless another switch has them; return whether this one does."""
        now = self._clock()
        if self._owner is not switch and self._owner is not None and now <= self._until:
            return False
        self._owner, self._requester, self._until = switch, requester, now + SILENCE
        if stamp_ns := self._publish(axes, True, requester):
            self._asked[stamp_ns] = answered
            while len(self._asked) > REMEMBERED:
                self._asked.popitem(last=False)
        return True

    def release(self, switch: object, let_go: str = "") -> None:
        """Publish zero and disabled, once, if this switch had the sticks.

        Args:
            let_go: the requester who released the button. It is passed on even while no switch has
                the sticks: a station that dropped them waits for the release, and may have missed
                it if the web process was restarted.
        """
        if self._owner is switch:
            self._owner = None
            self._publish(_CENTRE, False, self._requester)
        elif self._owner is None and let_go:
            self._publish(_CENTRE, False, let_go)

    def answer(self, stamp_ns: int, on: bool, why: str) -> None:
        """Pass on the station's answer to a frame.

        The last frame gets a second one when a silence drops the sticks.
        """
        if (answered := self._asked.get(stamp_ns)) is not None:
            answered(on, why)


async def serve(
    socket: WebSocket,
    output: StickOutput,
    session: Session,
    may: Callable[[str], bool],
    say: Callable[[str, str], None],
) -> None:
    """Serve one page's sticks until it disconnects.

    Args:
        may: returns whether this requester has control, or may take it now; called with each frame.
        say: called with (level, line) for everyone's list of events.
    """
    if not session.role.may(Role.OPERATOR):
        await socket.close(1008, "viewers cannot use the sticks; ask an operator")
        return
    await socket.accept()
    switch, label = DeadManSwitch(), session.label
    answers: asyncio.Queue[bytes] = asyncio.Queue()

    def tell(number: int, by: str, on: bool, why: str) -> None:
        while answers.qsize() >= WAITING:
            answers.get_nowait()
        answers.put_nowait(_encode({"n": number, "by": by, "on": on, "why": why}))

    def take(frame: Frame) -> None:
        was_on = switch.on
        if switch.take(frame, time.monotonic()):
            if not may(label):
                switch.refuse("someone else has control")
            elif not output.send(switch, frame.axes, label, partial(tell, frame.number, "station")):
                switch.refuse("another page sends the sticks")
        if switch.on:
            return
        output.release(switch, "" if frame.held else label)
        tell(frame.number, "web", False, switch.why)
        cause = switch.why or frame.cause
        if was_on and cause != RELEASED:
            say("warn", f"sticks of {label} dropped: {cause}")

    async def listen() -> None:
        while (event := await socket.receive())["type"] != "websocket.disconnect":
            take(read_frame(event.get("bytes") or b""))

    try:
        await converse(socket, _send(socket, answers), listen())
    except ValueError as error:
        await socket.close(1008, str(error))
    finally:
        output.release(switch)
        if switch.on:
            say("warn", f"sticks of {label} dropped: {CLOSED}")


async def _send(socket: WebSocket, answers: asyncio.Queue[bytes]) -> None:
    with contextlib.suppress(RuntimeError):  # the socket is closed
        while True:
            await socket.send_text((await answers.get()).decode())
