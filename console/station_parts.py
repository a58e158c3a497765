"""The parts of one vehicle's base station, and what each is made from.

Each part is made when another one, or the station, first needs it, so that the order of their
construction follows from what they name.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING

from bearing_sim.emulator import BearingMeasurement
from bearing_sim.pose_measurement import PoseMeasurement
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
from console.context import StationContext
from console.disk_worker import DiskWorker
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
from console.parameters.station import StationParameters
from console.parameters.store import StationStore
from console.parameters.vehicle import VehicleParameters
from console.part import Part, PartContext, Parts
from console.runs.event_book import EventBook
from console.runs.housekeeping import Housekeeping
from console.runs.runs import RunManager
from console.tracker_feed import TrackerFeed
from console.transfers.service import Transfers
from quadrotor.errors import ParameterError, RefusedError, UsageError
from quadrotor.extension import StationPart
from quadrotor.extensions import registry
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters
from quadrotor.records import has_attitude
from vehicle_link.lockstep import STATION_PROCESS, ProcessProgress
from vehicle_link.process_instance import new_instance
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import serve_parameters
from vehicle_link.transport.publisher import OtherPath, Received

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import Session
LOCKSTEP_HEARTBEATS = 5
"""In lockstep so many more heartbeats go over the lane, and the link needs none of them."""
LOG_TIMEOUT = 1.0
"""Seconds to wait for a part of the vehicle's log."""


