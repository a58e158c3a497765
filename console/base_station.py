"""The base station between one vehicle and everything on the base.

Zenoh's threads deliver messages, each topic in its own; one thread sends the heartbeat, one polls
the vehicle for slow data, and the recorder and the tracker have their own. Nothing here waits for
the disk or the radio except the thread whose job it is.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from bearing_sim import BearingMeasurement, PoseMeasurement
from console.beacon_layout import BeaconLayout, in_force, vehicle_teller
from console.calibrations import Calibrations
from console.catalogue.catalogue import Catalogue
from console.checks.alarms import AlarmBoard
from console.checks.checks import CheckDesk
from console.commands.gateway import CommandGateway
from console.commands.lease_service import ControlDesk
from console.commands.stick_control import StickDesk
from console.comparison.feed import ComparisonFeed
from console.experiment_running.run_files import settings_of
from console.experiment_running.runner import ExperimentRunner
from console.link.identification import Introduction
from console.link.monitor import LinkMonitor
from console.link.outbox import Outbox
from console.link.polling import SlowQuestions
from console.link.recent_telemetry import RecentTelemetry
from console.link.status_sender import StatusSender
from console.link.subscriptions import Subscriptions
from console.link.telemetry import TelemetryIn
from console.link.wakeup_rates import pace_of
from console.parameters.history import ParameterHistory
from console.parameters.history_writer import ParameterWitness
from console.parameters.store import StationStore
from console.parameters.vehicle import VehicleParameters
from console.reception import Reception
from console.runs.housekeeping import PERIOD, Housekeeping
from console.runs.marks import MarkService
from console.runs.pictures import PictureRecording
from console.runs.runs import RunKeeper
from console.tracker_feed import TrackerFeed
from console.transfers.service import Transfers
from console.tuning.log_window import LogWindow
from quadrotor.errors import LinkError, ParameterError, RefusedError
from quadrotor.parameters import ParameterValue
from quadrotor.records import has_attitude
from vehicle_link import time_sync
from vehicle_link.lockstep import STATION_PROCESS, ProcessProgress
from vehicle_link.parameters.service import serve_parameters
from vehicle_link.process_instance import new_instance
from vehicle_link.transport.node import Node

log = logging.getLogger(__name__)

STATUS_EVERY = 4  # beats
INFO, WARN = 20, 30
CLOSE_PATIENCE = 3.0


class BaseStation:
    """Base station of one vehicle: all parts of this process, wired to one Zenoh session.

    Args:
        session: from vehicle_link.transport.session.hub_session.
        vehicle: its name, which is the namespace of the topics.
        operator: written into runs that were started without a requester.
        settings: `station.*` parameters to start with.
        keeps_house: whether this station tidies the runs' folder, which several stations share.
        vehicles: number of vehicles of this process. With a single one, estimators are compared
            even when no page shows it, so that each run has the comparison, and lines for the
            terminal need no name.
        host: host of the vehicle, for datagrams next to the link; empty for none.
        instance: random number of this process (vehicle_link.process_instance).
        endpoints: where the station listens and what it dials, in words.
        follows_process: poses come from a tracker process, not from the simulated tracker.
    """

    def __init__(
        self,
        session: Any,
        catalogue: Catalogue,
        vehicle: str = "quad1",
        operator: str = "",
        settings: Mapping[str, ParameterValue] | None = None,
        *,
        keeps_house: bool = True,
        vehicles: int = 1,
        host: str = "",
        instance: int | None = None,
        endpoints: str = "",
        follows_process: bool = False,
    ) -> None:
        self._vehicle = vehicle
        self._pace, is_alone = pace_of(vehicles), vehicles == 1
        self._closing = threading.Event()
        self._node = Node(session, f"/{vehicle}", "station")
        self._progress = ProcessProgress(vehicle)
        self._progress.is_this_process(STATION_PROCESS)
        self.link = LinkMonitor(vehicle, new_instance() if instance is None else instance)
        clock = self._node.client("time_sync", time_sync.TIME_SYNC)
        self.answers = partial(time_sync.answers, clock)
        self._store = StationStore()
        self._store.preset(settings or {})
        history = ParameterHistory(catalogue.engine, vehicle)
        known = history.known()
        problem = self._taken_up(in_force(settings or {}, known))
        self._vehicle_parameters = VehicleParameters(self._node, vehicle, known)
        self._calibrations = Calibrations(self._node)
        self.runs = RunKeeper(
            catalogue,
            self._store,
            self._vehicle_parameters,
            vehicle,
            operator,
            self._calibrations.attachment,
            self._pace.written,
        )
        self._recorder = self.runs.recorder
        self._outbox = Outbox(
            self._node,
            vehicle,
            self._recorder.put,
            self.link.vehicle_ns,
            self.link.standing,
            speaker="station" if is_alone else f"station {vehicle}",
            # In lockstep many more heartbeats go over the lane, and the link needs none of them.
            beats_over_link=self._pace.beats_over_link * (5 if self._progress.in_lockstep else 1),
        )
        self._store.subscribe(self._outbox.parameter_changed)
        self._alarms = AlarmBoard(partial(self._outbox.say, WARN))
        if problem:
            self._outbox.say(WARN, f"the beacons that were in force are not taken up: {problem}")
        self.control = ControlDesk(self._node, self._outbox, self.link.vehicle_ns)
        parameters = self._store.parameters
        self._comparison = ComparisonFeed(
            parameters.comparison,
            self._outbox.put,
            partial(self._outbox.say, INFO),
            lambda: is_alone or self._outbox.has_subscribers("comparison"),
        )
        self._tracker = TrackerFeed(
            parameters.tracker,
            parameters.bearings,
            self._on_pose,
            self._on_bearings,
            follows_process=follows_process,
        )
        self._layout = BeaconLayout(
            lambda: parameters.bearings.layout,
            self._vehicle_parameters,
            lambda: not self.link.refusal("change_parameters"),
            vehicle_teller(self._node),
        )
        self._store.consult(self._layout.before_change)
        self._witness = ParameterWitness(history, partial(self._alarms.set, "history"))
        self._witness.begin(self._store.values())
        self._vehicle_parameters.subscribe(self._witness.look)
        self.experiments = ExperimentRunner(
            self._node,
            vehicle,
            self.link.state,
            self.link.vehicle_ns,
            self._outbox,
            self._vehicle_parameters,
            self.runs,
            self._calibrations,
            catalogue,
            settings_of(parameters),
            self._asked,
            self._permit,
        )
        CommandGateway(
            self._node,
            self._store,
            self.link.refusal,
            self.runs.by_hand,
            self.control.permit,
            self.experiments.commanded,
        )
        MarkService(self._node, vehicle, catalogue, self._recorder, self._outbox, self.link)
        self._house = Housekeeping(
            catalogue,
            parameters.recorder,
            self._recorder.status,
            partial(self._outbox.say, INFO),
            self._alarms.set,
            purges=keeps_house,
        )
        LogWindow(self._node, self.link.state)
        serve_parameters(self._node, self._store)
        self._sticks = StickDesk(
            self._outbox, self.control.steers, self.experiments, lambda: parameters.sticks.timeout
        )
        self.checks = CheckDesk(
            self._node,
            self._outbox,
            parameters,
            self.link,
            self._tracker,
            self._vehicle_parameters,
            self._recorder,
            self._alarms,
            catalogue.folder,
            lambda: self._sticks.alarm is not None,
            endpoints,
        )
        self._status = StatusSender(
            self._outbox,
            self.link,
            self._tracker,
            self._recorder,
            self._alarms,
            self.checks.gatherer.take_link,
        )
        questions = SlowQuestions(
            self._node,
            self.link,
            self._recorder,
            self._vehicle_parameters,
            self._layout,
            self._calibrations,
            self._alarms,
        )
        self._transfers = Transfers(
            self._node,
            catalogue,
            vehicle,
            parameters.recorder,
            self.link.state,
            self._outbox.say,
            self.link.vehicle_ns,
        )
        self.runs.subscribe(self._transfers.desk.run_closed)
        introduction = Introduction(self._node, vehicle, self.link)
        telemetry = TelemetryIn(
            vehicle,
            self.link,
            self._outbox,
            self._recorder,
            self._comparison,
            self.checks.observed,
            self.experiments,
            RecentTelemetry(self._node),
            self._progress.vehicle_received,
        )
        reception = Reception(
            vehicle,
            link=self.link,
            outbox=self._outbox,
            telemetry=telemetry,
            observed=self.checks.observed,
            parameters=self._vehicle_parameters,
            history=self._witness,
            runs=self.runs,
            experiments=self.experiments,
            comparison=self._comparison,
            calibrations=self._calibrations,
            sticks=self._sticks,
            tracker=self._tracker,
            progress=self._progress,
        )
        self._subscriptions = Subscriptions(
            self._node,
            vehicle,
            host,
            self.link,
            self._alarms,
            self.checks.observed,
            self._recorder,
            reception.handlers,
            self._outbox.beats,
            self._closing,
        )
        self._pictures = PictureRecording(session, vehicle, self._recorder, parameters.recorder)
        self.checks.start()
        self._threads = [
            threading.Thread(target=target, name=name, daemon=True)
            for name, target in (
                ("beat", self._beat),
                ("who", partial(introduction.run, self._closing, self._guard)),
                ("slow", partial(questions.run, self._closing, self._guard)),
                ("tidy", partial(self._tidy, keeps_house)),
            )
        ]
        for thread in self._threads:
            thread.start()

    def _taken_up(self, kept: Mapping[str, ParameterValue]) -> str:
        """Set values from before the start, which another version may have written; return the
        reason for refusing them, or "".
        """
        try:
            self._store.preset(kept)
        except ParameterError as error:
            return str(error)
        return ""

    def close(self) -> None:
        """Close the station, the run's file first: nothing else matters as much."""
        self._closing.set()
        self.runs.close()
        self._transfers.close()
        self.checks.close()
        self.experiments.close()
        self._sticks.close()
        self._tracker.close()
        self._comparison.close()
        for thread in self._threads:
            thread.join(CLOSE_PATIENCE)
        self._pictures.close()
        self._subscriptions.close()
        self._node.close()
        self._witness.close()

    def warn(self, line: str) -> None:
        """Publish a warning event of this vehicle."""
        self._outbox.say(WARN, line)

    # ------------------------------------------------------------------ commands, measurements
    def _permit(self, command: str, requester: str) -> None:
        """Raise RefusedError when a command of an experiment is not permitted now."""
        if reason := self.link.refusal(command):
            raise RefusedError(reason)
        self.control.permit(command, requester)

    def _asked(self, command: str, requester: str) -> None:
        """Prepare for a command of a person or an experiment before it is forwarded. Raises
        RefusedError.
        """
        if command == "arm":
            self.checks.preflight.before_arming(requester)
        self.runs.asked(command, requester)

    def _on_bearings(self, frame: BearingMeasurement) -> None:
        self._outbox.bearings(frame)
        self._comparison.bearings(frame)

    def _on_pose(self, pose: PoseMeasurement) -> None:
        self._outbox.pose(pose)
        if has_attitude(pose.quaternion_wb):
            self._comparison.pose(pose)
            self.experiments.readings.pose(pose)

    # ------------------------------------------------------------------ threads
    def _beat(self) -> None:
        """Send the heartbeat and end runs, at 20 Hz or, with many vehicles, 10 Hz; send the status
        topics every fourth time, and at once when the link's state changes.
        """
        due, count = time.monotonic(), 0
        while not self._closing.is_set():
            count += 1
            self._guard(self._beat_once, count)
            due = max(due + self._pace.beat, time.monotonic())  # never catch up in a burst
            self._closing.wait(due - time.monotonic())

    def _beat_once(self, count: int) -> None:
        if self.link.standing.beats:
            self._outbox.heartbeat(count)
        self._alarms.set("standing", self.link.problem() or None)
        self._alarms.set("radio", self.link.standing.unreachable or None)
        self._alarms.set("sticks", self._sticks.alarm)
        eyes = ("tracker", self._tracker.alarm), ("camera", self._tracker.camera_alarm)
        for key, line in eyes:
            if line != self._alarms.keyed().get(key):
                self._alarms.set(key, None)  # so that a different problem is reported as well
            self._alarms.set(key, line)
        self.runs.tick()
        self._pictures.tick()
        self.control.tick(count)
        self.experiments.tick(count)
        self._transfers.tick(count)
        if count % STATUS_EVERY == 0 or self._status.link_changed:
            self._status.send()

    def _tidy(self, keeps_house: bool) -> None:
        if keeps_house:
            self._guard(self._house.tidy)
        while not self._closing.wait(PERIOD):
            self._guard(self._house.look)

    def _guard(self, act: Callable[..., None], *arguments: Any) -> None:
        """Call `act` and turn a defect in it into an alarm: it must not stop the heartbeat of a
        flight.
        """
        try:
            act(*arguments)
        except Exception as error:
            if self._closing.is_set() and isinstance(error, LinkError):
                return  # the session was closed first
            log.exception("station")
            self._alarms.set("defect", f"station: defect, see its log: {error!r}")
