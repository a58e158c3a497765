"""The calibrations that are stored on the vehicle, as last read by the station.

They are read when the vehicle connects, restarts, or has accepted a calibration; each run's file
carries those in force. Serves `/<vehicle>/station/calibrate` with the actions `history` and
`in_force`.
"""

from __future__ import annotations

import json
import math
import threading
import time

from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.errors import LinkError, MeasurementError, RefusedError
from vehicle_link.messages import new
from vehicle_link.messages.records import CalibrateRequest, Message
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.node import Node

SERVICE = SERVICES["calibrate"]
TIMEOUT = 2.0
"""Timeout in s; a long history is some tens of kB."""
AGAIN = 5.0
"""Seconds between two requests to a vehicle that does not answer."""
START_PATIENCE = 10.0
"""Seconds to wait for the gyroscope calibration of the vehicle's start: it is written to the
vehicle's disk first."""
GYROSCOPE = "gyroscope"
ACTIONS = HISTORY, IN_FORCE = ("history", "in_force")
NOT_READ = "not received from the vehicle yet"
LOST = "the link to the vehicle is lost"


class Calibrations:
    """The station's copy of the vehicle's calibrations; thread-safe."""

    def __init__(self, node: Node) -> None:
        self._client = node.client("calibrate", SERVICE, priority="background")
        self._lock = threading.Lock()
        self._records: dict[str, tuple[CalibrationRecord, ...]] | None = None
        self._problem = NOT_READ
        self._due = 0.0  # s of the monotonic clock; inf: already read
        self._instance: int | None = None  # of the vehicle that was asked last
        self._is_starting = False
        self._awaited_until = -math.inf
        node.serve("station/calibrate", SERVICE, self._answer)

    # ------------------------------------------------------------------ events of the station
    def look(self, instance: int) -> None:
        """Read the calibrations when due. Called once a second while the vehicle is connected; may
        wait for its answer.

        Args:
            instance: of the vehicle's process; a new number means that it has restarted.
        """
        with self._lock:
            if instance != self._instance:
                self._due = 0.0
            self._instance = instance
            is_due = time.monotonic() >= self._due
        if is_due:
            try:
                self.read()
            except LinkError as error:
                with self._lock:
                    self._problem, self._due = str(error), time.monotonic() + AGAIN

    def status(self, starting: bool) -> None:
        """Handle a status of the vehicle: once it has started, its gyroscope is calibrated."""
        was, self._is_starting = self._is_starting, starting
        if was and not starting:
            with self._lock:
                self._awaited_until = time.monotonic() + START_PATIENCE
            self.changed()

    @property
    def is_due(self) -> bool:
        """Return whether the vehicle's calibrations are to be read again."""
        with self._lock:
            return time.monotonic() >= self._due

    def lost(self) -> None:
        """Forget everything when the vehicle is lost: the next one may be another vehicle."""
        with self._lock:
            self._records, self._problem, self._due = None, LOST, 0.0

    def changed(self) -> None:
        """Mark the calibrations that were read as outdated."""
        with self._lock:
            self._due = 0.0

    # ------------------------------------------------------------------ reading
    def read(self) -> tuple[CalibrationRecord, ...]:
        """Return the vehicle's history, newest first. Raises LinkError, and then forgets what was
        known.
        """
        with self._lock:
            self._due = float("inf")  # a later change is not in the answer
        try:
            records = {action: self._asked(action) for action in ACTIONS}
        except LinkError:
            with self._lock:
                self._records, self._due = None, 0.0
            raise
        current = {record.name for record in records[IN_FORCE]}
        with self._lock:
            self._records, self._problem = records, ""
            if GYROSCOPE not in current and time.monotonic() < self._awaited_until:
                self._due = 0.0
        return records[HISTORY]

    def in_force(self) -> dict[str, CalibrationRecord] | None:
        """Return the vehicle's calibrations in force by name, or None when they are unknown. Never
        waits.
        """
        with self._lock:
            records = self._records
        return None if records is None else {record.name: record for record in records[IN_FORCE]}

    def attachment(self) -> bytes:
        """Return the content of a run's calibrations.json. Never waits."""
        known = self.in_force()
        with self._lock:
            problem = "" if known is not None else f"unknown: {self._problem}"
        force = None
        if known is not None:
            force = {name: one.model_dump(mode="json") for name, one in known.items()}
        return json.dumps({"in_force": force, "problem": problem}, indent=1).encode()

    # ------------------------------------------------------------------ inside
    def _asked(self, action: str) -> tuple[CalibrationRecord, ...]:
        try:
            response = self._client.ask("station", timeout=TIMEOUT, action=action)
            return tuple(parse_record(str(text)) for text in response.records)
        except RefusedError as error:
            raise LinkError(f"no calibrations received from the vehicle: {error}") from error
        except MeasurementError as error:
            raise LinkError(f"the vehicle's calibrations cannot be read: {error}") from error

    def _answer(self, request: CalibrateRequest) -> Message:
        """Answer with the calibrations as last read."""
        if request.action not in ACTIONS:
            raise RefusedError(
                f"the station serves only {' and '.join(ACTIONS)} here, not "
                f"{request.action!r:.40}; its experiments make and accept calibrations"
            )
        with self._lock:
            records, problem = self._records, self._problem
        if records is None:
            raise RefusedError(f"the vehicle's calibrations are not known: {problem}")
        current = [one.model_dump_json() for one in records[request.action]]
        return new(f"{SERVICE}_Response", accepted=True, records=current)
