"""The readings for an experiment: IMU, tracker and bench, buffered while one runs."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

import numpy as np

from bearing_sim.pose_measurement import PoseMeasurement
from console.experiments.readings import BenchReadings, ImuReadings, TrackedAttitude
from quadrotor.records import Array, Record
from vehicle_link.clock import monotonic
from vehicle_link.messages import decode, stamp_of
from vehicle_link.topics.table import TOPICS

KEPT_TICKS = 60_000
"""Two minutes at 500 Hz, 7 MB; a slower reader loses the oldest, counted as a gap."""
KEPT_READINGS = 30_000
SEEN = 0.1
"""s after which a pose of the tracker is too old to use."""
_IMU = slice(1, 4), slice(4, 7), slice(7, 11), slice(11, 15)
COLUMNS = 15
MODULO = 1 << 32


class ReadingsFeed:
    """Buffers written by the station's subscriptions and read by the experiment's thread.

    Args:
        clock: returns s of a steady clock.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._on = False
        self._ticks: deque[Array] = deque()
        self._count = 0
        self._sequence: int | None = None
        self._lost = 0
        self._bench: deque[tuple[float, float, float, float]] = deque(maxlen=KEPT_READINGS)
        self._pose: tuple[float, PoseMeasurement] | None = None

    def begin(self) -> None:
        """Begin an experiment: earlier readings are dropped."""
        with self._lock:
            self._ticks.clear()
            self._bench.clear()
            self._count = self._lost = 0
            self._sequence, self._on = None, True

    def end(self) -> int:
        """Return the number of telemetry packets since `begin` that were late, lost or not
        read.
        """
        with self._lock:
            self._on = False
            self._ticks.clear()
            self._bench.clear()
            lost, self._count, self._lost = self._lost, 0, 0
        return lost

    # ------------------------------------------------------------------ input
    def telemetry(self, sequence: int, ticks: Record) -> None:
        """Add one packet: TICK records (N,). One that arrives after a newer one is a gap."""
        if not self._on:
            return
        imu, actuators = ticks["imu"], ticks["actuators"]
        stamps = imu["stamp_ns"]
        rows = np.empty((len(ticks), COLUMNS))
        rows[:, 0] = stamps * 1e-9
        rows[:, _IMU[0]], rows[:, _IMU[1]] = imu["specific_force_b"], imu["angular_velocity_b"]
        rows[:, _IMU[2]], rows[:, _IMU[3]] = actuators["motor_references"], actuators["wrench"]
        with self._lock:
            if self._sequence is not None:
                ahead = (sequence - self._sequence) % MODULO
                if ahead == 0 or ahead > MODULO // 2:
                    return
                self._lost += ahead - 1
            self._sequence = sequence
            self._ticks.append(rows)
            self._count += len(rows)
            while self._count > KEPT_TICKS:
                self._count -= len(self._ticks.popleft())
                self._lost += 1

    def pose(self, pose: PoseMeasurement) -> None:
        """Add a pose of the tracker."""
        self._pose = (self._clock(), pose)

    def bench(self, payload: bytes) -> None:
        """Add a received quadlab_msgs/BenchReading. Raises LinkError for an invalid one."""
        if not self._on:
            return
        reading = decode(payload, TOPICS["bench_reading"].type_name)
        row = (stamp_of(reading) * 1e-9, reading.force, reading.torque, reading.speed)
        with self._lock:
            self._bench.append((row[0], float(row[1]), float(row[2]), float(row[3])))

    # ------------------------------------------------------------------ output
    def imu(self) -> ImuReadings:
        """Return the IMU readings since the last call."""
        with self._lock:
            rows, self._count = list(self._ticks), 0
            self._ticks.clear()
        table = np.concatenate(rows) if rows else np.empty((0, COLUMNS))
        return ImuReadings(table[:, 0], *(table[:, columns] for columns in _IMU))

    def tracked(self) -> TrackedAttitude | None:
        seen = self._pose
        if seen is None or self._clock() - seen[0] > SEEN:
            return None
        pose = seen[1]
        return TrackedAttitude(pose.stamp_ns * 1e-9, np.array(pose.quaternion_wb, dtype=float))

    def bench_readings(self) -> BenchReadings:
        """Return the bench readings since the last call."""
        with self._lock:
            table = np.array(self._bench, dtype=float).reshape(-1, 4)
            self._bench.clear()
        return BenchReadings(table[:, 0], table[:, 1], table[:, 2], table[:, 3])
