"""Handle each message that the station receives, before it is recorded."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from bearing_sim.emulator import BearingMeasurement
from bearing_sim.pose_measurement import PoseMeasurement
from console.calibrations import Calibrations
from console.checks.observed import Observed
from console.commands.stick_control import StickHandler
from console.context import StationContext
from console.exchange.telemetry import TelemetryReception
from console.experiment_running.runner import ExperimentRunner
from console.link.outbox import WARN
from console.parameters.history_writer import ParameterHistoryWriter
from console.parameters.vehicle import VehicleParameters
from console.part import Part
from console.runs.event_book import KeptEvent
from console.runs.runs import RunManager
from console.tracker_feed import TrackerFeed
from vehicle_link.clock import host_time_ns
from vehicle_link.commands import BRAKING, EventKind
from vehicle_link.lockstep import ProcessProgress
from vehicle_link.messages import decode
from vehicle_link.parameters.change import VEHICLE, authority_of
from vehicle_link.parameters.messages import decode_change
from vehicle_link.topics.measurements import decode_bearings, decode_pose
from vehicle_link.topics.status import DELAYED_PREFIX, event_kinds
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import decode_odometry_pose
from vehicle_link.transport.publisher import Received

BEAT_NS = 18_000_000
"""Simulated time in ns, in lockstep, between two heartbeats that follow a truth: well within what
the simulator waits for (vehicle.simulator.lockstep)."""


class MessageHandlers:
    """The handlers of one vehicle's messages.

    Args:
        progress: the station's part in the simulation, which waits until the station has received
            its messages.

    Attributes:
        handlers: by topic; each may raise LinkError or MeasurementError for invalid content.
    """

    def __init__(
        self,
        context: StationContext,
        *,
        telemetry: TelemetryReception,
        observed: Observed,
        parameters: VehicleParameters,
        history: ParameterHistoryWriter,
        keep_event: Callable[[KeptEvent], None],
        runs: RunManager,
        experiments: ExperimentRunner,
        parts: Part,
        calibrations: Calibrations,
        sticks: StickHandler,
        tracker: TrackerFeed,
        progress: ProcessProgress,
    ) -> None:
        self._vehicle, self._link = context.vehicle, context.link
        self._outbox, self._observed = context.outbox, observed
        self._parameters, self._history, self._runs = parameters, history, runs
        self._keep_event = keep_event
        self._experiments, self._parts = experiments, parts
        self._calibrations, self._sticks = calibrations, sticks
        self._tracker, self._progress = tracker, progress
        self._beaten_ns = 0  # stamp of the truth after which a heartbeat was sent
        self.handlers: Mapping[str, Callable[[Received], None]] = {
            "telemetry": telemetry.received,
            "vehicle_heartbeat": self._heartbeat,
            "stick": self._stick,
            "status": self._status,
            "truth": self._truth,
            "tracker_body": self._tracked,
            "tracker_status": lambda received: tracker.note_tracker_status(
                decode(received.payload, TOPICS["tracker_status"].type_name)
            ),
            "camera_bearings": self._seen,
            "camera_status": lambda received: tracker.note_camera_status(
                decode(received.payload, TOPICS["camera_status"].type_name)
            ),
            "parameter_changes": self._parameter_change,
            "events": self._event,
            "estimator": lambda received: experiments.feed.estimate(received.payload),
            "bench_reading": lambda received: experiments.readings.bench(received.payload),
        }

    def _status(self, received: Received) -> None:
        status = decode(received.payload, TOPICS["status"].type_name)
        self._observed.status(status)
        self._parameters.note_status(int(status.instance), int(status.parameter_revision))
        if not status.armed and self._tracker.forget_ended_camera():
            self._outbox.say(WARN, "the camera on board was ended: bearings are emulated again")
        is_starting = str(status.mode).lower() == "starting"
        self._runs.status(bool(status.armed), is_starting)
        self._history.status(bool(status.armed), self._runs.recorder.run_id)
        self._experiments.feed.status(status)
        self._parts.status(bool(status.armed), is_starting)
        self._calibrations.status(is_starting)

    def _heartbeat(self, received: Received) -> None:
        self._link.beat(received.payload)
        self._progress.vehicle_received(received.source_ns)

    def _stick(self, received: Received) -> None:
        self._observed.message("stick", received.payload)
        self._sticks.received(received)

    def _parameter_change(self, received: Received) -> None:
        change = decode_change(received.payload)
        if authority_of(change.name) == VEHICLE:
            revision, instance = change.revision, change.instance
            self._parameters.apply({change.name: change.new}, revision, instance)
            self._experiments.feed.wake()
            self._runs.note_change(change.name, change.old, change.new)
        self._history.changed(change, host_time_ns())

    def _event(self, received: Received) -> None:
        """Keep an event; print on the base's terminal why the vehicle landed while it received no
        station; end an experiment when the vehicle brakes by itself.
        """
        event = decode(received.payload, TOPICS["events"].type_name)
        kinds = event_kinds(event)
        sent_ns = event.stamp.sec * 1_000_000_000 + event.stamp.nanosec
        self._keep_event(
            KeptEvent(
                stamp_ns=host_time_ns(),
                sent_ns=sent_ns,
                level=int(event.level),
                source=str(event.name),
                kinds=str(event.function),
                text=str(event.msg),
            )
        )
        if EventKind.DELAYED in kinds:
            print(f"station: {self._vehicle}: {event.msg}", flush=True)
        if EventKind.BRAKING in kinds:
            why = event.msg.removeprefix(DELAYED_PREFIX).removeprefix(BRAKING)
            self._experiments.braked(why)

    def _tracked(self, received: Received) -> None:
        sample, link = decode_pose(received.payload, or_position=True)[0], self._link
        pose = PoseMeasurement(
            link.vehicle_ns(int(sample["stamp_ns"])),
            sample["position_w"].copy(),
            sample["quaternion_wb"].copy(),
        )
        self._tracker.tracked(pose, link.vehicle_ns())

    def _seen(self, received: Received) -> None:
        sample = decode_bearings(received.payload)
        count = int(sample["count"][0])
        frame = BearingMeasurement(
            self._link.vehicle_ns(int(sample["stamp_ns"][0])),
            sample["beacon_id"][0, :count].copy(),
            sample["bearing_b"][0, :count].copy(),
            float(sample["sigma"][0]),
        )
        self._tracker.seen(frame)

    def _truth(self, received: Received) -> None:
        stamp_ns, *pose = decode_odometry_pose(received.payload, self._vehicle)
        at_ns = self._link.stamp_of_simulator(stamp_ns)
        self._parts.truth(at_ns, *pose)
        self._tracker.truth(at_ns, *pose)
        self._progress.truth(stamp_ns)
        if (
            self._progress.in_lockstep
            and self._link.permission.sends_heartbeats
            and not 0 <= stamp_ns - self._beaten_ns < BEAT_NS
        ):
            self._beaten_ns = stamp_ns
            self._outbox.heartbeat(0)  # comms then has what was sent before it
