"""Runs: recorder, catalogue and recording rules combined."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime

from console.catalogue.catalogue import Catalogue, run_name
from console.catalogue.completeness import Completeness, store_completeness
from console.catalogue.tables import RunEntry
from console.catalogue.titles import store_title
from console.parameters.store import StationStore
from console.parameters.vehicle import VehicleParameters
from console.runs.recorder import PERIOD, Recorder
from console.runs.recording_rules import Decision, RecordingPolicy
from console.runs.run import Run, RunEnd
from console.runs.title import RunTitle
from flight_log.provenance import provenance
from flight_log.run_folder import STATION
from quadrotor.errors import StorageError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.clock import host_time_ns, monotonic

REQUEST_VALID_FOR = 5.0
"""Seconds for which a request to arm names the operator of the run that begins."""


class RunManager:
    """Starts, stops and catalogues runs; thread-safe.

    Args:
        operator: written into runs that were started without a requester.
        calibrations: returns the file of those in force, for each run's log; never waits.
        period: s between two writes of the recorder.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        store: StationStore,
        vehicle_parameters: VehicleParameters,
        vehicle: str,
        operator: str,
        calibrations: Callable[[], bytes],
        period: float = PERIOD,
    ) -> None:
        self._catalogue = catalogue
        self._calibrations = calibrations
        self._store = store
        self._vehicle_parameters = vehicle_parameters
        self._vehicle = vehicle
        self._operator = operator
        self._asked = (operator, float("-inf"))
        self._latest = operator  # of the newest run
        self._policy = RecordingPolicy()
        self._title = RunTitle()
        self._held_run = ""  # run that an experiment continues, motors on or off
        self._lock = threading.Lock()
        # Given by this process; their files are created a little later.
        self._names: set[str] = set()
        self._provenance = provenance()
        self._on_closed: Callable[[str], None] = lambda run_id: None
        self.recorder = Recorder(
            catalogue.folder,
            self._started,
            self._ended,
            on_restart=self._restart,
            on_watch=lambda: catalogue.problem,
            period=period,
        )

    def subscribe(self, on_closed: Callable[[str], None]) -> None:
        """Call `on_closed` with the id of each run that ends, in the recorder's thread."""
        self._on_closed = on_closed

    def note_command(self, command: str, requester: str) -> None:
        """Note the requester of this command; the person who arms is the run's operator."""
        if command == "arm":
            self._asked = (requester, monotonic())

    def note_start(self, behavior: str, arguments: Mapping[str, ParameterValue]) -> None:
        """Note a behavior that the vehicle accepted, for the title of the present run."""
        if self.recorder.run_id:
            self._title.started(behavior, arguments)

    def note_change(self, name: str, old: ParameterValue, new: ParameterValue) -> None:
        """Note the change of a parameter, for the title of the present run."""
        if self.recorder.run_id:
            self._title.changed(name, old, new)

    def status(self, armed: bool, starting: bool) -> None:
        """Handle a status of the vehicle. When a run cannot start, the recorder raises an alarm."""
        with self._lock:
            decision = self._policy.status(armed, starting, monotonic())
        if decision is Decision.START and not self.recorder.run_id:
            requester, at = self._asked
            named = requester and monotonic() - at < REQUEST_VALID_FOR
            with suppress(StorageError):  # reported as an alarm until a run starts
                self.start(requester if named else self._operator)

    def tick(self) -> None:
        """Apply the recording rules, some times a second."""
        after = self._store.parameters.recorder.after_disarm
        with self._lock:
            decision = self._policy.tick(monotonic(), after)
            is_held = self._held_run and self._held_run == self.recorder.run_id
        if decision is Decision.STOP and not is_held:
            self.recorder.stop()

    def hold(self, requester: str) -> str:
        """Begin a run that continues until `release`, for an experiment that may turn no motor;
        return its id.

        A run that is already being recorded is used instead, even if begun by hand: it is judged
        when its file is closed. Raises StorageError.
        """
        run_id = self.recorder.run_id or self.start(requester or self._operator)
        with self._lock:
            self._held_run = run_id
        return run_id

    def release(self) -> None:
        """Release the run of an experiment that has ended: it ends at once, or after the motors
        have stopped like any other run.
        """
        with self._lock:
            held, self._held_run = self._held_run, ""
            if held and self.recorder.run_id == held and not self._policy.continues:
                self.recorder.stop()

    def by_hand(self, start: bool, requester: str) -> str:
        """Start or stop a run; return its id. Raises StorageError with the reason."""
        if start:
            return self.start(requester or self._operator)
        run_id = self.recorder.run_id
        if not run_id:
            raise StorageError("nothing is being recorded")
        self.recorder.stop()
        return run_id

    def start(self, operator: str, *, again: bool = False) -> str:
        """Begin a run; return its id. `again` is as for the recorder. Raises StorageError."""
        self._latest = operator
        now = datetime.now(UTC)
        run_id = run_name(now, self._vehicle, self._catalogue.folder, self._names)
        run = Run(
            run_id=run_id,
            path=self._catalogue.folder / run_id / STATION,
            metadata={
                "run_id": run_id,
                "vehicle": self._vehicle,
                "operator": operator,
                "started": now.isoformat(),
                "recorder": "station",
                "seed": str(self._store.parameters.tracker.seed),
                **self._provenance,
            },
            start_ns=host_time_ns(),
            attachments=self._attachments,
            keep_free=round(self._store.parameters.recorder.keep_free * 1e6),
        )
        self.recorder.start(run, again=again)
        self._title = run.title
        self._names.add(run_id)
        return run_id

    def close(self) -> None:
        """End the run and complete its file."""
        self.recorder.close()

    def _restart(self) -> None:
        """Record the rest of a flight as soon as possible after the disk ended its run."""
        with self._lock:
            armed = self._policy.armed
        if armed and not self.recorder.run_id:
            with suppress(StorageError):  # called again later
                self.start(self._latest, again=True)

    def _attachments(self) -> dict[str, bytes]:
        values, revision, problem = self._vehicle_parameters.snapshot()
        content: dict[str, object] = {"vehicle": values, "vehicle_revision": revision}
        content["station"] = self._store.values()
        if problem:
            content["problem"] = problem
        attached = {
            "parameters.json": json.dumps(content, indent=1).encode(),
            "calibrations.json": self._calibrations(),
        }
        if defaults := self._vehicle_parameters.defaults():
            own = {one.name: one.default for one in self._store.descriptions()}
            attached["defaults.json"] = json.dumps({**defaults, **own}, indent=1).encode()
        return attached

    def _started(self, run: Run) -> None:
        self._catalogue.add(self._entry(run))
        store_completeness(self._catalogue, run.run_id, Completeness("open"))

    def _ended(self, end: RunEnd) -> None:
        problem = end.problem
        if end.dropped:
            problem = f"{end.dropped} messages were dropped. {problem}".strip()
        entry = replace(
            self._entry(end.run),
            duration=end.duration,
            bytes=end.bytes,
            messages=end.messages,
            complete=end.closed,
            problem=problem,
        )
        self._catalogue.add(entry)
        store_title(self._catalogue, end.run.run_id, end.run.title.text())
        self._on_closed(end.run.run_id)

    def _entry(self, run: Run) -> RunEntry:
        return RunEntry(
            id=run.run_id,
            vehicle=self._vehicle,
            start_ns=run.start_ns,
            duration=0.0,
            file=run.path.parent.name,
            operator=run.metadata["operator"],
        )
