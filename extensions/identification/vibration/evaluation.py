"""The noise of the inertial sensors, at rest and in hover, as an estimator needs it.

At rest the overlapping Allan deviation s(t) separates white noise of density N, s² = N² / t, from a
random walk of the bias of density K, s² = K² t / 3. In hover the floor of the spectrum between the
rotors' lines is the white noise including vibration. A sum over lines and floor would treat an
oscillation of a hundred times a second as noise that grows without bound.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from console.evaluation.figures import rms
from console.evaluation.log_columns import FlownParameters, read_columns, read_parameters
from console.evaluation.spectrum import evenly, rotor_frequency, spectrum
from extensions.identification.vibration.allan import allan_variance
from extensions.identification.vibration.lines import Line, lines_of
from flight_log.fields import FORCE, RATE, THRUSTS
from flight_log.run import Series
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Array

WANTED = {"imu": FORCE + RATE, "actuators": THRUSTS, "status": ("mode", "behavior")}
REST_MIN, HOVER_MIN = 8.0, 8.0
"""Shortest rest and hover, in s, for a result."""
SETTLE = 2.0
"""Seconds at the start of a hover that do not count."""
LOWEST = 15.0
"""Frequency in Hz below which the vehicle really moves."""
SHORT = 0.1
"""Averaging time in s at which the white noise is read at rest."""
LONG_SHARE = 0.2
"""Averaging time at which a random walk is looked for, as a share of the time at rest."""
CHANCE = 2.5
"""Multiple of the variance of white noise at that time which chance reaches once in a hundred."""
QUIET = 3.0
"""Multiple of the median of the spectrum below which a value is floor, not a line."""
BLOCK = 0.5
"""Time in s over which means at rest must agree; otherwise the vehicle was moved."""
MOVED = {"accelerometer": 0.15, "gyroscope": math.radians(0.5)}
"""Largest deviation from the mean at rest, m/s^2 and rad/s."""
UNCERTAIN_MAX = 0.1
"""Largest standard deviation of a density, as a share of it."""
PARAMETER = "estimation.error_state."
NOTCH = "estimation.rate_notch"
NOTCH_SHARE = 0.1
"""Smallest share, as a variance, of a rotor's line in the gyroscope's vibration that is worth a
notch."""
NOTCH_LOWEST = 40.0
"""Lowest frequency in Hz of a notch; a lower one would delay the rate loop by more than 2 ms."""
BOUNDS = {
    "accelerometer_noise": (1e-5, 1.0),
    "gyroscope_noise": (1e-5, 5.0),
    "accelerometer_bias_walk": (0.0, 0.5),
    "gyroscope_bias_walk": (0.0, 5.0),
}
UNITS = {"accelerometer": ("m/s²", 1.0), "gyroscope": ("°/s", math.degrees(1.0))}
"""Unit of each sensor's parameters, and the factor from SI."""


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """The noise of a sensor's three axes, in the unit of its parameters.

    Attributes:
        rest, hover: (3,) density of the white noise, unit/√Hz.
        uncertain: standard deviation of the hover's density, as a share of it.
        walk: density of the bias walk, unit/√s, an upper limit unless `walks`: one was seen.
        vibration: rms above LOWEST in hover, all axes.
        lines: of the mean spectrum of the three axes.
        frequency, density: (M,) Hz and (M, 3) unit²/Hz in hover.
    """

    rest: Array
    hover: Array
    uncertain: float
    walk: float
    walks: bool
    vibration: float
    lines: list[Line]
    frequency: Array
    density: Array

    @property
    def noise(self) -> float:
        """Return the noise density of all axes together."""
        return rms(self.hover)


