"""The tracker's delay and the tracked body's pose on the vehicle, from a log."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from console.evaluation.log_columns import read_columns
from flight_log.fields import FORCE, RATE, TRACKED, TRACKED_ATTITUDE
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError
from quadrotor.parameters import ParameterStore

if TYPE_CHECKING:
    from extensions.identification.tracked_body.fit import TrackedBody

WANTED = {"imu": FORCE + RATE, "tracker_pose": TRACKED + TRACKED_ATTITUDE}
PARAMETER = "estimation.tracker."
DELAY_DEVIATION_MAX = 0.5
"""Largest standard deviation of the delay, ms."""
DRIFT_MAX = 1.0
"""Largest drift in ms per minute: a larger one comes from a clock at another rate, which no
constant corrects."""
TURN_DEVIATION_MAX = 0.1
"""Largest standard deviation of the axes, deg."""
LEVER_DEVIATION_MAX = 1.5
"""Largest standard deviation of the lever arm, mm."""
WORLD_TILT_MAX = 1.0
"""Largest angle between the tracker's z and gravity, deg."""


@dataclass(frozen=True, slots=True)
class TrackedBodyFound:
    """The result from which both experiments judge and propose."""

    found: TrackedBody

    @property
    def drift(self) -> float:
        """Return the change of the delay, ms per minute."""
        return 60e3 * self.found.drift

    @property
    def angles(self) -> tuple[float, float, float]:
        """Return roll, pitch and yaw (deg) of the tracked body's axes, ZYX."""
        m = self.found.matrix_bt
        return (
            math.degrees(math.atan2(m[2, 1], m[2, 2])),
            math.degrees(math.asin(max(-1.0, min(1.0, -float(m[2, 0]))))),
            math.degrees(math.atan2(m[1, 0], m[0, 0])),
        )

    def delay_record(self) -> CalibrationRecord:
        """Return the record of estimation.tracker.delay. Raises MeasurementError beyond
        its bounds.
        """
        f = self.found
        return self._record(
            "tracker_delay",
            {"delay": f.delay},
            (
                Quality(
                    name="position error by the delay at 1 m/s", value=1e3 * f.delay, unit="mm"
                ),
                Quality(name="drift", value=self.drift, unit="ms/min"),
            ),
            (
                Quality(
                    name="deviation",
                    value=1e3 * f.delay_deviation,
                    unit="ms",
                    limit=DELAY_DEVIATION_MAX,
                ),
                Quality(
                    name="drift beyond its uncertainty",
                    value=max(0.0, abs(self.drift) - 2.0 * 60e3 * f.drift_deviation),
                    unit="ms/min",
                    limit=DRIFT_MAX,
                ),
            ),
        )

    def body_record(self) -> CalibrationRecord:
        """Return the record of position and axes in estimation.tracker.*. Raises MeasurementError
        beyond their bounds.
        """
        f = self.found
        turn = math.acos(max(-1.0, min(1.0, 0.5 * (float(np.trace(f.matrix_bt)) - 1.0))))
        pose = dict(zip(("roll", "pitch", "yaw"), self.angles, strict=True))
        pose |= dict(zip("xyz", f.lever_b.tolist(), strict=True))
        return self._record(
            "tracker_body",
            pose,
            (
                Quality(name="turned by", value=math.degrees(turn), unit="°"),
                Quality(name="lever arm", value=1e3 * float(np.linalg.norm(f.lever_b)), unit="mm"),
                Quality(
                    name="acceleration if left uncorrected, up to",
                    value=9.81 * math.sin(min(turn, 0.5 * math.pi)),
                    unit="m/s²",
                ),
            ),
            (
                Quality(
                    name="deviation of the axes",
                    value=math.degrees(f.turn_deviation),
                    unit="°",
                    limit=TURN_DEVIATION_MAX,
                ),
                Quality(
                    name="deviation of the lever arm",
                    value=1e3 * f.lever_deviation,
                    unit="mm",
                    limit=LEVER_DEVIATION_MAX,
                ),
                Quality(
                    name="tracker's z against gravity",
                    value=math.degrees(f.world_tilt),
                    unit="°",
                    limit=WORLD_TILT_MAX,
                ),
            ),
        )

    def _record(
        self,
        name: str,
        values: dict[str, float],
        figures: tuple[Quality, ...],
        quality: tuple[Quality, ...],
    ) -> CalibrationRecord:
        from estimation.parameters import TrackerCalibration

        store = ParameterStore(TrackerCalibration())
        for key, value in values.items():
            d = store.description(key)
            if not float(d.minimum or 0.0) <= value <= float(d.maximum or 0.0):
                raise MeasurementError(
                    f"{PARAMETER}{key} = {value:.3g} {d.unit} is outside what the vehicle accepts: "
                    f"{d.minimum:g} to {d.maximum:g}; is it this vehicle's body, in metres?"
                )
        f = self.found
        return CalibrationRecord(
            name=name,
            values={f"{PARAMETER}{key}": round(value, 5) for key, value in values.items()},
            figures=(
                *figures,
                Quality(name="attitude, rms", value=math.degrees(f.attitude_rms), unit="°"),
                Quality(name="position, rms", value=1e3 * f.position_rms, unit="mm"),
            ),
            quality=quality,
            residuals=tuple(
                (f"second {k}, °", math.degrees(part)) for k, part in enumerate(f.parts[:200], 1)
            ),
            conditions={"seen": f"{f.seconds:.0f} s"},
        )


def read_tracked_body(log: Path, vehicle: str) -> TrackedBodyFound:
    """Identify the tracked body from a log. Raises LogFormatError without IMU or poses,
    MeasurementError with what is missing in the motion.
    """
    columns = read_columns(log, vehicle, WANTED)
    imu, poses = columns["imu"], columns["tracker_pose"]
    inertial = imu.rows(FORCE + RATE).astype(np.float64)
    seen = poses.rows(TRACKED + TRACKED_ATTITUDE).astype(np.float64)
    known = np.isfinite(seen).all(axis=1)
    fresh, rising = np.isfinite(inertial).all(axis=1), np.diff(poses.time, prepend=-np.inf) > 0.0
    fresh &= np.diff(imu.time, prepend=-np.inf) > 0.0
    known &= rising
    inertial, seen = inertial[fresh], seen[known]
    from extensions.identification.tracked_body.fit import Motion, identify_tracked_body  # slow

    motion = Motion(
        imu.time[fresh],
        inertial[:, :3],
        inertial[:, 3:],
        poses.time[known],
        seen[:, :3],
        seen[:, 3:],
    )
    return TrackedBodyFound(identify_tracked_body(motion))
