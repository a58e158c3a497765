"""The station's side of the comparison of estimators, which runs in a separate process.

There its compiler, the loading of its code and its arithmetic never hold the interpreter that sends
heartbeats, forwards sticks and serves the link; and a crash there ends nothing else.
"""

from __future__ import annotations

import pickle
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from bearing_sim import BearingMeasurement, PoseMeasurement
from console.comparison.parameters import ComparisonParameters
from quadrotor.checkout import ROOT, RUN_MODULE
from quadrotor.errors import LinkError
from quadrotor.records import Array

COMMAND = (*RUN_MODULE, f"{__package__}.process")
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
STARTING = "starting"
TOPIC = "comparison"


class ComparisonFeed:
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
        self._queue: deque[tuple[Any, ...]] = deque(maxlen=HELD)
        self._has_telemetry = False
        self._child: subprocess.Popen[bytes] | None = None
        self._started = -RESTART_PERIOD
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="comparison", daemon=True)
        self._thread.start()

    def telemetry(self, payload: bytes) -> None:
        """Queue one packet."""
        self._queue.append(("telemetry", payload))
        self._has_telemetry = True

    def status(self, armed: bool, mode: str) -> None:
        self._queue.append(("status", armed, mode == STARTING))

    def truth(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        self._queue.append(("truth", stamp_ns, position_w, quaternion_wb))

    def pose(self, pose: PoseMeasurement) -> None:
        """Queue a pose of the tracker."""
        self._queue.append(("tracker", *pose))

    def bearings(self, frame: BearingMeasurement) -> None:
        self._queue.append(("bearings", frame))

    def close(self) -> None:
        self._closing.set()
        child = self._child
        if child is not None:
            child.terminate()  # ends a blocked write, too
        self._thread.join(PATIENCE)

    def _run(self) -> None:
        due = time.monotonic()
        while not self._closing.is_set():
            due = max(due + (PERIOD if self._child else CHECK_PERIOD), time.monotonic())
            self._closing.wait(due - time.monotonic())
            if not self._is_needed():
                self._rest()
            elif self._has_telemetry and self._alive():
                self._send()
        if self._child is not None:
            self._end(self._child)

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
            self._end(child)
        self._queue.clear()

    def _alive(self) -> bool:
        """Return whether the process runs; start it if necessary, again if it has ended."""
        child = self._child
        if child is not None and child.poll() is None:
            return True
        if self._closing.is_set() or time.monotonic() < self._started + RESTART_PERIOD:
            return False
        if child is not None:
            self._say(f"the comparison of estimators ended ({child.returncode}); started again")
        self._started = time.monotonic()
        try:
            self._child = child = subprocess.Popen(
                COMMAND, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE
            )
        except OSError as error:
            self._say(f"the comparison of estimators cannot be started: {error}")
            return False
        threading.Thread(
            target=self._receive, args=(child,), name="comparison output", daemon=True
        ).start()
        return True

    def _send(self) -> None:
        """Send the queue, even when it is empty: it is the process's clock."""
        assert self._child is not None
        assert self._child.stdin is not None
        items = [self._queue.popleft() for _ in range(len(self._queue))]
        with suppress(OSError):  # noticed by `_alive`
            self._child.stdin.write(pickle.dumps((self._parameters.estimators, items)))
            self._child.stdin.flush()

    def _receive(self, child: subprocess.Popen[bytes]) -> None:
        assert child.stdout is not None
        with suppress(EOFError, OSError, ValueError, pickle.UnpicklingError):
            while True:
                what, *arguments = pickle.load(child.stdout)
                with suppress(LinkError):  # the session was closed first
                    if what == TOPIC:
                        self._publish(TOPIC, *arguments)
                    else:
                        self._say(*arguments)

    def _end(self, child: subprocess.Popen[bytes]) -> None:
        assert child.stdin is not None
        with suppress(OSError):
            child.stdin.close()
        child.terminate()
        try:
            child.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
