"""A guided calibration at a terminal: follows it, asks its questions and decides on its result."""

from __future__ import annotations

import queue
import time
from dataclasses import dataclass
from typing import Any

from quadlab.calibration.lines import comparison_rows, notes, table
from quadlab.calibration.screen import Screen
from quadlab.option_types import Flag
from quadlab.station_client import StationClient
from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.errors import LinkError, MeasurementError, RefusedError, UsageError
from vehicle_link.messages import new
from vehicle_link.messages.records import ExperimentStatus
from vehicle_link.parameters.messages import to_parameters

ENDED = ("passed", "failed", "not_judged", "stopped", "refused")
RUNNING = ("flying", "finishing", "evaluating")
SILENT = 5.0
"""Seconds without a status after which the station counts as lost."""
INTERRUPTED = 130


@dataclass(frozen=True)
class CalibrationRequest:
    """The request of the command line."""

    name: str
    options: dict[str, Any]
    yes: Flag = False
    accept: Flag = False
    reject: Flag = False


class _DeclinedError(Exception):
    """The answer to a question was no."""


def in_force(client: StationClient) -> dict[str, CalibrationRecord]:
    """Return the calibrations in force by name. Raises RefusedError, LinkError or
    MeasurementError.
    """
    answer = client.ask("calibrate", action="in_force")
    return {one.name: one for one in map(parse_record, answer.records)}


