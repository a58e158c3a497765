"""Emergency land and cut: sent, retried, and watched until the vehicle shows it.

The newest press is published to every page (event type `emergency`, and in the `hello` of a page
that connects later): the person who pressed wants to know, and the others must know too. A press is

- `sent` until the vehicle has answered (try n of 3, under one request id, so it is done once),
- `accepted` until a status received after the press shows it: for a landing, the one that
  `safety.emergency_land` chooses, or a worse one; the microcontroller's once it has taken over,
- `acknowledged`, or `failed` with its reason.

Presses of one kind are joined to one call while it is under way: however often anyone presses,
there are at most two calls, so that none waits for a thread.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from quadrotor.errors import LinkError, QuadlabError
from vehicle_link.messages.records import VehicleStatus
from web.latest import Live

log = logging.getLogger("quadlab.web")

TRIES = 3
SPACING = 0.5  # s at least from one try to the next: an immediate failure may be over soon
LOOKS = 0.02  # s between checks of the newest status
PATIENCE = 10.0  # s for an accepted press to show in the status
OVER = ("cut", "ready")
"""Modes that show that a landing or a cut was done.

`ready` does, because a vehicle already on the ground with its motors off refuses both.
"""
LANDINGS = ("land", "descend", "emergency")
"""Choices of safety.emergency_land, from the mildest."""
NAMES = {"land": "emergency land", "cut": "cut of the motors"}

Message = dict[str, Any]


class Commander(Protocol):
    async def command(self, service: str, requester: str, **fields: Any) -> Any:
        """Raise RefusedError with the vehicle's reason, LinkError when it did not answer."""
        ...


@dataclass(slots=True)
class Press:
    action: str  # land or cut
    requester: str
    id: str
    pressed: float  # s, monotonic
    phase: str = "sent"
    tries: int = 1
    after: float | None = None  # s until it was acknowledged
    reason: str = ""
    answered: asyncio.Future[None] = field(default_factory=asyncio.Future)

    @property
    def pending(self) -> bool:
        return self.phase in ("sent", "accepted")


