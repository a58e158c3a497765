"""The service `calibrate`: apply, store and find calibrations.

Flight applies values and finds the drift, and never accesses the disk; this process owns the file.
A calibration that cannot be stored is not used either: the previous values are restored.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable

from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import LinkError, QuadlabError, RefusedError, StorageError
from quadrotor.parameter_description import ParameterValue
from vehicle import mailbox
from vehicle.calibration.gyroscope_record import drift_of, gyroscope_record
from vehicle.calibration.in_force import GYROSCOPE, described
from vehicle.calibration.store import AT_START, ON_REQUEST, CalibrationStore, encoded, parse_stored
from vehicle.comms.commands import FlightMailbox
from vehicle_link.messages import new
from vehicle_link.messages.records import CalibrateRequest, CalibrateResponse
from vehicle_link.topics.table import SERVICES

TYPE = SERVICES["calibrate"]
ANSWER_BYTES = 64_000
"""Largest size of the records in one answer: one fragment of the link."""
GYROSCOPE_PATIENCE_S = 5.0
"""Margin, in s, added to the time for the samples before a request times out."""
FOUND_KEPT = 8
KEEPER = "calibration keeper"

Say = Callable[[int, str], None]


class Calibrations:
    """Calibrations behind the service; `answer` runs on its threads, `found` on that of comms.

    Args:
        now_ns: the vehicle's clock.
        say: called with (level, text) of an event.
        gyroscope_s: returns the time, in s, that the samples for a drift take now.
        refused: stamps of records that were rejected at the start.
        since_ns: start of the vehicle; an older drift is no longer in use.
    """

    def __init__(
        self,
        flight: FlightMailbox,
        store: CalibrationStore,
        now_ns: Callable[[], int],
        say: Say,
        gyroscope_s: Callable[[], float],
        refused: list[int],
        since_ns: int,
    ) -> None:
        self._flight, self._store = flight, store
        self._now_ns, self._say, self._gyroscope_s = now_ns, say, gyroscope_s
        self._refused, self._since_ns = frozenset(refused), since_ns
        self._storing = threading.Lock()
        self._found: dict[str, mailbox.GyroscopeFound] = {}
        self._is_found = threading.Condition()

    def answer(self, request: CalibrateRequest) -> CalibrateResponse:
        """Answer a request. Raises QuadlabError when it is refused."""
        action = str(request.action)
        if action == "history":
            records = _as_many_as_fit(self._store.newest_first())
        elif action == "in_force":
            records = self._in_force()
        elif action == "store":
            records = [self._accept(str(request.record), str(request.requester))]
        elif action == "gyroscope":
            records = [self._gyroscope(str(request.requester))]
        else:
            raise RefusedError(
                f"unknown action {action!r}: use store, history, in_force or gyroscope"
            )
        texts = [encoded(record).decode().rstrip() for record in records]
        return new("quadlab_msgs/srv/Calibrate_Response", accepted=True, records=texts)

    def found(self, found: mailbox.GyroscopeFound) -> None:
        """Handle flight's result of a gyroscope calibration."""
        if found.request_id:
            with self._is_found:
                self._found[found.request_id] = found
                while len(self._found) > FOUND_KEPT:  # the oldest were abandoned
                    del self._found[next(iter(self._found))]
                self._is_found.notify_all()
        elif not found.reason:
            # In another thread: a disk access may take a second, and telemetry must not wait for
            # it.
            threading.Thread(target=self._keep_at_start, args=(found,), name=KEEPER).start()

    def in_force_json(self) -> bytes:
        """Return the calibrations in use as JSON for the onboard log, by name as in the runs."""
        in_force = {record.name: record.model_dump(mode="json") for record in self._in_force()}
        return json.dumps({"in_force": in_force, "problem": ""}, indent=1).encode()

    # ------------------------------------------------------------------ actions
    def _in_force(self) -> list[CalibrationRecord]:
        """Return the calibrations in use, oldest first."""
        return [
            record
            for record in self._store.newest()
            if record.stamp_ns not in self._refused
            and (record.name != GYROSCOPE or record.stamp_ns >= self._since_ns)
        ]

    def _accept(self, text: str, requester: str) -> CalibrationRecord:
        proposed = parse_stored(text.encode())
        if proposed.name == GYROSCOPE:
            self._check_drift(proposed)
        with self._storing:
            reply = self._flight.ask(
                lambda i: mailbox.Calibrate(i, requester, dict(proposed.values))
            )
            if not reply.accepted:
                raise RefusedError(reply.reason)
            try:
                record = self._stored(proposed, requester, reply)
            except QuadlabError as error:
                raise self._restore(reply, error) from None
        self._report(record)
        return record

    def _check_drift(self, proposed: CalibrationRecord) -> None:
        """Raise RefusedError unless the drift is the one in use: a drift is found, not set."""
        used = {one.name: one for one in self._in_force()}.get(GYROSCOPE)
        if used is None or drift_of(used) != drift_of(proposed):
            raise RefusedError(
                "calibration not accepted: the vehicle does not use this drift of the "
                "gyroscope; find it again (action gyroscope), then accept that"
            )

    def _stored(
        self, proposed: CalibrationRecord, requester: str, reply: mailbox.Reply
    ) -> CalibrationRecord:
        written = {
            "values": reply.applied,
            "previous": reply.previous,
            "requester": requester or proposed.requester,
            "stamp_ns": self._now_ns(),
        }
        # Parsed as it will be read: values that JSON cannot carry (not a number) must not reach the
        # file.
        record = parse_stored(encoded(proposed.model_copy(update=written)).rstrip())
        self._store.append(record)
        return record

    def _restore(self, reply: mailbox.Reply, error: QuadlabError) -> QuadlabError:
        """Restore the previous calibration and return the error to answer with."""
        if not reply.previous:
            return error
        try:
            back = self._flight.ask(lambda i: mailbox.Calibrate(i, "vehicle", reply.previous))
            why = back.reason
        except LinkError as silent:
            why = str(silent)
        if not why:
            return StorageError(f"{error}; the values before are in force again")
        self._say(mailbox.ERROR, f"values of a calibration that is not stored are in force: {why}")
        return StorageError(f"{error}; its values stay in force until the next start: {why}")

    def _gyroscope(self, requester: str) -> CalibrationRecord:
        reply = self._flight.ask(lambda i: mailbox.CalibrateGyroscope(i, requester))
        if not reply.accepted:
            raise RefusedError(reply.reason)
        asked, patience = reply.request_id, self._gyroscope_s() + GYROSCOPE_PATIENCE_S
        with self._is_found:
            if not self._is_found.wait_for(lambda: asked in self._found, patience):
                raise LinkError(
                    f"the flight process found no drift within {patience:.0f} s; does the "
                    "microcontroller send samples?"
                )
            found = self._found.pop(asked)
        if found.reason:
            raise RefusedError(found.reason)
        record = gyroscope_record(found)
        try:
            self._store.replace(ON_REQUEST, record)
        except StorageError as error:  # harmless: the drift is found again at the next start
            self._say(mailbox.WARN, str(error))
        return record

    def _keep_at_start(self, found: mailbox.GyroscopeFound) -> None:
        try:
            self._store.replace(AT_START, gyroscope_record(found))
        except StorageError as error:
            self._say(mailbox.WARN, str(error))

    def _report(self, record: CalibrationRecord) -> None:
        values = ", ".join(f"{name} = {_short(value)}" for name, value in record.values.items())
        run = f" from {record.run_id}" if record.run_id else ""
        text = f"calibration stored: {described(record)}{run}{': ' if values else ''}{values}"
        self._say(mailbox.INFO, text)


def _short(value: ParameterValue) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _as_many_as_fit(records: list[CalibrationRecord]) -> list[CalibrationRecord]:
    size = 0
    for count, record in enumerate(records):
        size += len(encoded(record))
        if size > ANSWER_BYTES:
            return records[:count]
    return records
