"""The decision about a proposed calibration: the vehicle applies it, or it is rejected."""

from __future__ import annotations

import threading
from pathlib import Path

from console.calibrations import Calibrations
from console.catalogue.catalogue import Catalogue
from console.experiment_running.state import ACCEPTED, REJECTED
from console.experiment_running.status_publisher import ExperimentStatusPublisher
from console.link.outbox import INFO, WARN
from console.runs.report_folders import write_decision
from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.errors import LinkError, QuadlabError, RefusedError
from vehicle_link.messages.records import Answer
from vehicle_link.transport.client import ServiceClient

STORE_TIMEOUT = 2.0
"""s for the vehicle to check, apply and write a record, per try."""
NAME_MAX = 64


class Decisions:
    """Accepts or rejects the newest proposal, once; thread-safe."""

    def __init__(
        self,
        board: ExperimentStatusPublisher,
        calibrate: ServiceClient[Answer],
        calibrations: Calibrations,
        catalogue: Catalogue,
    ) -> None:
        self._board, self._calibrate = board, calibrate
        self._calibrations, self._catalogue = calibrations, catalogue
        self._deciding = threading.Lock()
        self._unanswered = ""  # the proposal that was sent without an answer

    def accept(self, requester: str) -> None:
        """Send the record to the vehicle, which checks and stores it. Raises RefusedError; the
        proposal then stays open.
        """
        with self._deciding:
            text, record = self._open()
            sent = record.model_copy(
                update={"run_id": self._board.state.run_id, "requester": requester[:NAME_MAX]}
            )
            if self._unanswered != text or not self._is_stored(sent):
                self._store(text, sent, requester)
            self._decide(ACCEPTED, record.name, requester)
        self._calibrations.changed()

    def reject(self, requester: str) -> None:
        """Reject the proposal; nothing changes on the vehicle. Raises RefusedError without a
        proposal.
        """
        with self._deciding:
            _, record = self._open()
            self._decide(REJECTED, record.name, requester)

    def _open(self) -> tuple[str, CalibrationRecord]:
        state = self._board.state
        if not state.proposal:
            raise RefusedError("no calibration is proposed, so there is nothing to decide")
        if state.decision:
            raise RefusedError(f"the proposal was {state.decision} already; repeat the experiment")
        return state.proposal, parse_record(state.proposal)

    def _store(self, text: str, record: CalibrationRecord, requester: str) -> None:
        try:
            self._calibrate.ask(
                requester,
                timeout=STORE_TIMEOUT,
                tries=2,
                action="store",
                record=record.model_dump_json(),
            )
        except LinkError as error:
            self._unanswered = text
            raise RefusedError(
                f"it is not known whether the vehicle applied it ({error}); accept it again"
            ) from error

    def _is_stored(self, record: CalibrationRecord) -> bool:
        """Return whether the vehicle applied the record although its answer was lost. Raises
        RefusedError.
        """
        try:
            history = self._calibrations.read()
        except LinkError as error:
            raise RefusedError(str(error)) from error
        return any(
            (stored.name, stored.run_id) == (record.name, record.run_id) for stored in history
        )

    def _decide(self, decision: str, name: str, requester: str) -> None:
        self._unanswered = ""
        self._board.set(decision=decision)
        run_id = self._board.state.run_id
        self._board.say(INFO, f"calibration {name} of run {run_id} {decision} by {requester}")
        try:
            path: Path = self._catalogue.resolve(run_id)
            write_decision(path, decision, requester)
        except QuadlabError as error:  # the vehicle's history has it, too
            self._board.say(WARN, f"the report lacks that it was {decision}: {error}")
