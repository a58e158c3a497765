"""Sets and requests, repeated every 25 ms until answered, at most 40 times. Pure, without waiting.

A `Request` is one value to set or to ask for; an `Exchange` holds those that are open. The owner of
the ports sends what `service` returns and passes every reply to `settle`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from vehicle_link.serial.commands import (
    VALUE,
    decode_mirrored,
    decode_value,
    encode_mirror,
    encode_request,
    encode_set,
)
from vehicle_link.serial.frames import Frame
from vehicle_link.serial.ids import Id

REPEAT_S = 0.025
TRIES = 40
SLOW_REPEAT_S = 1.0
"""Seconds between repetitions of a `persistent` request after all tries: the microcontroller may be
switched on later."""
MIRROR_KEY = -(2**15) - 1
"""Key of the list of mirrored ids: not an id, because it does not fit 16 bits."""

CHECK = ". Check the cables, the ports and its firmware"
OTHER_ROBOT = ". Another robot? Give its ports, or fly this one with --robot-id"
OTHER_FIRMWARE = (
    ". Install that revision, or fly with --firmware if you know that it speaks the same"
)

Answer = int | tuple[int, ...]


@dataclass(slots=True)
class Request:
    """A set or question to repeat until it is answered as expected."""

    key: int  # the id a reply names, or MIRROR_KEY
    expected: Answer | None  # the answer that settles it, None for any
    build: Callable[[Sequence[int]], bytes]  # the frame, around the four command bytes
    name: str
    persistent: bool = True  # after all tries repeated slowly, else given up
    hold: str = ""  # why it must not be sent now; counts as a try
    advice: str = CHECK  # what to try when the answer is not the expected one
    tries: int = 0
    due_s: float = -math.inf
    answer: str = "nothing"
    given_up: bool = False

    @property
    def outcome(self) -> str:
        """Return the last answer, and what to try, as the end of a sentence."""
        advice = CHECK if self.answer.startswith("nothing") else self.advice
        return f"it answered {self.answer}{advice}"


@dataclass(slots=True)
class Exchange:
    """The open requests of one microcontroller.

    Attributes:
        failures: lines about requests not answered in time; the caller clears them.
    """

    open: list[Request] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    def put(self, request: Request) -> None:
        """Open a request; it replaces one with the same key."""
        self.open[:] = [other for other in self.open if other.key != request.key]
        self.open.append(request)

    def service(self, now_s: float, command: Sequence[int]) -> list[bytes]:
        """Return the frames that are due, each with these command bytes.

        `now_s` is any clock that does not go back.
        """
        if not self.open:
            return []
        frames = []
        in_vain: list[Request] = []
        for request in self.open:
            if now_s >= request.due_s and not request.given_up:
                if request.tries == TRIES:
                    request.given_up = not request.persistent
                    request.tries += 1
                    in_vain.append(request)
                    continue
                frame = self._next(request, now_s, command)
                if frame is not None:
                    frames.append(frame)
        if in_vain:
            self._report(in_vain)
        return frames

    def settle(self, key: int, value: Answer) -> Request | None:
        """Accept the answer to `key`; return the request that it settles, None if there is none."""
        for request in self.open:
            if request.key == key:
                request.answer = f"{value}"
                if request.expected is None or request.expected == value:
                    self.open.remove(request)
                    return request
        return None

    def _report(self, in_vain: Sequence[Request]) -> None:
        """Report a line for each request tried in vain; a single one for all without an answer."""
        unanswered = [request for request in in_vain if request.answer == "nothing"]
        answered = [[request] for request in in_vain if request.answer != "nothing"]
        for group in ([unanswered] if unanswered else []) + answered:
            names = ", ".join(request.name for request in group)
            self.failures.append(
                f"microcontroller: could not {names} in {TRIES} tries, "
                f"{TRIES * REPEAT_S:.1f} s; {group[0].outcome}"
            )

    def _next(self, request: Request, now_s: float, command: Sequence[int]) -> bytes | None:
        """Return the frame to send now; None when it is held back."""
        request.tries += request.tries < TRIES
        request.due_s = now_s + (REPEAT_S if request.tries <= TRIES else SLOW_REPEAT_S)
        if request.hold:
            request.answer = f"nothing: {request.hold}"
            return None
        return request.build(command)


def decode_reply(frame: Frame) -> tuple[int, Answer] | None:
    """Decode (key, answer) of an `S` or `L` frame; None for any other."""
    if frame.command == VALUE:
        return decode_value(frame)
    ids = decode_mirrored(frame)
    return None if ids is None else (MIRROR_KEY, ids)


def set_value(id: Id, value: int, *, persistent: bool = True) -> Request:
    """Return a request that sets an id until this value is echoed."""
    name = f"set {id.name.lower()} to {value}"
    return Request(id, value, lambda command: encode_set(command, id, value), name, persistent)


def ask(id: Id) -> Request:
    """Return a request for the value of an id, whatever it is."""
    name = f"read {id.name.lower()}"
    return Request(id, None, lambda command: encode_request(command, id), name)


def confirm(id: Id, expected: int) -> Request:
    """Return a request for the value of an id until it is the expected one."""
    name = f"confirm that {id.name.lower()} is {expected}"
    request = Request(id, expected, lambda command: encode_request(command, id), name)
    if id in _ADVICE:
        request.advice = _ADVICE[id]
    return request


_ADVICE = {Id.ROBOT_ID: OTHER_ROBOT, Id.FIRMWARE_REVISION: OTHER_FIRMWARE}


def mirror(ids: Iterable[int]) -> Request:
    """Return a request that chooses what every `D` frame carries, until it is confirmed."""
    wanted = tuple(int(id) for id in ids)
    return Request(
        MIRROR_KEY, wanted, lambda command: encode_mirror(command, wanted), "mirror the IMU"
    )