class Dialogue:
    """One calibration, from its start to the decision, including repetitions."""

    def __init__(self, client: StationClient, screen: Screen, wanted: CalibrationRequest) -> None:
        self._client, self._screen, self._wanted = client, screen, wanted
        self._status = new("quadlab_msgs/ExperimentStatus")
        self._runs = False

    def run(self) -> int:
        try:
            while True:
                code = self._once()
                if code is not None:
                    return code
        except _DeclinedError:
            self._stop()
            print("not confirmed, so it was stopped; nothing was stored", flush=True)
            return 1
        except KeyboardInterrupt:
            self._screen.rest()
            if self._runs:
                self._stop()
                print("stopped; nothing was stored on the vehicle", flush=True)
            else:
                print("nothing was decided; the proposal stays open on the page", flush=True)
            return INTERRUPTED
        finally:
            self._screen.rest()

    def _once(self) -> int | None:
        """Run it once; return the exit status, or None to repeat it."""
        self._start()
        while (status := self._status).phase not in ENDED or not self._is_ours(status):
            if not self._is_ours(status):
                raise LinkError(
                    "the station has restarted or runs another experiment; this calibration is "
                    "over and nothing was stored on the vehicle"
                )
            self._screen.progress(status)
            if status.question:
                self._answer(str(status.question))
            else:
                self._next()
        self._runs = False
        self._screen.rest()
        name = self._wanted.name
        phase = status.phase.replace("_", " ")
        self._screen.say(f"{name}: {phase}{f': {status.reason}' if status.reason else ''}")
        if status.proposal:
            return self._decide(status)
        if self._screen.is_terminal and not (self._wanted.accept or self._wanted.reject):
            return None if self._chosen("repeat it?", "repeat, quit") == "repeat" else 1
        return 1

    # ------------------------------------------------------------------ during the calibration
    def _start(self) -> None:
        """Start the calibration, and wait for its first status."""
        while not self._client.statuses.empty():
            self._client.statuses.get()
        options = to_parameters(self._wanted.options)
        name = self._wanted.name
        self._client.ask("experiment", action="start", name=name, options=options)
        self._runs = True
        begun = time.monotonic()
        while (status := self._next()).phase not in RUNNING or not self._is_ours(status):
            if time.monotonic() - begun > SILENT:
                return  # it ended before its first status arrived

    def _is_ours(self, status: ExperimentStatus) -> bool:
        return (status.name, status.requester) == (self._wanted.name, self._client.requester)

    def _next(self) -> ExperimentStatus:
        """Return the next status. Raises LinkError when the station is lost."""
        try:
            self._status = self._client.statuses.get(timeout=SILENT)
        except queue.Empty:
            raise LinkError(
                f"the station has been silent for {SILENT:g} s; the page will show the outcome "
                "of the calibration once it is back"
            ) from None
        return self._status

    def _answer(self, question: str) -> None:
        """Ask for yes, or end the experiment."""
        if self._wanted.yes:
            self._screen.say(f"{question} yes")
        elif not self._screen.is_terminal:
            self._stop()
            raise UsageError(
                f"it asks: {question!r}; there is no terminal to answer on: give --yes to "
                "confirm it"
            )
        else:
            typed = self._screen.ask(f"{question} [y/N]", lambda: self._is_asked(question))
            if typed is None and not self._is_asked(question):
                return  # answered elsewhere, or ended
            if typed not in ("y", "yes"):
                raise _DeclinedError
        self._confirm(question)
        while self._is_asked(question):
            self._next()

    def _confirm(self, question: str) -> None:
        options = to_parameters({"question": question})
        try:
            self._client.ask("experiment", action="confirm", options=options)
        except RefusedError as error:
            self._screen.say(f"not confirmed: {error}")
            if self._is_asked(question) and self._wanted.yes:
                self._stop()
                raise

    def _is_asked(self, question: str) -> bool:
        while not self._client.statuses.empty():
            self._status = self._client.statuses.get()
        return bool(self._status.question == question)

    def _stop(self) -> None:
        """Stop, and wait until it has ended."""
        self._runs = False
        try:
            self._client.ask("experiment", action="stop")
            while self._next().phase in RUNNING:
                pass
        except (RefusedError, LinkError) as error:
            print(f"quadlab: {error}", flush=True)

    # ------------------------------------------------------------------ after the calibration
    def _decide(self, status: ExperimentStatus) -> int | None:
        record = parse_record(str(status.proposal))
        self._show(record)
        if self._wanted.reject:
            return self._reject()
        if self._wanted.accept:
            if status.phase == "passed" and record.good:
                return self._accept()
            self._screen.say("not accepted: it is beyond its limits")
            self._reject()
            return 1
        while True:
            chosen = self._chosen("accept it?", "accept, reject, repeat")
            if chosen == "repeat":
                self._reject()
                return None
            if chosen != "accept":
                return self._reject()
            if self._accept() == 0:
                return 0

    def _show(self, record: CalibrationRecord) -> None:
        before, present = None, {}
        try:
            before = in_force(self._client).get(record.name)
            present = self._client.parameters()
        except (RefusedError, LinkError, MeasurementError) as error:
            self._screen.say(f"what is in force is not known: {error}")
        rows = comparison_rows(record, before, present)
        for line in table([("", "now", "proposed", ""), *rows]):
            self._screen.say(line)
        for line in notes(record):
            self._screen.say(line)

    def _chosen(self, question: str, words: str) -> str:
        """Return one of the words, typed in full or abbreviated; the last one if the input ends."""
        known = words.split(", ")
        while True:
            typed = self._screen.ask(f"{question} [{words}]", lambda: True)
            if typed is None:
                return "reject" if "reject" in known else known[-1]
            fits = [word for word in known if typed and word.startswith(typed)]
            if len(fits) == 1:
                return fits[0]
            self._screen.say(f"type one of {words}")

    def _accept(self) -> int:
        try:
            self._client.ask("experiment", action="accept")
        except RefusedError as error:
            self._screen.say(f"not accepted: {error}")
            return 1
        self._screen.say("accepted: in force on the vehicle now, and after each start")
        return 0

    def _reject(self) -> int:
        try:
            self._client.ask("experiment", action="reject")
        except RefusedError as error:
            self._screen.say(f"not rejected: {error}")
            return 1
        self._screen.say("rejected: nothing was stored on the vehicle")
        return 1
