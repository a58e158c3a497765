"""The motor law about hover, from a flight of a vehicle that was weighed.

Each of the four rotors carries a quarter of the specific force along z_B, m f / 4, and by the motor
law its root is linear in the reference, slope (ref + offset). The reference is that of the thrust
which was commanded, by the law in force. Both sides pass the same low pass, the reference first the
rotors' lag. In hover alone the slope is found and the offset kept. A board that takes a throttle
instead of references is given the reference over its range, so that this is its thrust curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from console.evaluation.log_columns import FlownParameters, read_columns, read_parameters
from console.evaluation.motor_bench import Battery
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

THRUSTS = tuple(f"thrusts[{k}]" for k in range(4))
FORCE = "linear_acceleration.z"
WANTED = {"imu": (FORCE,), "actuators": THRUSTS, "status": ("behavior",), "battery": ("voltage",)}
POLE = 10.0
"""Pole of the low pass, rad/s; the noise of the accelerometer is far above it."""
LEAST = 5.0
"""Shortest flight, in s, for a result."""
SPREAD_MIN = 1.0
"""Standard deviation of the reference, in counts, below which it hovered and the offset is kept."""
MISS_MAX = 0.01
"""Largest standard deviation of the thrust, as a share, in the range that was flown."""
ERROR_MAX = 0.02
"""Largest error of the thrust, as a share, in the range that was flown."""
PIECES = 3


@dataclass(frozen=True, slots=True)
class ThrustCurve:
    """The motor law that was identified.

    Attributes:
        slope, offset: of the law at the nominal voltage, sqrt(N) per count and counts.
        flown: least and largest reference of the flight, counts.
        miss: standard deviation of the thrust, as a share, between the thirds of the flight.
        error: largest error of the thrust, as a share; NaN when the truth is unknown.
        offset_found: whether the flight determined the offset.
    """

    mass: float
    slope: float
    offset: float
    flown: tuple[float, float]
    miss: float
    error: float
    offset_found: bool
    seconds: float
    parameters: FlownParameters

    def metrics(self) -> dict[str, float]:
        """Return the figures in counts, sqrt(N) per count, s, shares, without unknown ones."""
        found = {
            "motor_slope": self.slope,
            "motor_offset": self.offset,
            "reference_min": self.flown[0],
            "reference_max": self.flown[1],
            "thrust_miss_share": self.miss,
            "thrust_error_share": self.error,
            "flown_s": self.seconds,
        }
        return {name: value for name, value in found.items() if not math.isnan(value)}

    def limits(self) -> dict[str, float]:
        """Return the largest acceptable values."""
        known = {"thrust_error_share": ERROR_MAX} if math.isfinite(self.error) else {}
        return {**known, "thrust_miss_share": MISS_MAX}

    def record(self) -> CalibrationRecord:
        """Return the record of the mass and the law."""
        before = self.parameters.vehicle
        hovering = "" if self.offset_found else "not flown around: the offset is the earlier one"
        return CalibrationRecord(
            name="mass",
            values={
                "model.mass": self.mass,
                "model.motor_slope": round(self.slope, 6),
                "model.motor_offset": round(self.offset, 3),
            },
            figures=tuple(
                Quality(name=name, value=float(value), unit=unit)
                for name, value, unit in (
                    ("slope of the model", before["model.motor_slope"], "√N/count"),
                    ("offset of the model", before["model.motor_offset"], "count"),
                    ("least reference", self.flown[0], "count"),
                    ("largest reference", self.flown[1], "count"),
                )
            ),
            quality=(Quality(name="thrust miss", value=self.miss, limit=MISS_MAX),),
            warnings=(hovering,) if hovering else (),
            conditions={
                "meaning": "motor law about hover, by the mass on the scales",
                "flown": f"{self.seconds:.1f} s",
            },
        )


def read_thrust_curve(log: Path, vehicle: str, mass: float) -> ThrustCurve:
    """Read the motor law of a vehicle of this mass (kg) from its log.

    Raises LogFormatError without the topics, MeasurementError when it hardly flew.
    """
    parameters = read_parameters(log)
    columns = read_columns(log, vehicle, WANTED, ("battery",))
    behaviors = columns["status"].changes("behavior")
    start = next((time for time, name in behaviors if name == "hover"), math.inf)
    end = next((time for time, name in behaviors if name == "land" and time > start), -math.inf)
    if not end - start >= LEAST:
        raise MeasurementError(
            f"{log.name}: less than {LEAST:g} s from the first hover to the landing, so the thrust "
            "is not known"
        )
    imu, actuators = columns["imu"], columns["actuators"]
    time, first, second = np.intersect1d(imu.time, actuators.time, return_indices=True)
    inside = (time >= start) & (time <= end)
    thrust = sum(actuators.values(name)[second][inside].astype(float) for name in THRUSTS)
    voltages = columns["battery"].values("voltage") if len(columns["battery"]) else np.empty(0)
    return find_curve(
        time[inside],
        np.asarray(thrust),
        imu.values(FORCE)[first][inside].astype(float),
        mass,
        float(voltages.mean()) if len(voltages) else math.nan,
        parameters,
    )


def find_curve(
    time: Array,
    thrust: Array,
    force: Array,
    mass: float,
    voltage: float,
    parameters: FlownParameters,
) -> ThrustCurve:
    """Fit the law to N ticks.

    Args:
        time: (N,) s. thrust: (N,) N, commanded from each tick to the next.
        force: (N,) m/s², specific force along z_B.
        mass: kg. voltage: V, NaN when unknown.
    """
    values = parameters.vehicle
    before, kept = float(values["model.motor_slope"]), float(values["model.motor_offset"])
    battery = Battery(
        float(values["model.battery_nominal"]), float(values["model.battery_exponent"])
    )
    gain = battery.gain(voltage) if battery.exponent > 0.0 and math.isfinite(voltage) else 1.0
    commanded = np.sqrt(np.maximum(0.25 * thrust, 0.0)) / (before * gain) - kept
    lag = float(values["model.motor_time_constant"])
    steps = np.diff(time, prepend=time[0])
    reference = _low_pass(_low_pass(commanded, steps, 1.0 / lag), steps, POLE)
    root = np.sqrt(np.maximum(0.25 * mass * _low_pass(force, steps, POLE), 0.0))
    settled = time >= time[0] + 10.0 / POLE
    reference, root = reference[settled], root[settled]
    found = reference.std() >= SPREAD_MIN
    slope, offset = _fit(reference, root, None if found else kept)
    flown = float(np.percentile(reference, 1.0)), float(np.percentile(reference, 99.0))
    ends = np.array(flown)
    pieces = [
        one * (ends + shift)
        for one, shift in (
            _fit(r, f, None if found else kept)
            for r, f in zip(
                np.array_split(reference, PIECES), np.array_split(root, PIECES), strict=True
            )
        )
    ]
    share = np.square(pieces) / np.square(slope * (ends + offset))
    miss = float(share.std(axis=0, ddof=1).max()) / math.sqrt(PIECES)
    return ThrustCurve(
        mass,
        slope / gain,
        offset=offset,
        flown=flown,
        miss=miss,
        error=_error(slope * (ends + offset), ends, parameters),
        offset_found=bool(found),
        seconds=float(time[-1] - time[0]),
        parameters=parameters,
    )


def _low_pass(values: Array, steps: Array, pole: float) -> Array:
    out = np.empty(len(values))
    slow = float(values[0])
    shares = -np.expm1(-pole * steps)
    for k, (value, share) in enumerate(zip(values.tolist(), shares.tolist(), strict=True)):
        slow += share * (value - slow)
        out[k] = slow
    return out


def _fit(reference: Array, root: Array, offset: float | None) -> tuple[float, float]:
    """Return slope and offset of root = slope (reference + offset); `offset` when it is known."""
    if offset is not None:
        return float(root.mean() / (reference.mean() + offset)), offset
    slope, constant = np.polyfit(reference, root, 1)
    return float(slope), float(constant / slope)


def _error(root: Array, reference: Array, parameters: FlownParameters) -> float:
    """Return the largest error, a share of the true thrust; NaN when it is unknown."""
    truth = parameters.truth
    if "motor_slope" not in truth or float(truth.get("battery_exponent", 0.0)) != 0.0:
        return math.nan
    true = float(truth["motor_slope"]) * (reference + float(truth["motor_offset"]))
    by_efficiency = np.square(root / true) / float(truth.get("thrust_efficiency", 1.0))
    return float(np.abs(by_efficiency - 1.0).max())
