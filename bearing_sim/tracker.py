"""A simulated external tracking system: noisy poses at its own rate, some lost, all delayed."""

from __future__ import annotations

import math

import numpy as np

from bearing_sim.faults.fault import Faults, moved
from bearing_sim.faults.tracker import CATALOGUE, delivered
from bearing_sim.pose_measurement import PoseMeasurement
from bearing_sim.sampling import SECOND_NS, DelayLine, Draws, SampleGrid
from quadrotor.parameters import Parameters, parameter
from quadrotor.plain_rotations import Array, Triple, turned
from quadrotor.records import NO_ATTITUDE
from quadrotor.tracked_body import TrackedBody


class TrackerParameters(Parameters):
    """The tracking system of the simulated laboratory."""

    rate: float = parameter(100.0, unit="Hz", ge=1, le=500, step=1)
    """poses a second"""
    position_noise: float = parameter(0.001, unit="m", ge=0, le=0.5, step=0.0005)
    """standard deviation on each axis"""
    attitude_noise: float = parameter(0.2, unit="°", ge=0, le=20, step=0.05)
    """standard deviation on each body axis"""
    delay: float = parameter(0.0, unit="s", ge=0, le=0.5, step=0.001)
    """from the pose being true to its arrival"""
    drop_out: float = parameter(0.0, ge=0, le=1, step=0.01)
    """share of poses lost"""
    stamp_error: float = parameter(0.0, unit="s", ge=-0.1, le=0.1, step=0.001)
    """by which poses are stamped too late; below 0 too early"""
    outliers: float = parameter(0.0, ge=0, le=1, step=0.005)
    """share of poses that are outliers"""
    outlier_position: float = parameter(0.5, unit="m", ge=0, le=10, step=0.1)
    """how far an outlier is off, anywhere"""
    outlier_attitude: float = parameter(0.0, unit="°", ge=0, le=180, step=5)
    """how far an outlier is turned, anyhow"""
    positions_only: bool = parameter(False)
    """a single marker is tracked: positions without attitude"""
    seed: int = parameter(1, ge=0, le=2**31 - 1, step=1)
    """of the noise"""
    faults: str = parameter("")
    """faults with schedules, like 'tracker.freeze from=3 to=4; tracker.drift x=0.02'
    (docs/how_to/faults.md)"""
    body: TrackedBody = TrackedBody()

    def check_together(self) -> None:
        CATALOGUE.parse(self.faults, self)


class SimulatedTracker:
    """Simulated tracker: `observe` feeds the truth, `due` returns the measurements.

    `parameters` may be changed between calls; a new seed restarts the noise.
    """

    def __init__(self, parameters: TrackerParameters) -> None:
        self.parameters = parameters
        self._seed: int | None = None
        self._random = np.random.default_rng()
        self._grid = SampleGrid()
        self._line: DelayLine[PoseMeasurement] = DelayLine()
        self._faults = Faults(CATALOGUE)

    def observe(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Observe the true pose at `stamp_ns`: (3,) m, (4,) unit; at the tracker's rate or more."""
        p = self.parameters
        if p.faults != self._faults.text:
            self._faults.set(p.faults, p, stamp_ns)
        active = self._faults.active(stamp_ns, p.seed) if self._faults else ()
        p = moved(p, active)
        if not self._grid.takes(stamp_ns, p.rate):
            return
        if p.seed != self._seed:
            self._seed, self._random = p.seed, np.random.default_rng(p.seed)
        # Drawn for lost poses too, so that drop-outs do not shift the noise of other poses.
        d, e, f, a, b, c = self._random.standard_normal(6).tolist()
        lost = self._random.random() < p.drop_out
        if lost:
            return
        position_w, quaternion_wb = p.body.tracked(position_w, quaternion_wb)
        draws = Draws(p.seed, stamp_ns) if p.outliers > 0.0 else None
        if draws is not None and draws.uniform() <= p.outliers:
            position_w = position_w + np.multiply(p.outlier_position, _direction(draws))
            turn = math.radians(p.outlier_attitude)
            quaternion_wb = turned(quaternion_wb, [turn * axis for axis in _direction(draws)])
        x, y, z = position_w.tolist()
        far, wide = p.position_noise, math.radians(p.attitude_noise)
        measurement = PoseMeasurement(
            stamp_ns + round(p.stamp_error * SECOND_NS),
            np.array((x + far * d, y + far * e, z + far * f)),
            turned(quaternion_wb, (wide * a, wide * b, wide * c)),
        )
        if p.positions_only:
            measurement = measurement._replace(quaternion_wb=np.array(NO_ATTITUDE))
        for sent in delivered(measurement, active):
            self._line.put(stamp_ns + round(p.delay * SECOND_NS), sent)

    def due(self, now_ns: int) -> list[PoseMeasurement]:
        """Return the measurements that have arrived by `now_ns`, each once, in order."""
        return self._line.due(now_ns)

    @property
    def next_ns(self) -> int | None:
        """Return the arrival time of the next measurement in transit; None when there is none."""
        return self._line.next_ns


def _direction(draws: Draws) -> Triple:
    """Return a random unit vector, uniform over the sphere."""
    z, angle = 2.0 * draws.uniform() - 1.0, 2.0 * math.pi * draws.uniform()
    across = math.sqrt(max(0.0, 1.0 - z * z))
    return across * math.cos(angle), across * math.sin(angle), z
