"""A synthetic run as the station records it: the real schemas, rates, chunks and size, any length.

The vehicle flies laps of an 8; noise on every number makes the file as large as a real one (0.25
MB/s). Times are exact, so that a test knows what a replay must show.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bearing_sim.bearing_parameters import BearingParameters
from control.behaviors.parameters import BehaviorParameters
from flight_log.writer import Batch, LogWriter
from quadrotor.records import TICK
from vehicle_link.messages import encode, header, new
from vehicle_link.parameters.messages import to_value
from vehicle_link.topics import ticks as topic_ticks
from vehicle_link.topics.measurements import PICTURE

RATE = 500  # Hz
STEP_NS = 1_000_000_000 // RATE
PIECE = 20  # ticks written at once: a chunk of 40 ms
LAP = 8.0  # s
START_NS = 1_769_851_842_000_000_000
DELAY_NS = 2_000_000
TAKE_OFF, REST = 3.0, 3.0  # s after the start, before the end


@dataclass(frozen=True)
class MadeRun:
    """A synthetic run and its content; times in s since the first tick."""

    duration: float
    vehicle: str = "quad1"
    silence: tuple[float, float] | None = None  # no tick reaches the station in between
    marks: Sequence[tuple[float, str]] = ()
    changes: Sequence[tuple[float, str, Any, Any]] = ()  # t, parameter, old and new value
    pictures: Sequence[tuple[float, bytes]] = ()  # t, JPEG of the camera on board
    noise: float = 1e-3
    clock_ns: int = 0  # the vehicle's clock minus the station's
    late: float = 0.0  # s by which the take-off is later
    keep_out: str = "none"  # boxes, as the vehicle was told
    extra: dict[str, str] = field(default_factory=dict)

    @property
    def take_off(self) -> float:
        return TAKE_OFF + self.late

    @property
    def trajectory(self) -> float:
        """Return the start of the laps."""
        return self.take_off + 3.0

    def behavior(self, t: float) -> str:
        if t < self.take_off or t > self.duration - 1.0:
            return "ground"
        if t < self.trajectory:
            return "take_off"
        return "follow_trajectory" if t < self.duration - REST else "land"


def position_at(run: MadeRun, t: Any) -> Any:
    """Return the reference position without noise, m, shape (N, 3)."""
    t = np.asarray(t, float)
    flown = np.clip(t - run.trajectory, 0.0, max(0.0, run.duration - REST - run.trajectory))
    angle = 2.0 * math.pi / LAP * flown
    climbed = np.clip((t - run.take_off) / 3.0, 0.0, 1.0)
    up = climbed * np.clip((run.duration - 1.0 - t) / 2.0, 0.0, 1.0)
    return np.stack([np.sin(angle), 0.5 * np.sin(2.0 * angle), up], axis=-1)


def write_run(path: Path, run: MadeRun, seed: int = 1) -> Path:
    """Write the log. Raises StorageError."""
    random = np.random.default_rng(seed)
    behavior, sensor = BehaviorParameters(keep_out=run.keep_out), BearingParameters()
    parameters = {
        "vehicle": {f"behavior.{k}": v for k, v in behavior.model_dump().items()}
        | {"control.position.kp_xy": 4.0},
        "station": {f"station.bearings.{k}": v for k, v in sensor.model_dump().items()},
    }
    facts = {"run_id": path.stem, "vehicle": run.vehicle, "recorder": "station", **run.extra}
    attached = {"parameters.json": json.dumps(parameters).encode()}
    with LogWriter(path, facts, attached) as log:
        writer = _Writer(log, run, random)
        count = round(run.duration * RATE)
        for first in range(0, count, RATE * 10):
            writer.write(first, min(first + RATE * 10, count))
    return path


class _Writer:
    def __init__(self, log: LogWriter, run: MadeRun, random: np.random.Generator) -> None:
        self._log = log
        self._run = run
        self._random = random
        self._slow = self._slow_messages()
        self._next = next(self._slow, None)

    def write(self, first: int, last: int) -> None:
        run, count = self._run, last - first
        t = np.arange(first, last) / RATE
        log_ns = START_NS + np.arange(first, last, dtype=np.int64) * STEP_NS
        records = self._ticks(t, log_ns)
        arrival = log_ns.reshape(-1, 5)[:, -1:].repeat(5, 1).ravel() if count % 5 == 0 else log_ns
        arrival = arrival + DELAY_NS
        heard = np.ones(count, bool)
        if run.silence is not None:
            heard = (t < run.silence[0]) | (t >= run.silence[1])
        truth = records["state"].copy()
        truth["position_w"] -= 0.01 * self._noise(count, 3) / run.noise
        fast = [
            ("state", "nav_msgs/Odometry", topic_ticks.state_messages(records, run.vehicle), 1),
            ("reference", "quadlab_msgs/Reference", topic_ticks.reference_messages(records), 1),
            ("imu", "sensor_msgs/Imu", topic_ticks.imu_messages(records, run.vehicle), 1),
            (
                "actuators",
                "quadlab_msgs/Actuators",
                topic_ticks.actuator_messages(records, run.vehicle),
                1,
            ),
            (
                "truth",
                "nav_msgs/Odometry",
                topic_ticks.odometry_messages(log_ns + run.clock_ns, truth, run.vehicle),
                5,
            ),
        ]
        for begin in range(0, count, PIECE):
            batches = []
            for topic, type_name, messages, every in fast:
                chosen = np.arange(begin, min(begin + PIECE, count))
                chosen = chosen[heard[chosen] & ((chosen + first) % every == 0)]
                if len(chosen):
                    batches.append(
                        Batch(
                            f"/{run.vehicle}/{topic}",
                            type_name,
                            _whole(messages)[chosen],
                            arrival[chosen],
                            log_ns[chosen] + run.clock_ns,
                        )
                    )
            if batches:
                self._log.write_batches(batches)
            self._write_slow(float(t[min(begin + PIECE, count) - 1]))

    def _ticks(self, t: Any, log_ns: Any) -> Any:
        run, count = self._run, len(t)
        records = np.zeros(count, TICK)
        wanted = position_at(run, t)
        velocity = np.gradient(wanted, 1.0 / RATE, axis=0)
        records["imu"]["stamp_ns"] = log_ns + run.clock_ns
        records["imu"]["specific_force_b"] = [0.0, 0.0, 9.81] + 30.0 * self._noise(count, 3)
        records["imu"]["angular_velocity_b"] = self._noise(count, 3)
        records["state"]["position_w"] = wanted + self._noise(count, 3)
        records["state"]["velocity_w"] = velocity + self._noise(count, 3)
        records["state"]["angular_velocity_b"] = self._noise(count, 3)
        yaw = 0.3 * np.sin(t / 7.0)
        records["state"]["quaternion_wb"][:, 0] = np.cos(0.5 * yaw)
        records["state"]["quaternion_wb"][:, 3] = np.sin(0.5 * yaw)
        records["reference"]["position_w"] = wanted
        records["reference"]["velocity_w"] = velocity
        for name in ("acceleration_w", "jerk_w", "snap_w"):
            records["reference"][name] = self._noise(count, 3)
        records["reference"]["yaw"] = yaw
        records["actuators"]["wrench"] = np.array([12.8, 0, 0, 0]) + self._noise(count, 4)
        records["actuators"]["thrusts"] = 3.2 + self._noise(count, 4)
        records["actuators"]["motor_references"] = 127.0 + 100.0 * self._noise(count, 4)
        records["actuators"]["scaling"] = 1.0
        return records

    def _noise(self, count: int, width: int) -> Any:
        return self._run.noise * self._random.standard_normal((count, width))

    def _write_slow(self, until: float) -> None:
        while self._next is not None and self._next[0] <= until:
            t, topic, message = self._next
            stamp = START_NS + round(1e9 * t)
            name = message.__msgtype__.replace("/msg/", "/")
            self._log.write(
                f"/{self._run.vehicle}/{topic}",
                name,
                encode(message),
                stamp + DELAY_NS,
                stamp + self._run.clock_ns,
            )
            self._next = next(self._slow, None)

    def _slow_messages(self) -> Iterator[tuple[float, str, Any]]:
        """Yield all messages below 100 Hz in the order of time."""
        run, random, marked = self._run, self._random, 0
        once = sorted(
            [(t, "mark", text) for t, text in run.marks]
            + [(t, "change", change) for t, *change in run.changes]
            + [(t, "picture", jpeg) for t, jpeg in run.pictures]
            + [(run.take_off, "event", "take_off by anna")],
            key=lambda one: one[0],
        )
        for k in range(round(run.duration * 100)):
            t = k / 100.0
            head = header(START_NS + round(1e9 * t) + run.clock_ns)
            while once and once[0][0] <= t:
                at, kind, content = once.pop(0)
                head_at = header(START_NS + round(1e9 * at) + run.clock_ns)
                marked += 1
                yield at, *_single(kind, content, head_at, marked, at)
            pose = {
                "position": position_at(run, t) + run.noise * random.standard_normal(3),
                "orientation": (0.0, 0.0, 0.0, 1.0),
            }
            yield t, "tracker_pose", new("geometry_msgs/PoseStamped", header=head, pose=pose)
            if k % 2 == 0:
                yield (
                    t,
                    "estimator",
                    new(
                        "quadlab_msgs/EstimatorStatus",
                        header=head,
                        estimator="complementary",
                        mass=1.31 + 1e-3 * random.standard_normal(),
                    ),
                )
            if k % 10 == 0:
                flying = run.take_off < t < run.duration - 1.0
                yield (
                    t,
                    "status",
                    new(
                        "quadlab_msgs/VehicleStatus",
                        header=head,
                        mode="armed" if t >= 1.0 else "ready",
                        behavior=run.behavior(t),
                        armed=t >= 1.0,
                        airborne=flying,
                        flags=["not_real_time"] if flying else [],
                        tick_rate=500.0,
                    ),
                )
            if k % 20 == 0:
                yield (
                    t,
                    "link_status",
                    new("quadlab_msgs/LinkStatus", header=head, state="good", age=0.01),
                )
            if k % 50 == 0:
                voltage = 16.0 - t / 1e3
                yield t, "battery", new("sensor_msgs/BatteryState", header=head, voltage=voltage)


def _whole(messages: Any) -> Any:
    """Return whole records as bytes: numpy would not copy the bytes between fields."""
    return messages.view(f"V{messages.dtype.itemsize}")


def _single(kind: str, content: Any, head: Any, number: int, at: float) -> tuple[str, Any]:
    if kind == "mark":
        return "marks", new(
            "quadlab_msgs/Mark",
            header=head,
            id=str(number),
            text=content,
            time=at,
            requester="anna",
        )
    if kind == "change":
        name, old, value = content
        return "parameter_changes", new(
            "quadlab_msgs/ParameterChange",
            header=head,
            name=name,
            old_value=to_value(old),
            new_value=to_value(value),
            requester="anna",
            revision=number,
        )
    if kind == "picture":
        data = np.frombuffer(content, np.uint8)
        return "camera_picture", new(PICTURE, header=head, format="jpeg", data=data)
    return "events", new(
        "rcl_interfaces/Log", stamp=head.stamp, level=20, name="quad1", msg=content
    )
