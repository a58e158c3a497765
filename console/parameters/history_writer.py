"""Writes the history of parameters from the messages that the station receives.

Whatever changes a parameter (page, ROS 2, experiment, the vehicle itself), its authority publishes
the change on `parameter_changes`. A change that was missed, because the link or this process was
down, appears as a difference between a snapshot and the replica, and is written as such.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from functools import partial

from console.disk_worker import DiskWorker
from console.parameters.history import ParameterHistory, RecordedChange
from quadrotor.errors import StorageError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.clock import host_time_ns
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.replica import Snapshot

log = logging.getLogger(__name__)

AT_START = "(start of vehicle or station)"
AT_RESTART = "(the vehicle restarted)"
NOT_RECEIVED = "(not received: the link was down)"
"""Requester of a change whose message did not arrive."""
UNRECORDED = "not recorded"
CLOSE_PATIENCE = 3.0
RETRY = 1.0


class ParameterHistoryWriter:
    """Collects changes from any thread and writes them in a worker's, as the disk may be slow.

    Args:
        alarm: called with the reason when nothing can be written, and with None when it can again.
    """

    def __init__(
        self, history: ParameterHistory, alarm: Callable[[str | None], None], worker: DiskWorker
    ) -> None:
        self._history = history
        self._alarm = alarm
        self._lock = threading.Lock()
        self._flight = ""
        self._is_armed: bool | None = None
        self._newest: dict[str, tuple[int, int, ParameterValue]] = {}  # instance, revision, value
        last = history.flight()
        self._is_open = last is not None and not last.is_over
        self._closing = threading.Event()
        self._worker = worker

    def changed(self, change: ParameterChange, received_ns: int) -> None:
        """Write a change that an authority published, and any earlier change whose message was
        lost.
        """
        name, revision, sent_ns = change.name, change.revision, change.stamp_ns
        with self._lock:
            instance, newest, known = self._newest.get(name, (0, 0, change.old))
            if instance == change.instance and newest < revision - 1 and known != change.old:
                at = received_ns, sent_ns, revision - 1
                self._write_later(name, known, change.old, NOT_RECEIVED, at)
            if change.old != change.new:
                at = received_ns, sent_ns, revision
                self._write_later(name, change.old, change.new, change.requester, at)
            if instance != change.instance or revision > newest:
                self._newest[name] = change.instance, revision, change.new

    def status(self, armed: bool, run: str) -> None:
        """Handle a status of the vehicle; a flight lasts from arming to disarming."""
        with self._lock:
            was, self._is_armed = self._is_armed, armed
            if armed:
                self._flight = run or self._flight or UNRECORDED
            if armed == was:
                return
            if not armed:
                self._flight = ""
                self._put(partial(self._history.end_flight, host_time_ns()))
            elif not (was is None and self._is_open):  # the station ended in flight and restarted
                self._put(partial(self._history.begin_flight, self._flight, host_time_ns()))

    def compare(self, snapshot: Snapshot) -> None:
        """Write the changes that a snapshot of the vehicle shows and no message reported."""
        before = snapshot.instance_before
        if before is None:
            why = AT_START
        else:
            why = NOT_RECEIVED if before == snapshot.instance else AT_RESTART
        self._adopt(snapshot.before, snapshot.values, snapshot.revision, why, snapshot.instance)

    def begin(self, values: Mapping[str, ParameterValue]) -> None:
        """Store the station's own values at its start, and write their changes."""
        self._adopt(self._history.known(), values, 0, AT_START)

    def close(self) -> None:
        """Write what is queued, or give it up, and end the worker."""
        self._closing.set()
        self._worker.close(CLOSE_PATIENCE)

    def _adopt(
        self,
        before: Mapping[str, ParameterValue],
        values: Mapping[str, ParameterValue],
        revision: int,
        why: str,
        instance: int = 0,
    ) -> None:
        now_ns = host_time_ns()
        with self._lock:
            if unknown := {name: value for name, value in values.items() if name not in before}:
                self._put(partial(self._history.learn, unknown))
            for name, value in values.items():
                if (old := before.get(name, value)) != value:
                    self._write_later(name, old, value, why, (now_ns, now_ns, revision))
                    self._newest[name] = instance, revision, value

    def _write_later(
        self,
        name: str,
        old: ParameterValue,
        new: ParameterValue,
        requester: str,
        at: tuple[int, int, int],
    ) -> None:
        """Store a change in the worker's thread.

        Args:
            at: when it was received and sent, ns, and the revision of the values with it.
        """
        stamp_ns, sent_ns, revision = at
        change = RecordedChange(
            name=name,
            old=old,
            new=new,
            requester=requester,
            stamp_ns=stamp_ns,
            flight=self._flight,
            revision=revision,
            sent_ns=sent_ns,
        )
        self._put(partial(self._history.add, [change]))

    def _put(self, write: Callable[[], None]) -> None:
        self._worker.put(partial(self._write, write))

    def _write(self, write: Callable[[], None]) -> None:
        """Write, retrying until it succeeds: a full disk or a busy database leaves no gap."""
        while True:
            try:
                write()
            except StorageError as error:
                self._alarm(str(error))
                if self._closing.wait(RETRY):
                    log.error("a change of a parameter was not written: %s", write)
                    return
            else:
                self._alarm(None)
                return