class EmergencyCommands:
    """Emergency commands of one event loop.

    Args:
        publish: sends a message to all pages.
        say: called with (level, line) for everyone's list of events.
        chosen: returns safety.emergency_land, None while that is not known.
    """

    def __init__(
        self,
        station: Commander,
        live: Live,
        publish: Callable[[Message], None],
        say: Callable[[str, str], None],
        clock: Callable[[], float] = time.monotonic,
        chosen: Callable[[], Any] = lambda: None,
    ) -> None:
        self._station, self._live = station, live
        self._chosen = chosen
        self._publish, self._say = publish, say
        self._clock = clock
        self._newest: Press | None = None
        self._cut_at = -math.inf
        self._under_way: dict[str, Press] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def state(self) -> Message | None:
        """Return the newest press as sent to pages; None before the first."""
        return None if self._newest is None else self._as_message(self._newest)

    async def press(self, action: str, requester: str, request_id: str | None = None) -> str:
        """Send the command until the vehicle has accepted it, and return the id of the press.

        A press that joins a call under way returns the id of that call's press.

        Raises RefusedError with the vehicle's reason, or LinkError.
        """
        press = self._under_way.get(action)
        if press is None:
            press = Press(action, requester, request_id or uuid.uuid4().hex, self._clock())
            self._under_way[action] = press
            newest = self._newest
            # A cut that is not yet acknowledged remains visible when a landing is pressed.
            is_hidden = newest is not None and newest.pending and newest.action == "cut"
            if action == "cut" or not is_hidden:
                self._newest = press
            if action == "cut":
                self._cut_at = press.pressed
            self._tell(press)
            for work in (self._send(press), self._watch(press)):
                task = asyncio.create_task(work)
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
        await asyncio.shield(press.answered)
        return press.id

    async def _send(self, press: Press) -> None:
        try:
            await self._try(press)
        except QuadlabError as error:
            self._unanswered(press, error)
        except Exception as error:  # a defect must not leave a caller waiting
            log.exception("emergency %s", press.action)
            self._unanswered(press, LinkError(f"defect, see the log of quadlab web: {error!r}"))
        else:
            press.answered.set_result(None)
            if press.phase == "sent":
                press.phase = "accepted"
                self._tell(press)
        finally:
            self._under_way.pop(press.action, None)

    def _unanswered(self, press: Press, error: QuadlabError) -> None:
        press.answered.set_exception(error)
        press.answered.exception()  # retrieve it, even if no caller waits any more
        shown = isinstance(error, LinkError) and self._shows(press)
        if press.phase == "sent" and not shown:
            press.reason = str(error)
            self._finish(press, "failed")
        elif press.phase == "sent":
            press.reason = "its answer was lost"
            self._finish(press, "acknowledged")

    async def _try(self, press: Press) -> None:
        """Send a press until it is answered. Raises RefusedError, or the last LinkError."""
        # A cut under the id of a landing would get the landing's answer and not be done.
        request_id = uuid.uuid5(uuid.NAMESPACE_OID, f"{press.action} {press.id}").hex
        for number in range(1, TRIES + 1):
            began = self._clock()
            if number > 1:
                press.tries = number
                self._tell(press)
            try:
                await self._station.command(
                    "emergency", press.requester, action=press.action, request_id=request_id
                )
                return
            except LinkError:
                if number == TRIES:
                    raise
            await asyncio.sleep(max(began + SPACING - self._clock(), 0.0))
            if press.action == "land" and self._cut_at >= press.pressed:
                raise LinkError("not answered; a cut followed it")  # the cut must not wait for it

    async def _watch(self, press: Press) -> None:
        """Watch an accepted press until the status shows it, or the time is over."""
        while press.pending:
            await asyncio.sleep(LOOKS)
            if press.phase != "accepted":
                continue
            if self._shows(press):
                self._finish(press, "acknowledged")
            elif self._clock() - press.pressed > PATIENCE:
                press.reason = f"accepted, but {self._missing(press)} within {PATIENCE:g} s"
                self._finish(press, "failed")

    def _shows(self, press: Press) -> bool:
        """Return whether a status received after the press shows it."""
        if self._live.age("status") >= self._clock() - press.pressed:
            return False
        status = self._live.newest("status")
        if status is None or str(status.mode).lower() in OVER:
            return status is not None
        return press.action == "land" and self._lands(status)

    def _lands(self, status: VehicleStatus) -> bool:
        """Return whether the vehicle lands as chosen, or worse.

        Without a pose it cannot land by one.
        """
        if str(status.mode).lower() != "emergency_land":
            return False
        if str(status.control_mode).lower() == "emergency":
            shown = "emergency"
        else:
            is_descent = str(status.behavior).lower() == "emergency_landing"
            shown = "descend" if is_descent else "land"
        chosen = self._chosen()
        return chosen not in LANDINGS or LANDINGS.index(shown) >= LANDINGS.index(chosen)

    def _missing(self, press: Press) -> str:
        if press.action == "land" and self._chosen() == "emergency":
            return "the microcontroller has not taken over"
        return "not shown by the vehicle"

    def _finish(self, press: Press, phase: str) -> None:
        press.phase = phase
        press.after = self._clock() - press.pressed
        if phase == "failed":
            name = NAMES[press.action]
            self._say("error", f"{name} by {press.requester} failed: {press.reason}")
        self._tell(press)

    def _tell(self, press: Press) -> None:
        if press is self._newest:
            self._publish({"type": "emergency", "press": self._as_message(press)})

    def _as_message(self, press: Press) -> Message:
        """Return a press as a message; `age` is in s since the press, not a time of this clock."""
        return {
            "id": press.id,
            "action": press.action,
            "by": press.requester,
            "phase": press.phase,
            "try": press.tries,
            "tries": TRIES,
            "age": round(self._clock() - press.pressed, 3),
            "after": None if press.after is None else round(press.after, 3),
            "reason": press.reason,
        }