@dataclass(frozen=True, slots=True)
class Vibration:
    """Noise by sensor; `rest` and `hover` in s, `rotors` (4,) Hz in hover."""

    sensors: dict[str, SensorNoise]
    rest: float
    hover: float
    rate: float
    rotors: Array
    parameters: FlownParameters

    @property
    def notch(self) -> float:
        """Return the frequency (Hz) of the strongest line that is worth a notch; 0 for none."""
        one = self.sensors["gyroscope"]
        worth = [
            line
            for line in one.lines
            if line.frequency >= NOTCH_LOWEST and line.rms**2 >= NOTCH_SHARE * one.vibration**2
        ]
        return worth[0].frequency if worth else 0.0

    def metrics(self) -> dict[str, float]:
        """Return the figures by name; angular ones in degrees."""
        found = {"rest_s": self.rest, "hover_s": self.hover, "rotor_Hz": float(self.rotors.mean())}
        for name, one in self.sensors.items():
            found |= {
                f"{name}_noise": one.noise,
                f"{name}_noise_at_rest": rms(one.rest),
                f"{name}_vibration_rms": one.vibration,
                f"{name}_bias_walk_at_most": one.walk,
                f"{name}_uncertain_share": one.uncertain,
            }
        return found

    def limits(self) -> dict[str, float]:
        """Return the largest acceptable values."""
        return {f"{name}_uncertain_share": UNCERTAIN_MAX for name in self.sensors}

    def record(self) -> CalibrationRecord:
        """Return the record of the noise. Raises MeasurementError beyond the parameters' bounds."""
        values: dict[str, float] = {}
        figures = [Quality(name="rotors", value=float(self.rotors.mean()), unit="Hz")]
        residuals = []
        for name, one in self.sensors.items():
            unit, _ = UNITS[name]
            values[f"{name}_noise"] = one.noise
            if one.walks:
                values[f"{name}_bias_walk"] = one.walk
            walk = "walk" if one.walks else "walk at most"
            figures += [
                Quality(name=f"{name} vibration, rms", value=one.vibration, unit=unit),
                Quality(name=f"{name} at rest", value=rms(one.rest), unit=f"{unit}/√Hz"),
                Quality(name=f"{name} bias {walk}", value=one.walk, unit=f"{unit}/√s"),
            ]
            figures += [
                Quality(name=f"line {k.source}, {k.frequency:.1f} Hz", value=k.rms, unit=unit)
                for k in one.lines[:4]
            ]
            residuals += [
                (f"{name} {axis}, of the noise proposed", float(value / one.noise - 1.0))
                for axis, value in zip("xyz", one.hover, strict=True)
            ]
        _check_bounds(values)
        proposed: dict[str, ParameterValue] = {
            f"{PARAMETER}{name}": float(f"{value:.3g}") for name, value in values.items()
        }
        if self.notch:
            proposed[NOTCH] = float(round(self.notch))
        return CalibrationRecord(
            name="vibration",
            values=proposed,
            figures=tuple(figures),
            quality=tuple(
                Quality(name=f"{name} uncertain", value=one.uncertain, limit=UNCERTAIN_MAX)
                for name, one in self.sensors.items()
            ),
            residuals=tuple(residuals),
            conditions={
                "meaning": "white noise of the IMU in hover, without the rotors' lines",
                "rest": f"{self.rest:.1f} s",
                "hover": f"{self.hover:.1f} s",
                "rate": f"{self.rate:.0f} Hz",
            },
        )


def _check_bounds(values: Mapping[str, float]) -> None:
    """Raise MeasurementError for a value beyond the parameter's bounds."""
    for name, value in values.items():
        low, high = BOUNDS[name]
        if not low <= value <= high:
            raise MeasurementError(
                f"{name.replace('_', ' ')} {value:.3g} is outside what the estimator "
                f"accepts: {low:g} to {high:g}; find what is loose, then fly again"
            )


def read_vibration(log: Path, vehicle: str) -> Vibration:
    """Read rest and hover from a log. Raises LogFormatError without the topics, MeasurementError
    when one of them is missing or too short, or the vehicle was moved at rest.
    """
    parameters = read_parameters(log)
    columns = read_columns(log, vehicle, WANTED)
    imu, actuators = columns["imu"], columns["actuators"]
    begin, end = _longest(columns["status"], "mode", "ready")
    end -= BLOCK  # the start of the motors is known to a tenth of a second
    start, stop = _longest(columns["status"], "behavior", "hover")
    start += SETTLE
    for name, seconds, least in (
        ("rest", end - begin, REST_MIN),
        ("hover", stop - start, HOVER_MIN),
    ):
        if not seconds >= least:
            raise MeasurementError(
                f"{log.name} has {max(seconds, 0.0):.1f} s of {name}, {least:g} s are needed"
            )
    rest = _window(imu, begin, end)
    hover = _window(imu, start, stop)
    inside = (actuators.time >= start) & (actuators.time <= stop)
    rotors = rotor_frequency(actuators.rows(THRUSTS)[inside].astype(np.float64).mean(axis=0))
    return estimate_vibration(rest, hover, rotors, parameters)


