"""The base station between one vehicle and everything on the base.

Zenoh's threads deliver messages, each topic in its own; one thread sends the heartbeat, one polls
the vehicle for slow data, and the recorder and the tracker have their own. Nothing here waits for
the disk or the radio except the thread whose job it is.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from bearing_sim import BearingMeasurement, PoseMeasurement
from console.alarms import Alarms
from console.beacon_layout import BeaconLayout, layout_setter, restored_layout
from console.calibrations import Calibrations
from console.catalogue.catalogue import Catalogue
from console.checks.gather import Gatherer
from console.checks.observed import Observed
from console.checks.preflight import Preflight
from console.checks.startup import StartupChecks
from console.commands.gateway import CommandGateway
from console.commands.lease_service import LeaseService
from console.commands.marks import MarkService
from console.commands.stick_control import StickHandler
from console.comparison.feed import ComparisonFeed
from console.context import StationContext
from console.exchange.heartbeat import Heartbeat
from console.exchange.message_handlers import MessageHandlers
from console.exchange.pictures import PictureRecording
from console.exchange.polling import VehiclePolling
from console.exchange.status_sender import StatusSender
from console.exchange.subscriptions import Subscriptions
from console.exchange.telemetry import TelemetryReception
from console.experiment_running.runner import ExperimentRunner
from console.link.forwarding import forward_service
from console.link.identification import VehicleIdentification
from console.link.monitor import LinkMonitor
from console.link.outbox import INFO, WARN, Outbox
from console.link.wakeup_rates import wakeup_rates
from console.parameters.history import ParameterHistory
from console.parameters.history_writer import ParameterHistoryWriter
from console.parameters.store import StationStore
from console.parameters.vehicle import VehicleParameters
from console.runs.housekeeping import Housekeeping
from console.runs.runs import RunManager
from console.tracker_feed import TrackerFeed
from console.transfers.service import Transfers
from quadrotor.errors import LinkError, ParameterError, RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import has_attitude
from vehicle_link.lockstep import STATION_PROCESS, ProcessProgress
from vehicle_link.process_instance import new_instance
from vehicle_link.transport import time_sync
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import serve_parameters

log = logging.getLogger(__name__)

CLOSE_PATIENCE = 3.0
LOG_TIMEOUT = 1.0
"""Seconds to wait for a part of the vehicle's log."""


