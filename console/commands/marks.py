"""Event marks: the service `mark`, the topic `marks` in the log, and the catalogue's copy.

A mark is set at once, at the time of the key press; its text may follow in a second message with
the same id. Every operator may set marks: a mark commands nothing, so it needs no lease.
"""

from __future__ import annotations

import re
import threading
import time
from dataclasses import replace

from console.catalogue.catalogue import Catalogue
from console.catalogue.marks import LONGEST, OLDEST, find_mark, store_mark
from console.catalogue.tables import Mark
from console.context import StationContext
from console.link.outbox import INFO
from console.runs.run import RecorderStatus
from quadrotor.errors import RefusedError
from vehicle_link.clock import time_ns
from vehicle_link.messages import encode, header, new
from vehicle_link.messages.records import MarkRequest, Message
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.idempotent import Idempotent

ID = re.compile(r"[A-Za-z0-9_-]{8,64}")


class MarkService:
    """Serves `/<vehicle>/station/mark` in its own thread."""

    def __init__(self, context: StationContext, catalogue: Catalogue) -> None:
        self._vehicle, self._link = context.vehicle, context.link
        self._recorder, self._outbox = context.recorder, context.outbox
        self._catalogue = catalogue
        self._lock = threading.Lock()
        self._node = context.node

    def serve(self) -> None:
        """Answer requests from now on."""
        self._node.serve("station/mark", SERVICES["mark"], Idempotent(self._answer))

    def _answer(self, request: MarkRequest) -> Message:
        with self._lock:
            mark, logged = self._apply(request)
        kind = f"{SERVICES['mark']}_Response"
        return new(kind, accepted=True, run_id=mark.run_id, time=mark.time, logged=logged)

    def _apply(self, request: MarkRequest) -> tuple[Mark, bool]:
        text = " ".join(request.text.split())
        if not ID.fullmatch(request.id):
            raise RefusedError(
                f"mark: {request.id!r:.80} is not an id; allowed are 8 to 64 characters of "
                "A-Za-z0-9_-"
            )
        if len(text) > LONGEST:
            raise RefusedError(f"mark: the text has {len(text)} characters; allowed are {LONGEST}")
        known = find_mark(self._catalogue, request.id)
        recorder = self._recorder.status()
        if known is None:
            mark = self._new(request, text, recorder)
        elif text == known.text:
            return known, True
        else:
            mark = replace(known, text=text)
        is_logged = recorder.recording and recorder.run_id == mark.run_id
        message = new(
            "quadlab_msgs/Mark",
            header=header(mark.stamp_ns),
            id=mark.id,
            run_id=mark.run_id,
            time=mark.time,
            text=mark.text,
            requester=request.requester,
        )
        payload, now_ns = encode(message), time_ns()
        if is_logged:  # after the end of a run only pages receive it
            kind = TOPICS["marks"].type_name
            self._recorder.put(f"/{self._vehicle}/marks", kind, payload, now_ns, mark.stamp_ns)
        self._outbox.put("marks", payload, mark.stamp_ns)
        store_mark(self._catalogue, mark)
        quoted = f": {text}" if text else ""
        self._outbox.say(
            INFO, f"mark at {mark.time:.1f} s of the run by {request.requester}{quoted}"
        )
        return mark, is_logged

    def _new(self, request: MarkRequest, text: str, recorder: RecorderStatus) -> Mark:
        if not request.pressed_ns:
            raise RefusedError(f"no mark has the id {request.id}; mark first, then give the text")
        if not recorder.recording:
            raise RefusedError(
                "nothing is being recorded, so there is no log to mark; press Record first"
            )
        ago = (time.time_ns() - int(request.pressed_ns)) * 1e-9
        if not -0.5 <= ago <= OLDEST:
            raise RefusedError(
                f"mark: pressed {ago:.1f} s ago by this clock; allowed are {OLDEST:g} s at most"
            )
        ago = min(max(ago, 0.0), recorder.duration)
        return Mark(
            run_id=recorder.run_id,
            id=request.id,
            stamp_ns=self._link.vehicle_ns() - round(ago * 1e9),
            time=recorder.duration - ago,
            text=text,
            requester=request.requester,
        )