def estimate_vibration(
    rest: tuple[Array, Array],
    hover: tuple[Array, Array],
    rotors: Array,
    parameters: FlownParameters,
) -> Vibration:
    """Estimate the noise from (time (N,) s, specific force and angular velocity (N, 6)) of both.

    Args:
        rotors: (4,) Hz, turns per second in hover.

    Raises MeasurementError like `read_vibration`.
    """
    rest_rate, at_rest = evenly(*rest)
    rate, in_hover = evenly(*hover)
    sensors = {}
    for k, (name, (unit, factor)) in enumerate(UNITS.items()):
        part = slice(3 * k, 3 * k + 3)
        _check_rest(name, at_rest[:, part], rest_rate, unit, factor)
        sensors[name] = _sensor(
            factor * at_rest[:, part], rest_rate, factor * in_hover[:, part], rate, rotors
        )
    return Vibration(
        sensors, len(at_rest) / rest_rate, len(in_hover) / rate, rate, rotors, parameters
    )


def _sensor(rest: Array, rest_rate: float, hover: Array, rate: float, rotors: Array) -> SensorNoise:
    short = max(1, round(SHORT * rest_rate))
    white = allan_variance(rest, short) * short / rest_rate
    long = round(LONG_SHARE * len(rest))
    seconds = long / rest_rate
    excess = float(np.mean(allan_variance(rest, long)) * seconds / np.mean(white))
    walks = excess > CHANCE
    seen = (excess - 1.0 if walks else CHANCE - 1.0) * float(np.mean(white)) / seconds
    frequency, density = spectrum(rate, hover)
    band = (frequency >= LOWEST) & (frequency <= 0.48 * rate)
    part = density[band]
    floor, used = np.empty(3), 0
    for axis in range(3):
        quiet = part[part[:, axis] < QUIET * np.median(part[:, axis]), axis]
        floor[axis], used = quiet.mean(), used + len(quiet)
    segments = 2.0 * len(hover) / rate  # half overlapping windows of one second
    return SensorNoise(
        rest=np.sqrt(white),
        hover=np.sqrt(0.5 * floor),
        uncertain=0.5 / math.sqrt(used * segments / 2.0)
        + float(np.std(np.sqrt(floor)) / np.mean(np.sqrt(floor))) / math.sqrt(3.0),
        walk=math.sqrt(3.0 * seen / seconds),
        walks=walks,
        vibration=math.sqrt(float(part.mean(axis=1).sum() * frequency[1])),
        lines=lines_of(frequency, density.mean(axis=1), rotors, LOWEST),
        frequency=frequency,
        density=density,
    )


def _check_rest(name: str, values: Array, rate: float, unit: str, factor: float) -> None:
    """Raise MeasurementError when the means of the rest's parts differ, because it was moved."""
    count = max(1, round(BLOCK * rate))
    means = values[: len(values) // count * count].reshape(-1, count, 3).mean(axis=1)
    off = float(np.abs(means - means.mean(axis=0)).max())
    if off > MOVED[name]:
        raise MeasurementError(
            f"the vehicle was moved at rest: the {name}'s mean over {BLOCK:g} s was off by "
            f"{factor * off:.2f} {unit}, allowed are {factor * MOVED[name]:.2f} {unit}; leave it "
            "standing and begin again"
        )


def _window(imu: Series, start: float, end: float) -> tuple[Array, Array]:
    inside = (imu.time >= start) & (imu.time <= end)
    return imu.time[inside], imu.table(FORCE + RATE, start, end)


def _longest(status: Series, path: str, text: str) -> tuple[float, float]:
    """Return start and end (s) of the longest time with this text; NaN when it never was."""
    changes = [*status.changes(path), (float(status.time[-1]), "")]
    spans = [(begin, changes[k + 1][0]) for k, (begin, was) in enumerate(changes) if was == text]
    return max(spans, key=lambda span: span[1] - span[0], default=(math.nan, math.nan))