class BaseStation:
    """Base station of one vehicle: all parts of this process, wired to one Zenoh session.

    Args:
        session: from vehicle_link.transport.session.hub_session.
        vehicle: its name, which is the namespace of the topics.
        operator: written into runs that were started without a requester.
        settings: `station.*` parameters to start with.
        housekeeping: whether this station tidies the runs' folder, which several stations share.
        vehicles: number of vehicles of this process. With a single one, estimators are compared
            even when no page shows it, so that each run has the comparison, and lines for the
            terminal need no name.
        host: host of the vehicle, for datagrams next to the link; empty for none.
        instance: random number of this process (vehicle_link.process_instance).
        endpoints: where the station listens and what it connects to, in words.
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
        housekeeping: bool = True,
        vehicles: int = 1,
        host: str = "",
        instance: int | None = None,
        endpoints: str = "",
        follows_process: bool = False,
    ) -> None:
        self._vehicle = vehicle
        rates, is_alone = wakeup_rates(vehicles), vehicles == 1
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
        problem = self._restore(restored_layout(settings or {}, known))
        self._vehicle_parameters = VehicleParameters(self._node, vehicle, known)
        self._calibrations = Calibrations(self._node)
        self.runs = RunManager(
            catalogue,
            self._store,
            self._vehicle_parameters,
            vehicle,
            operator,
            self._calibrations.attachment,
            rates.write_period,
        )
        self._recorder = self.runs.recorder
        self._outbox = Outbox(
            self._node,
            vehicle,
            self._recorder.put,
            self.link.vehicle_ns,
            self.link.permission,
            speaker="station" if is_alone else f"station {vehicle}",
            # In lockstep many more heartbeats go over the lane, and the link needs none of them.
            zenoh_heartbeat_every=rates.zenoh_heartbeat_every
            * (5 if self._progress.in_lockstep else 1),
        )
        self._store.subscribe(self._outbox.parameter_changed)
        self._alarms = Alarms(partial(self._outbox.say, WARN))
        if problem:
            self._outbox.say(WARN, f"the previous beacon layout was not restored: {problem}")
        parameters = self._store.parameters
        context = StationContext(
            self._node, vehicle, self.link, self._outbox, self._recorder, self._alarms, parameters
        )
        self.control = LeaseService(context)
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
            self._vehicle_parameters.known,
            lambda: not self.link.refusal("change_parameters"),
            layout_setter(self._node),
        )
        self._store.consult(self._layout.before_change)
        self._history = ParameterHistoryWriter(history, partial(self._alarms.set, "history"))
        self._history.begin(self._store.values())
        self._vehicle_parameters.subscribe(self._history.compare)
        self.experiments = ExperimentRunner(
            context,
            self._vehicle_parameters,
            self.runs,
            self._calibrations,
            catalogue,
            self._asked,
            self._permit,
        )
        CommandGateway(
            self._node,
            self._store,
            self.link.refusal,
            self.link.deadline_ns,
            self.runs.by_hand,
            self.control.permit,
            self.experiments.commanded,
        )
        MarkService(context, catalogue)
        house = Housekeeping(
            catalogue,
            parameters.recorder,
            self._recorder.status,
            partial(self._outbox.say, INFO),
            self._alarms.set,
            purges=housekeeping,
        )
        forward_service(self._node, "onboard_log", self.link.state, LOG_TIMEOUT)
        serve_parameters(self._node, self._store)
        self._sticks = StickHandler(
            self._outbox,
            self.control.accepts_sticks,
            self.experiments.passes,
            lambda: parameters.sticks.timeout,
        )
        observed, folder = Observed(), catalogue.folder
        gatherer = Gatherer(
            context,
            observed,
            self._tracker,
            self._vehicle_parameters,
            folder,
            lambda: self._sticks.alarm is not None,
        )
        self._preflight = Preflight(context, gatherer.facts, self._vehicle_parameters.refresh)
        startup_checks = StartupChecks(context, folder.parent, gatherer, endpoints)
        status = StatusSender(context, self._tracker, gatherer.note_link_status)
        polling = VehiclePolling(
            context, self._vehicle_parameters, self._layout, self._calibrations
        )
        self._transfers = Transfers(context, catalogue)
        self.runs.subscribe(self._transfers.queue.run_closed)
        identification = VehicleIdentification(self._node, vehicle, self.link)
        telemetry = TelemetryReception(
            context, self._comparison, observed, self.experiments, self._progress.vehicle_received
        )
        message_handlers = MessageHandlers(
            context,
            telemetry=telemetry,
            observed=observed,
            parameters=self._vehicle_parameters,
            history=self._history,
            runs=self.runs,
            experiments=self.experiments,
            comparison=self._comparison,
            calibrations=self._calibrations,
            sticks=self._sticks,
            tracker=self._tracker,
            progress=self._progress,
        )
        self._subscriptions = Subscriptions(
            context, host, observed, message_handlers.handlers, self._closing
        )
        self._pictures = PictureRecording(context)
        heartbeat = Heartbeat(
            context,
            rates.heartbeat_period,
            self._sticks,
            self._tracker,
            status,
            (
                lambda _: self.runs.tick(),
                lambda _: self._pictures.tick(),
                self.control.tick,
                self.experiments.tick,
                self._transfers.tick,
            ),
        )
        self._threads = [
            threading.Thread(target=run, args=(self._closing, self._guard), name=name, daemon=True)
            for name, run in (
                ("beat", heartbeat.run),
                ("identification", identification.run),
                ("polling", polling.run),
                ("housekeeping", house.run),
                ("preflight", self._preflight.run),
                ("checks", startup_checks.run),
            )
        ]
        for thread in self._threads:
            thread.start()

    def _restore(self, kept: Mapping[str, ParameterValue]) -> str:
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
        self.experiments.close()
        self._sticks.close()
        self._tracker.close()
        self._comparison.close()
        for thread in self._threads:
            thread.join(CLOSE_PATIENCE)
        self._pictures.close()
        self._subscriptions.close()
        self._node.close()
        self._history.close()

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
            self._preflight.before_arming(requester)
        self.runs.note_command(command, requester)

    def _on_bearings(self, frame: BearingMeasurement) -> None:
        self._outbox.bearings(frame)
        self._comparison.bearings(frame)

    def _on_pose(self, pose: PoseMeasurement) -> None:
        self._outbox.pose(pose)
        if has_attitude(pose.quaternion_wb):
            self._comparison.pose(pose)
            self.experiments.readings.pose(pose)

    def _guard(self, act: Callable[[], None]) -> None:
        """Call `act` and turn a defect in it into an alarm: it must not stop the heartbeat of a
        flight.
        """
        try:
            act()
        except Exception as error:
            if self._closing.is_set() and isinstance(error, LinkError):
                return  # the session was closed first
            log.exception("station")
            self._alarms.set("defect", f"station: defect, see its log: {error!r}")
