"""The station's side of the comparison of estimators, which runs in a separate process.

There its compiler, the loading of its code and its arithmetic never hold the interpreter that sends
heartbeats, forwards sticks and serves the link; and a crash there ends nothing else.
"""

from __future__ import annotations

import base64
import io
import os
import pickle
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import IO, Any

from bearing_sim.emulator import BearingMeasurement
from bearing_sim.pose_measurement import PoseMeasurement
from console.part import Part, PartContext
from extensions.comparison.parameters import ComparisonParameters
from quadrotor.errors import JobError, LinkError, QuadlabError
from quadrotor.records import Array
from vehicle_link.jobs import Job

PERIOD = 0.1
"""Seconds between two batches, each of which gives a result."""
HELD = 4000
"""Maximum number of messages queued for the process: about 10 s of them."""
RESTART_PERIOD = 5.0
"""Seconds between two starts of the process."""
CHECK_PERIOD, LINGER = 1.0, 30.0
"""Seconds between checks whether the results are needed, and for which the process continues when
they no longer are."""
PATIENCE = 2.0
TOPIC = "comparison"


class ComparisonFeed(Part):
    """Feeds the comparison process. Everything but `close` may be called from any thread, and costs
    one append.

    The process starts with the first telemetry, and runs only while its results are needed.

    Args:
        parameters: the live object, read again in each period.
        publish: called with topic, payload and stamp (ns).
        say: called with a line for the operator.
        needs_results: returns whether the results are needed.
    """

    def __init__(
        self,
        parameters: ComparisonParameters,
        publish: Callable[[str, bytes, int], None],
        say: Callable[[str], None],
        needs_results: Callable[[], bool] = lambda: True,
    ) -> None:
        self._parameters, self._publish, self._say = parameters, publish, say
        self._needs_results = needs_results
        self._check_due = self._needed_until = -LINGER
        self._queue: deque[tuple[object, ...]] = deque(maxlen=HELD)
        self._has_telemetry = False
        self._child: Job[None] | None = None
        self._orders: IO[bytes] = io.BytesIO()
        self._started = -RESTART_PERIOD
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="comparison", daemon=True)
        self._thread.start()

    def telemetry(self, payload: bytes) -> None:
        """Queue one packet."""
        self._queue.append(("telemetry", payload))
        self._has_telemetry = True

    def status(self, armed: bool, starting: bool) -> None:
        self._queue.append(("status", armed, starting))

    def truth(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        self._queue.append(("truth", stamp_ns, position_w, quaternion_wb))

    def pose(self, pose: PoseMeasurement) -> None:
        """Queue a pose of the tracker."""
        self._queue.append(("tracker", *pose))

    def bearings(self, frame: BearingMeasurement) -> None:
        self._queue.append(("bearings", frame))

    def close(self) -> None:
        self._closing.set()
        if (child := self._child) is not None:
            child.terminate()  # ends a blocked write, too
        self._thread.join(PATIENCE)

    def _run(self) -> None:
        due = time.monotonic()
        while not self._closing.is_set():
            due = max(due + (PERIOD if self._child else CHECK_PERIOD), time.monotonic())
            while (left := due - time.monotonic()) > 0.0 and not self._closing.is_set():
                if self._child is None:
                    self._closing.wait(left)
                elif self._child.poll(left) and not self._closing.is_set():
                    self._ended(self._child)
            if not self._is_needed():
                self._rest()
            elif self._has_telemetry and self._alive():
                self._send()
        self._rest()

    def _is_needed(self) -> bool:
        now = time.monotonic()
        if now >= self._check_due:
            self._check_due = now + CHECK_PERIOD
            if self._needs_results():
                self._needed_until = now + LINGER
        return now < self._needed_until

    def _rest(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            self._close_orders()
            child.stop(PATIENCE)
        self._queue.clear()

    def _alive(self) -> bool:
        """Return whether the process runs; start it if necessary, again if it has ended."""
        if self._child is not None:
            return True
        if self._closing.is_set() or time.monotonic() < self._started + RESTART_PERIOD:
            return False
        self._started = time.monotonic()
        theirs, ours = os.pipe()
        self._orders = os.fdopen(ours, "wb")
        try:
            self._child = Job(compare, theirs, niceness=0, report=self._take, keep=(theirs,))
        except JobError as error:
            self._close_orders()
            self._say(f"the comparison of estimators {error}")
        finally:
            os.close(theirs)
        return self._child is not None

    def _ended(self, child: Job[None]) -> None:
        self._child = None
        self._close_orders()
        try:
            child.result()
        except QuadlabError as error:
            if not self._closing.is_set():
                self._say(f"the comparison of estimators ended: {error}; it is started again")

    def _close_orders(self) -> None:
        with suppress(OSError):  # of what was not sent any more
            self._orders.close()

    def _send(self) -> None:
        """Send the queue, even when it is empty: it is the process's clock."""
        items = [self._queue.popleft() for _ in range(len(self._queue))]
        with suppress(OSError):  # noticed by its end
            pickle.dump((self._parameters.estimators, items), self._orders)
            self._orders.flush()

    def _take(self, reported: Any) -> None:
        what, text, stamp_ns = reported
        with suppress(LinkError):  # the session was closed first
            if what == TOPIC:
                self._publish(TOPIC, base64.b64decode(text), stamp_ns)
            elif what == "say":
                self._say(text)
            else:
                print(text, file=sys.stderr, flush=True)


def make(context: PartContext) -> ComparisonFeed:
    """Return the comparison of one vehicle's station."""
    needed = partial(context.is_wanted, TOPIC)
    assert isinstance(context.parameters, ComparisonParameters)
    return ComparisonFeed(context.parameters, context.publish, context.say, needed)


def compare(orders: int, report: Callable[[object], None]) -> None:
    """Compare estimators until the orders end; this is the process.

    Orders are pickled batches of the station's messages; reports are results, ten a second, lines
    for the operator, and lines for the log.
    """
    from extensions.comparison.process import ComparisonWorker  # loads code that the station lacks

    # The station may run before others (negative niceness); what is only looked at may not.
    os.setpriority(os.PRIO_PROCESS, 0, max(0, os.getpriority(os.PRIO_PROCESS, 0)))
    lock = threading.Lock()

    def tell(what: str, text: str, stamp_ns: int = 0) -> None:
        with lock:  # a thread that compiles reports, too
            report((what, text, stamp_ns))

    worker = ComparisonWorker(
        lambda payload, stamp_ns: tell(TOPIC, base64.b64encode(payload).decode(), stamp_ns),
        partial(tell, "say"),
        partial(tell, "log"),
    )
    with os.fdopen(orders, "rb") as source, suppress(EOFError):
        while True:
            worker.process(pickle.load(source))
    worker.close()