@dataclass(frozen=True)
class StationOptions:
    """The options of one vehicle's station.

    Attributes:
        vehicle: name of the vehicle, which is the namespace of its topics.
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

    vehicle: str = "quad1"
    operator: str = ""
    settings: Mapping[str, ParameterValue] = field(default_factory=dict)
    housekeeping: bool = True
    vehicles: int = 1
    host: str = ""
    instance: int | None = None
    endpoints: str = ""
    follows_process: bool = False

    @property
    def is_alone(self) -> bool:
        """Return whether the process has a single vehicle."""
        return self.vehicles == 1


class Measurements:
    """The parts that take what the tracker and the emulated cameras measure."""

    def __init__(self, outbox: Outbox, parts: Part, experiments: ExperimentRunner) -> None:
        self._outbox, self._parts, self._experiments = outbox, parts, experiments

    def bearings(self, frame: BearingMeasurement) -> None:
        """Pass on one frame of bearings."""
        self._outbox.bearings(frame)
        self._parts.bearings(frame)

    def pose(self, pose: PoseMeasurement) -> None:
        """Pass on one pose."""
        self._outbox.pose(pose)
        if has_attitude(pose.quaternion_wb):
            self._parts.pose(pose)
            self._experiments.readings.pose(pose)


class StationParts:
    """The parts of one station.

    Args:
        session: from vehicle_link.transport.session.hub_session.
        catalogue: of the runs.
    """

    def __init__(self, session: Session, catalogue: Catalogue, options: StationOptions) -> None:
        self.catalogue, self.options = catalogue, options
        self.closing = threading.Event()
        self.node = Node(session, f"/{options.vehicle}", "station")
        self.rates = wakeup_rates(options.vehicles)
        self.progress = ProcessProgress(options.vehicle)
        self.progress.is_this_process(STATION_PROCESS)

    # ------------------------------------------------------------------ link and parameters
    @cached_property
    def link(self) -> LinkMonitor:
        instance = self.options.instance
        return LinkMonitor(self.options.vehicle, new_instance() if instance is None else instance)

    @cached_property
    def store(self) -> StationStore:
        store = StationStore()
        store.preset(self.options.settings)
        return store

    @cached_property
    def history(self) -> ParameterHistory:
        return ParameterHistory(self.catalogue.engine, self.options.vehicle)

    @cached_property
    def known(self) -> Mapping[str, ParameterValue]:
        """Return the values of the last start."""
        return self.history.known()

    @cached_property
    def vehicle_parameters(self) -> VehicleParameters:
        return VehicleParameters(self.node, self.options.vehicle, self.known)

    @cached_property
    def calibrations(self) -> Calibrations:
        return Calibrations(self.node)

    @cached_property
    def runs(self) -> RunManager:
        return RunManager(
            self.catalogue,
            self.store,
            vehicle_parameters=self.vehicle_parameters,
            vehicle=self.options.vehicle,
            operator=self.options.operator,
            calibrations=self.calibrations.attachment,
            period=self.rates.write_period,
        )

    @cached_property
    def outbox(self) -> Outbox:
        options = self.options
        by_lane = OtherPath(
            self._heartbeat_by_lane,
            self.rates.zenoh_heartbeat_every
            * (LOCKSTEP_HEARTBEATS if self.progress.in_lockstep else 1),
        )
        return Outbox(
            self.node,
            options.vehicle,
            self.runs.recorder.put,
            self.link.vehicle_ns,
            self.link.permission,
            speaker="station" if options.is_alone else f"station {options.vehicle}",
            heartbeat_path=by_lane,
        )

    def _heartbeat_by_lane(self, heartbeat: Received) -> bool:
        return self.subscriptions.send_heartbeat(heartbeat)

    @cached_property
    def alarms(self) -> Alarms:
        return Alarms(partial(self.outbox.say, WARN))

    @cached_property
    def context(self) -> StationContext:
        return StationContext(
            self.node,
            self.options.vehicle,
            link=self.link,
            outbox=self.outbox,
            recorder=self.runs.recorder,
            alarms=self.alarms,
            parameters=self.store.parameters,
        )

    @cached_property
    def layout(self) -> BeaconLayout:
        bearings = self.store.parameters.bearings
        return BeaconLayout(
            lambda: bearings.layout,
            self.vehicle_parameters.known,
            lambda: not self.link.refusal("change_parameters"),
            layout_setter(self.node),
        )

    @cached_property
    def list_worker(self) -> DiskWorker:
        """Return the writer of the lists of changes and of events, which are one file."""
        return DiskWorker("lists")

    @cached_property
    def history_writer(self) -> ParameterHistoryWriter:
        alarm = partial(self.alarms.set, "history")
        return ParameterHistoryWriter(self.history, alarm, self.list_worker)

    # ------------------------------------------------------------------ commands and flights
    @cached_property
    def control(self) -> LeaseService:
        return LeaseService(self.context)

    @cached_property
    def experiments(self) -> ExperimentRunner:
        return ExperimentRunner(
            self.context,
            self.vehicle_parameters,
            runs=self.runs,
            calibrations=self.calibrations,
            catalogue=self.catalogue,
            asked=self._asked,
            permit=self._permit,
        )

    @cached_property
    def sticks(self) -> StickHandler:
        parameters = self.store.parameters.sticks
        return StickHandler(
            self.outbox,
            self.control.accepts_sticks,
            self.experiments.passes,
            lambda: parameters.timeout,
        )

    @cached_property
    def transfers(self) -> Transfers:
        return Transfers(self.context, self.catalogue)

    @cached_property
    def housekeeping(self) -> Housekeeping:
        return Housekeeping(
            self.catalogue,
            self.store.parameters.recorder,
            self.runs.recorder.status,
            partial(self.outbox.say, INFO),
            self.alarms.set,
            purges=self.options.housekeeping,
        )

    # ------------------------------------------------------------------ measurements
    @cached_property
    def added(self) -> Parts:
        """Return the parts that extensions add."""
        made = {}
        for name, offered in registry().offers(StationPart, StationParameters.model_fields).items():
            try:
                make, own = offered.load(), getattr(self.store.parameters, name, None)
                if own is None and offered.offer.parameters:
                    offered.load(offered.offer.parameters)  # raises its error again
                made[name] = make(self._part_context(own))
            except UsageError as error:
                self.outbox.say(WARN, str(error))
        return Parts(made, self.alarms.set)

    def _part_context(self, parameters: Parameters | None) -> PartContext:
        return PartContext(
            self.options.vehicle,
            parameters,
            self.outbox.put,
            partial(self.outbox.say, INFO),
            lambda topic: self.options.is_alone or self.outbox.has_subscribers(topic),
        )

    @cached_property
    def tracker(self) -> TrackerFeed:
        parameters = self.store.parameters
        taken = Measurements(self.outbox, self.added, self.experiments)
        return TrackerFeed(
            parameters.tracker,
            parameters.bearings,
            taken.pose,
            taken.bearings,
            follows_process=self.options.follows_process,
        )

    @cached_property
    def pictures(self) -> PictureRecording:
        return PictureRecording(self.context)

    @cached_property
    def observed(self) -> Observed:
        return Observed()

    @cached_property
    def subscriptions(self) -> Subscriptions:
        telemetry = TelemetryReception(
            self.context,
            self.added,
            self.observed,
            self.experiments,
            self.progress.vehicle_received,
        )
        events = EventBook(self.catalogue.engine, self.options.vehicle)
        handlers = MessageHandlers(
            self.context,
            telemetry=telemetry,
            observed=self.observed,
            parameters=self.vehicle_parameters,
            history=self.history_writer,
            keep_event=lambda event: self.list_worker.put(partial(events.add, event)),
            runs=self.runs,
            experiments=self.experiments,
            parts=self.added,
            calibrations=self.calibrations,
            sticks=self.sticks,
            tracker=self.tracker,
            progress=self.progress,
        )
        return Subscriptions(
            self.context, self.options.host, self.observed, handlers.handlers, self.closing
        )

    # ------------------------------------------------------------------ checks and loops
    @cached_property
    def gatherer(self) -> Gatherer:
        return Gatherer(
            self.context,
            self.observed,
            self.tracker,
            self.vehicle_parameters,
            self.catalogue.folder,
            lambda: self.sticks.alarm is not None,
        )

    @cached_property
    def preflight(self) -> Preflight:
        return Preflight(self.context, self.gatherer.facts, self.vehicle_parameters.refresh)

    @cached_property
    def startup_checks(self) -> StartupChecks:
        folder = self.catalogue.folder.parent
        return StartupChecks(self.context, folder, self.gatherer, self.options.endpoints)

    @cached_property
    def polling(self) -> VehiclePolling:
        return VehiclePolling(self.context, self.vehicle_parameters, self.layout, self.calibrations)

    @cached_property
    def identification(self) -> VehicleIdentification:
        return VehicleIdentification(self.node, self.options.vehicle, self.link)

    @cached_property
    def heartbeat(self) -> Heartbeat:
        status = StatusSender(self.context, self.tracker, self.gatherer.note_link_status)
        ticks = (
            lambda _: self.runs.tick(),
            lambda _: self.pictures.tick(),
            self.control.tick,
            self.experiments.tick,
            self.transfers.tick,
        )
        return Heartbeat(
            self.context, self.rates.heartbeat_period, self.sticks, self.tracker, status, ticks
        )

    # ------------------------------------------------------------------ between the parts
    def serve(self) -> None:
        """Offer the station's services, and connect the parts that inform each other."""
        self.store.subscribe(self.outbox.parameter_changed)
        self.store.consult(self.layout.before_change)
        self.vehicle_parameters.subscribe(self.history_writer.compare)
        self.history_writer.begin(self.store.values())
        self.runs.subscribe(self.transfers.queue.run_closed)
        CommandGateway(
            self.node,
            self.store,
            refusal=self.link.refusal,
            deadline_ns=self.link.deadline_ns,
            record=self.runs.by_hand,
            permit=self.control.permit,
            on_asked=self.experiments.commanded,
            on_started=self.runs.note_start,
        ).serve()
        MarkService(self.context, self.catalogue).serve()
        forward_service(self.node, "onboard_log", self.link.state, LOG_TIMEOUT)
        serve_parameters(self.node, self.store)

    def restore_layout(self) -> str:
        """Take over the layout of the last start, which another version may have written; return
        the reason for refusing it, or "".
        """
        try:
            self.store.preset(restored_layout(self.options.settings, self.known))
        except ParameterError as error:
            return str(error)
        return ""

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
            self.preflight.before_arming(requester)
        self.runs.note_command(command, requester)
